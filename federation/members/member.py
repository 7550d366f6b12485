"""A member of a federation: the common part of every participant, whether it flies, asks or only listens.

It holds the directory, conversations with their delivery, the clock offsets of its peers, the verification of acts and
the imported streams. A value that is stepped: wire events in, wire effects out, time (the node clock) an argument. It
passes news on to its `MemberAgents` by plain calls, in the order of the events.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import count
from typing import Protocol

from dyknow.federation import keys, transport
from dyknow.federation.members.clock import FederationClock
from dyknow.federation.members.correspondence import ActAgents, Audit, Correspondence
from dyknow.federation.members.directory import DirectoryEvent, DirectoryFacilitator, Kind, Tails
from dyknow.federation.members.directory import Outcome as DirectoryOutcome
from dyknow.federation.members.imports import ImportName, Imports, Take
from dyknow.federation.members.liveness import PlatformAppeared, PlatformGone, PlatformReturned
from dyknow.federation.members.offsets import ClockOffsets
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.codec import Heartbeat, decode_description, decode_heartbeat
from dyknow.federation.messages.newest import Newest
from dyknow.federation.security.trust import Roster, Trust
from dyknow.model.errors import DecodeError, RosterError

P = Performative
DUPLICATE_US = 1_000_000
DUPLICATES = 8
"""How many other lives of our own name are kept in mind."""


class MemberAgents(ActAgents, Protocol):
    """Agents of a member. Times are the node clock."""

    def on_peer(self, change: DirectoryEvent, now_us: int) -> None:
        """Something changed in the directory: pass it to `Member.follow` once its own consequences are drawn."""

    def on_clock(self, unit: str, now_us: int) -> None:
        """The clock of a peer, compared with ours, can be relied on more, or less, than before."""


class Member:
    """See the module.

    Args:
        unit: its name in the federation.
        boot: its incarnation, greater in each later one: milliseconds since the epoch at its start.
        agents: called with the events.
        audit: given each act that passes.
        emit: takes each effect as it arises.
        clock: the federation's; None: learned from the first platform that is met.
        tails: the newest number of each exported stream, for heartbeats.
        trust: None in an open federation.

    Attributes:
        since_us: when it began.
        refused: events that do not belong here, by reason.
    """

    def __init__(
        self,
        unit: str,
        boot: int,
        now_us: int,
        agents: MemberAgents,
        audit: Audit,
        emit: Callable[[transport.WireEffect], None],
        *,
        kind: Kind = "command-centre",
        zid: str = "",
        clock: FederationClock | None = None,
        trust: Trust | None = None,
        tails: Callable[[], Tails] = tuple,
    ) -> None:
        self.unit, self.boot, self.trust, self.since_us, self.tails = unit, boot, trust, now_us, tails
        self.refused: Counter[str] = Counter()
        self._agents, self._emit, self._kind, self._zid = agents, emit, kind, zid
        self._questions = count(1)
        self._is_clock_known = clock is not None
        self.clock = clock or FederationClock()
        self.directory = self._new_directory(now_us)
        self.offsets = ClockOffsets(boot, self._questions)
        self.imports = Imports(self._questions)
        self.acts = Correspondence(unit, boot, agents, audit, emit, self._offset_us_of, trust)
        self._duplicates: dict[int, int] = {}

    def _new_directory(self, now_us: int) -> DirectoryFacilitator:
        roster = None if self.trust is None else self.trust.roster.fingerprint
        return DirectoryFacilitator(
            self.unit,
            self.boot,
            self._kind,
            now_us,
            zid=self._zid,
            questions=self._questions,
            clock=self.clock,
            roster=roster,
            member_of=self._member_of,
        )

    def _member_of(self, unit: str) -> str | None:
        """The member of the roster that a unit is, or whose command; without a roster it is itself."""
        if self.trust is None:
            return unit
        found = self.trust.roster.member(unit)
        return None if found is None or found.revoked else found.unit

    # -- coming and going --------------------------------------------------------------------------------------

    def start(self, now_us: int) -> None:
        """Come into the federation."""
        self._emit(transport.Subscribe(keys.inbox(self.unit)))
        self._emit(transport.Subscribe(keys.BROADCAST))
        self.take(self.directory.start(now_us), now_us)

    def leave(self, now_us: int) -> None:
        """Leave the federation: open conversations are for the others to end."""
        self.take(self.directory.leave(now_us), now_us)

    # -- streams in --------------------------------------------------------------------------------------------

    def import_stream(self, name: ImportName, take: Take, now_us: int) -> None:
        """Receive a stream that its owner announced to us: `take` is given its new samples."""
        for effect in self.imports.begin(name, take, now_us):
            self._emit(effect)

    def end_import(self, name: ImportName) -> None:
        """Receive it no longer."""
        for effect in self.imports.end(name):
            self._emit(effect)

    # -- stepping ----------------------------------------------------------------------------------------------

    def on_event(self, event: transport.WireEvent, now_us: int) -> None:
        """Take one event of the wire; a foreign one is counted in `refused`."""
        try:
            self.dispatch(event, now_us)
        except DecodeError as error:
            self.refused[error.reason] += 1
        self.acts.flush()

    def dispatch(self, event: transport.WireEvent, now_us: int) -> None:
        """The same, with the receipts left to `acts.flush`; raises DecodeError for malformed bytes."""
        match event:
            case transport.Arrived():
                self._on_arrived(event, now_us)
            case transport.TokenChanged():
                token = keys.parse_key(event.key)
                if token is not None:
                    self.take(self.directory.on_token(token, event.alive, event.at_us), now_us)
            case transport.Asked():
                self._on_asked(event, now_us)
            case transport.Answered():
                self.on_answered(event, now_us)
            case transport.AskEnded():
                self.on_ask_ended(event)
            case transport.RosterRead():
                self.on_roster(event, now_us)
            case _:
                self.refused[type(event).__name__] += 1

    @property
    def deadline_us(self) -> int:
        due_us = self.directory.deadline_us
        for part in (self.acts, self.offsets, self.imports):
            at_us = part.deadline_us
            if at_us is not None and at_us < due_us:
                due_us = at_us
        return due_us

    def on_time(self, now_us: int) -> None:
        """Send heartbeats, acts that were not acknowledged and questions, as they are due."""
        for step in self.steps:
            step(now_us)

    @property
    def steps(self) -> tuple[Callable[[int], None], ...]:
        """The steps of `on_time`, one after the other; none needs another."""
        return self._recover, self._compare_clocks, self.acts.on_time, self._beat

    def _recover(self, now_us: int) -> None:
        for ask in self.imports.on_time(now_us):
            self._emit(ask)

    def _compare_clocks(self, now_us: int) -> None:
        for ask in self.offsets.on_time(now_us):
            self._emit(ask)

    def _beat(self, now_us: int) -> None:
        tails = self.tails() if self.directory.beats_at(now_us) else ()
        self.take(self.directory.on_time(now_us, tails), now_us)

    # -- the directory -----------------------------------------------------------------------------------------

    def take(self, outcomes: Iterable[DirectoryOutcome], now_us: int) -> None:
        """Emit the effects among `outcomes` and report the events."""
        for outcome in outcomes:
            if isinstance(outcome, transport.WireEffect):
                self._emit(outcome)
            else:
                self._agents.on_peer(outcome, now_us)

    def follow(self, change: DirectoryEvent, now_us: int) -> None:
        """Draw the consequences of a peer's coming and going for its streams, its clock and conversations with it."""
        match change:
            case PlatformAppeared(unit=unit, boot=boot):
                self.imports.on_owner(unit, boot)
                self.offsets.on_appeared(unit, boot, now_us)
                self.acts.peer_appeared(unit, boot, now_us)
            case PlatformReturned(unit=unit, boot=boot):
                self.acts.peer_appeared(unit, boot, now_us)
            case PlatformGone(unit=unit):
                self.acts.peer_gone(unit, now_us)
                self.offsets.on_gone(unit)
            case _:
                pass

    def _offset_us_of(self, unit: str) -> int:
        offset = self.offsets.of(unit)
        return 0 if offset is None else offset.offset_us

    def _is_duplicate(self, boot: int, at_us: int) -> bool:
        """Whether another process has our name: heard for over a second, since an earlier life of ours may echo."""
        if boot == self.boot:
            return False
        if boot not in self._duplicates and len(self._duplicates) >= DUPLICATES:
            del self._duplicates[next(iter(self._duplicates))]
        return at_us - self._duplicates.setdefault(boot, at_us) >= DUPLICATE_US

    def _on_arrived(self, event: transport.Arrived, now_us: int) -> None:
        match key := keys.parse_key(event.key):
            case keys.ActKey():
                if key.sender == self.unit:
                    self.refused["our own name"] += 1
                else:
                    self.acts.on_arrived(event, key, now_us)
            case keys.HeartbeatKey():
                self.on_heartbeat(event, now_us)
            case keys.AnnouncementKey(unit):
                if not self._learns_clock(event):
                    self.take(self.directory.on_announced(unit, event.payload, event.at_us), now_us)
            case keys.StreamKey():
                self.imports.on_arrived(event)
            case _:
                raise DecodeError("key")

    def on_heartbeat(self, event: transport.Arrived, now_us: int) -> bool | None:
        """A heartbeat, or a description that was announced. Whether anything may follow; None: at most questions are due.

        Most of what arrives besides samples are heartbeats, and nearly always nothing follows: False.
        """
        key, at_us, payload = event
        beat = heartbeat_of(key, payload)
        if beat is None:
            self._on_arrived(event, now_us)
            return True
        outcome: Sequence[DirectoryOutcome] = ()
        if not self.directory.goes_on(beat, at_us):
            if beat.unit == self.unit and not self._is_duplicate(beat.boot, at_us):
                return False
            outcome = self.directory.on_heartbeat(beat, at_us)
        elif self.imports.tails.get(beat.unit) is beat.tails:
            return False
        is_due = self.imports.on_tails(beat.unit, beat.boot, beat.tails, at_us)
        self.take(outcome, now_us)
        return True if outcome else None if is_due else False

    def on_roster(self, event: transport.RosterRead, now_us: int) -> dict[str, Callable[[str], bool]]:
        """Go by a later generation of the roster; returns whom it revokes, and which units speak for each.

        All data of revoked members are dropped.

        A member with another key now counts as another member.

        Raises:
            DecodeError: it is no roster.
        """
        try:
            roster = Roster.parse(event.text)
        except RosterError:
            raise DecodeError("roster") from None
        if self.trust is None or not roster.is_successor_of(before := self.trust.roster):
            return {}
        self.trust.verifier.roster = roster
        revoked = {
            unit
            for unit, member in before.members.items()
            if not member.revoked
            and ((now := roster.members.get(unit)) is None or now.revoked or now.key != member.key)
        }

        def speaks_for(name: str, unit: str) -> bool:
            member = before.member(unit)
            return member is not None and member.unit == name

        def is_revoked(unit: str) -> bool:
            return any(speaks_for(name, unit) for name in revoked)

        self.take(self.directory.on_revoked(is_revoked, now_us), now_us)
        for unit in {each.peer for each in self.acts.conversations.conversations() if is_revoked(each.peer)}:
            self.acts.peer_gone(unit, now_us)  # it has spoken without being in the directory
        return {unit: partial(speaks_for, unit) for unit in sorted(revoked)}

    def _on_asked(self, event: transport.Asked, now_us: int) -> None:
        match keys.parse_key(event.key):
            case keys.ClockKey(unit) if unit == self.unit:
                for effect in self.offsets.on_asked(event, now_us):
                    self._emit(effect)
            case keys.DescribeKey(unit) if unit == self.unit:
                self.take(self.directory.on_asked(event), now_us)
            case _:
                self.refused["key"] += 1
                self._emit(transport.AnswerEnd(event.ask))

    def on_answered(self, event: transport.Answered, now_us: int) -> bool:
        """An answer to a question of ours; whether anything may follow but another question to the same peer.

        Raises:
            DecodeError: it is malformed.
        """
        compared = self.offsets.on_answered(event)
        if compared is not None:
            if compared.is_news:
                self._agents.on_clock(compared.unit, now_us)
            return compared.is_news
        if self.imports.on_answered(event) or self._learns_clock(event):
            return True
        outcome = self.directory.on_answered(event)
        self.take(outcome, now_us)
        return bool(outcome)

    def on_ask_ended(self, event: transport.AskEnded) -> bool:
        """A question of ours is over; whether anything may follow: of clocks, what came was taken when it came."""
        if self.offsets.on_ask_ended(event):
            return False
        if not self.imports.on_ask_ended(event):
            self.directory.on_ask_ended(event)
        return True

    def _learns_clock(self, event: transport.Answered | transport.Arrived) -> bool:
        """Adopt the clock that the first platform describes; whether ours was another, and the directory begins again."""
        if self._is_clock_known:
            return False
        found, key = decode_description(event.payload), keys.parse_key(event.key)
        if (
            found.kind != "uav"
            or not isinstance(key, keys.DescribeKey | keys.AnnouncementKey)
            or key.unit != found.unit
        ):
            return False
        self._is_clock_known = True
        if self.clock.agrees(found.clock_epoch_us, found.clock_speed):
            return False
        self.clock = FederationClock(found.clock_epoch_us, found.clock_speed)
        self.directory = self._new_directory(event.at_us)
        self.take(self.directory.start(event.at_us), event.at_us)
        return True


_beats = Newest(decode_heartbeat, len)


def heartbeat_of(key: str, payload: bytes) -> Heartbeat | None:
    """The heartbeat that was put on `key`, of the unit that the key names; None if it is no heartbeat's key.

    Many members in one process hear the same: it is decoded once.

    Raises:
        DecodeError: it is malformed, or names another unit.
    """
    name = keys.parse_key(key)
    if type(name) is not keys.HeartbeatKey:
        return None
    beat = _beats(name.unit, payload)
    if beat.unit != name.unit:
        raise DecodeError("key")
    return beat
