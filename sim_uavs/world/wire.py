"""A wire in a box: Zenoh's service for platforms, in one process, on a fake clock, from one seed.

Sessions put, subscribe, declare tokens and queryables and ask, as `dyknow.federation.transport` says. Between each two
of them lies a transport with two directions, each with a delay, jitter, loss, duplication and reordering of its own.
Zenoh's behaviour under faults (measured) is kept:

* a killed process resets its connections: its tokens go within milliseconds; behind a cut only with the lease;
* a direction that is cut, or a process that stands still, ends the transport with the lease, both ways; it comes back
  some time after the last obstacle went, and tokens are declared again;
* a deaf direction loses what is put while tokens stay; only a new session at either end mends it.
"""

from collections.abc import Callable, Iterable
from random import Random
from typing import Any

from dyknow.federation import keys
from dyknow.federation import transport as wire
from dyknow.sim_uavs.world.agenda import Agenda
from dyknow.sim_uavs.world.questions import Questions
from dyknow.sim_uavs.world.routes import Routes
from dyknow.sim_uavs.world.sessions import Direction, Session, SessionLink, Transport

_new = tuple.__new__  # makes a NamedTuple in half the time

LEASE_US = 2_000_000
CONNECT_US = (5_000, 30_000)
RECONNECT_US = (50_000, 1_000_000)
REOPEN_US = (20_000, 500_000)
RESET_US = (500, 10_000)

Post = Callable[[wire.WireEvent], None]


class Wire:
    """All sessions and what connects them.

    Args:
        agenda: the world's time.
        random: the one generator of everything that is by chance here.
        link: the properties of every direction until `set_link` changes them.
        reach: whether two units are in radio range of each other, either way round; everybody is by default.
    """

    def __init__(
        self,
        agenda: Agenda,
        random: Random,
        link: SessionLink | None = None,
        *,
        lease_us: int = LEASE_US,
        reach: Callable[[str, str], bool] = lambda _one, _other: True,
    ) -> None:
        self.link = link or SessionLink()
        self._agenda, self._random, self._lease_us, self._reach = agenda, random, lease_us, reach
        self._sessions: dict[str, Session] = {}
        self._dying: dict[int, Session] = {}
        self._links: dict[tuple[str, str], SessionLink] = {}
        self._cut: set[tuple[str, str]] = set()
        self._numbers = 0
        self._routes = Routes()
        self._questions = Questions(agenda, self._pass)
        self._perform: dict[type, Callable[[Session, Any], None]] = {
            wire.Put: self._put,
            wire.Subscribe: lambda session, effect: self._routes.subscribe(session, effect.key_expr),
            wire.Unsubscribe: lambda session, effect: self._routes.unsubscribe(session, effect.key_expr),
            wire.DeclareToken: self._declare_token,
            wire.UndeclareToken: self._undeclare_token,
            wire.WatchTokens: self._watch,
            wire.DeclareQueryable: lambda session, effect: self._questions.declare(session, effect.key_expr),
            wire.Ask: self._questions.ask,
            wire.Answer: self._questions.answer,
            wire.AnswerEnd: self._questions.answer_end,
            wire.Reopen: lambda session, _effect: self._reopen(session),
        }

    # -- who is there -------------------------------------------------------------------------------------------

    def open(self, unit: str, zid: str, post: Post, now_us: Callable[[], int]) -> None:
        """A process opens its session. Events are stamped with its clock when they reach it, and posted."""
        if unit in self._sessions:
            raise ValueError(f"{unit} has a session already")
        self._numbers += 1
        session = self._sessions[unit] = Session(self._numbers, unit, zid, post, now_us)
        self._connect_all(session)

    def kill(self, unit: str) -> None:
        """The process is gone, at once and without a word; messages in its connections are lost."""
        session = self._sessions.pop(unit)
        session.alive = False
        self._routes.close(session)
        self._questions.forget(session)
        self._dying[session.number] = session
        for transport in list(session.transports.values()):
            outgoing = transport.direction(session)
            if not outgoing.is_cut:
                self._agenda.at(self._soon(RESET_US), self._end, transport)
            elif not transport.up:
                self._end(transport)
            else:
                self._silence(transport, outgoing)
        self._end_dying(session)

    def freeze(self, unit: str) -> None:
        """The process stands still, its kernel continues: messages to it wait, it sends none."""
        session = self._sessions[unit]
        session.frozen = True
        for transport in session.transports.values():
            self._silence(transport, transport.direction(session))

    def thaw(self, unit: str) -> None:
        session = self._sessions[unit]
        session.frozen = False
        for transport in session.transports.values():
            self._reconnect(transport)

    # -- obstacles ----------------------------------------------------------------------------------------------

    def set_link(self, sender: str, receiver: str, link: SessionLink) -> None:
        """Set the properties of the direction from `sender` to `receiver` from now on."""
        self._links[sender, receiver] = link
        transport = self._between(sender, receiver)
        if transport is not None:
            transport.direction(self._sessions[sender]).link = link

    def cut(self, sender: str, receiver: str) -> None:
        """Nothing of `sender` reaches `receiver` from now on."""
        self._cut.add((sender, receiver))
        transport = self._between(sender, receiver)
        if transport is not None:
            direction = transport.direction(self._sessions[sender])
            direction.is_cut = True
            transport.settle()
            self._silence(transport, direction)

    def mend(self, sender: str, receiver: str) -> None:
        """The cut in that direction is over."""
        self._cut.discard((sender, receiver))
        transport = self._between(sender, receiver)
        if transport is not None:
            transport.direction(self._sessions[sender]).is_cut = False
            transport.settle()
            self._reconnect(transport)
        for session in list(self._dying.values()):
            for dead in list(session.transports.values()):
                if {sender, receiver} == {dead.one.unit, dead.other.unit}:
                    self._agenda.at(self._soon(RESET_US), self._end, dead)

    def deafen(self, sender: str, receiver: str) -> None:
        """`receiver` hears no more puts of `sender`, though both sessions believe in each other."""
        transport = self._between(sender, receiver)
        if transport is not None:
            transport.direction(self._sessions[sender]).is_deaf = True
            transport.settle()

    # -- effects ------------------------------------------------------------------------------------------------

    def perform(self, unit: str, effect: wire.WireEffect) -> None:
        """Do what a platform asks of its wire."""
        session = self._sessions[unit]
        self._perform[type(effect)](session, effect)

    def _put(self, session: Session, effect: wire.Put) -> None:
        """Send it to everybody; where the link is steady, all have it at the same instant: one event."""
        key, payload = effect.key, effect.payload
        shared, is_steady, agenda = self.link, self.link.is_steady, self._agenda
        at_us = agenda.now_us + shared.delay_us
        together: list[Session] = []
        for direction in self._routes.of(session, key):
            if is_steady and direction.link is shared and direction.last_us <= at_us:
                direction.last_us = at_us
                together.append(direction.to)
            else:
                self._pass(direction, 0, direction.to.arrive, key, payload)
        if together:
            agenda.at(at_us, _arrive, together, key, payload)

    def _pass(self, direction: Direction, not_before_us: int, arrive: Callable[..., None], *what: Any) -> int:
        """Send one message on its way: `arrive(*what)` when it is there. Returns when that is, or 0 if it is lost."""
        delay_us, jitter_us, loss, duplication, reordering, late_us = direction.link
        random, agenda = self._random.random, self._agenda
        if loss and random() < loss:
            return 0
        at_us = agenda.now_us + delay_us + int(random() * jitter_us)
        if at_us < direction.last_us or at_us < not_before_us:
            at_us = max(direction.last_us, not_before_us)
        if reordering and random() < reordering:
            at_us += int(random() * late_us)
        else:
            direction.last_us = at_us
        agenda.at(at_us, arrive, *what)
        if duplication and random() < duplication:
            agenda.at(at_us + int(random() * late_us), arrive, *what)
        return at_us

    # -- tokens -------------------------------------------------------------------------------------------------

    def _declare_token(self, session: Session, effect: wire.DeclareToken) -> None:
        session.tokens.setdefault(effect.key)
        for direction in session.outgoing:
            if direction.is_up:
                self._tell(direction, effect.key)

    def _undeclare_token(self, session: Session, effect: wire.UndeclareToken) -> None:
        session.tokens.pop(effect.key, None)
        for direction in session.outgoing:
            self._untell(direction, session.named(effect.key))

    def _watch(self, session: Session, effect: wire.WatchTokens) -> None:
        session.watches.setdefault(effect.key_expr)
        for direction in session.incoming:
            if direction.is_up:
                for key in direction.by.tokens:
                    self._tell(direction, key)

    def _tell(self, direction: Direction, declared: str) -> None:
        key = direction.by.named(declared)
        if key not in direction.told and any(keys.matches(expr, key) for expr in direction.to.watches):
            direction.told[key] = None
            self._control(direction, key, alive=True)

    def _untell(self, direction: Direction, key: str) -> None:
        if key in direction.told:
            del direction.told[key]
            self._control(direction, key, alive=False)

    def _control(self, direction: Direction, key: str, *, alive: bool) -> None:
        """Tokens are never lost, and overtake each other never."""
        link = direction.link
        at_us = self._agenda.now_us + link.delay_us + int(self._random.random() * link.jitter_us)
        direction.last_us = max(at_us, direction.last_us)
        self._agenda.at(direction.last_us, direction.to.take, wire.TokenChanged, alive, key)

    # -- transports ---------------------------------------------------------------------------------------------

    def _between(self, one: str, other: str) -> Transport | None:
        session, peer = self._sessions.get(one), self._sessions.get(other)
        return None if session is None or peer is None else session.transports.get(peer.number)

    def _soon(self, within_us: tuple[int, int]) -> int:
        return self._agenda.now_us + self._random.randint(*within_us)

    def _connect_all(self, session: Session) -> None:
        for other in self._sessions.values():
            if other is session or not self._reach(session.unit, other.unit):
                continue
            transport = Transport(session, other)
            for direction in (transport.there, transport.back):
                ends = (direction.by.unit, direction.to.unit)
                direction.link = self._links.get(ends, self.link)
                direction.is_cut = ends in self._cut
            self._reconnect(transport, CONNECT_US)

    def _silence(self, transport: Transport, direction: Direction) -> None:
        """Nothing comes in that direction from now on; the lease runs."""
        if transport.up and direction.silent_since_us is None:
            direction.silent_since_us = self._agenda.now_us
            self._agenda.at(self._agenda.now_us + self._lease_us, self._lease_over, transport, direction)

    def _lease_over(self, transport: Transport, direction: Direction) -> None:
        since_us = direction.silent_since_us
        if since_us is None or not transport.up or self._agenda.now_us < since_us + self._lease_us:
            return
        if direction.is_silent:
            self._end(transport)

    def _end(self, transport: Transport) -> None:
        """The transport is down: its tokens are gone, questions over it are over."""
        if transport.up:
            transport.up = False
            transport.settle()
            for direction in (transport.there, transport.back):
                for key in list(direction.told):
                    self._untell(direction, key)
            self._questions.down(transport)
        for direction in (transport.there, transport.back):
            direction.silent_since_us = None
        for session in (transport.one, transport.other):
            if not session.alive:
                transport.part()
                self._end_dying(session)

    def _end_dying(self, session: Session) -> None:
        if not session.transports:
            self._dying.pop(session.number, None)

    def _reconnect(self, transport: Transport, within_us: tuple[int, int] = RECONNECT_US) -> None:
        """An obstacle went: if it was the last, the transport stays, or comes up again."""
        for direction in (transport.there, transport.back):
            if not direction.is_silent:
                direction.silent_since_us = None
        if not transport.up and transport.is_clear:
            self._agenda.at(self._soon(within_us), self._up, transport)

    def _up(self, transport: Transport) -> None:
        if transport.up or not transport.is_clear:
            return
        transport.up = True
        transport.settle()
        for direction in (transport.there, transport.back):
            for key in direction.by.tokens:
                self._tell(direction, key)

    def _reopen(self, session: Session) -> None:
        """Close the session and open a new one, which declares everything again under an identity of its own."""
        unit = session.unit
        for question in self._questions.of(session):
            self._questions.end(question)
        self.kill(unit)
        self._numbers += 1
        again = Session(self._numbers, unit, session.zid, session.post, session.now_us)
        again.take_over(session)
        self._sessions[unit] = again
        self._routes.open(again)
        self._questions.open(again)
        self._agenda.at(self._soon(REOPEN_US), self._opened, again)

    def _opened(self, session: Session) -> None:
        if self._sessions.get(session.unit) is session:
            self._connect_all(session)


def _arrive(sessions: Iterable[Session], key: str, payload: bytes) -> None:
    for session in sessions:
        if session.alive:
            session.post(_new(wire.Arrived, (key, session.now_us(), payload)))
