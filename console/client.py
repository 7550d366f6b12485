"""A command's connection to its federation: the command centre stepped in the caller's thread."""

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import NamedTuple, Protocol, Self

from console.centre import CommandCentre
from console.command import Call
from console.dialogue import Dialogue, Keyring, Seen
from console.errors import NothingFound, WrongCall, did_you_mean
from console.launch import COMMAND_CENTRE, commands_wire, trust_of
from federation.acts import Performative
from federation.contents import Content
from federation.transport import WireEffect, WireEvent
from federation.trust import Roster, Signer
from runtime.clock import NodeClock

SETTLE_S = 1.0
QUIET_US = 250_000
_LAST_WORDS_S = 0.3
_STEP_S = 0.05


class Wire(Protocol):
    """What a client asks of its edge, which is open."""

    @property
    def zid(self) -> str: ...
    def perform(self, effect: WireEffect) -> None: ...
    def close(self) -> None: ...


class Mailbox(Protocol):
    """Where the wire's events wait; `get` raises queue.Empty when `timeout` seconds pass without one."""

    def put(self, item: WireEvent, /) -> None: ...
    def get(self, block: bool = True, timeout: float | None = None) -> WireEvent: ...


Clock = Callable[[], int]


class Surroundings(NamedTuple):
    """What a client lives in: its mailbox, the node clock in microseconds, and how its wire is opened."""

    mailbox: Mailbox
    now_us: Clock
    open_wire: Callable[[Callable[[WireEvent], None], Clock], Wire]


class Client:
    """The command centre, its mailbox and its wire. Nothing happens but inside `step`, which its waiting calls."""

    def __init__(self, around: Surroundings, make_centre: Callable[[str, int], CommandCentre]) -> None:
        """`make_centre` is told the identity of the session, for its tokens, and the time."""
        self.now_us, self._mailbox = around.now_us, around.mailbox
        self._wire = around.open_wire(self._mailbox.put, self.now_us)
        self.centre = make_centre(self._wire.zid, self.now_us())
        self._perform(self.centre.start(self.now_us()))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Go: acts that nobody has acknowledged yet get a last moment, unless something went wrong."""
        try:
            if kind is None:
                self.wait_for(lambda: not self.centre.conversations.delivery.deadline_us, _LAST_WORDS_S)
            self._perform(self.centre.leave(self.now_us()))
        finally:
            self._wire.close()

    def _perform(self, effects: list[WireEffect]) -> None:
        for effect in effects:
            self._wire.perform(effect)

    # Waiting

    def step(self, timeout_s: float) -> None:
        """Wait for the next event or deadline, at most `timeout_s`, and act on it."""
        due_s = max(0, self.centre.deadline_us - self.now_us()) / 1e6
        try:
            event = self._mailbox.get(timeout=min(timeout_s, due_s))
            self._perform(self.centre.on_event(event, self.now_us()))
        except Empty:
            pass
        if self.centre.deadline_us <= (now_us := self.now_us()):
            self._perform(self.centre.on_time(now_us))

    def wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Step until `condition` holds or the time is over; whether it holds."""
        until_us = self.now_us() + round(timeout_s * 1e6)
        while not condition():
            left_us = until_us - self.now_us()
            if left_us <= 0:
                return False
            self.step(min(left_us / 1e6, _STEP_S))
        return True

    def settle(self, timeout_s: float = SETTLE_S) -> list[Seen]:
        """Wait until the directory has settled; the platforms that are there."""
        self.wait_for(lambda: self.centre.settled(self.now_us(), QUIET_US), timeout_s)
        return self.centre.platforms()

    # Asking

    def federation_us(self) -> int:
        """Federation time."""
        return self.centre.clock.federation_us(self.now_us())

    def say(
        self, unit: str, performative: Performative, content: Content, *, within_s: float = 2.0, standing: bool = False
    ) -> Dialogue:
        """Open a conversation with a platform's Interface Agent."""
        dialogue, effects = self.centre.say(
            unit, performative, content, self.now_us(), within_us=round(within_s * 1e6), standing=standing
        )
        self._perform(effects)
        return dialogue

    def cancel(self, unit: str, conversation: str, *, within_s: float = 2.0) -> Dialogue:
        """End a task; the answer comes in the dialogue."""
        dialogue, effects = self.centre.cancel(unit, conversation, self.now_us(), within_us=round(within_s * 1e6))
        self._perform(effects)
        return dialogue

    def chosen(self, unit: str | None) -> list[str]:
        """The platforms to ask: this one, or all that are there.

        Raises:
            NothingFound: there is none, or not the one that was named; the message says what to do.
        """
        there = self.settle()
        units = [seen.unit for seen in there]
        if not units:
            raise NothingFound(
                f"no platform of federation {self.centre.federation} is there; start some with dyknow up, "
                "or name the federation they are in with --federation (and how to reach it with --connect)."
            )
        if unit is None:
            return units
        if unit not in units:
            raise NothingFound(f"no platform {unit!r} is there.{did_you_mean(unit, units)}")
        return [unit]

    def ask(
        self, units: list[str], content: Content, performative: Performative, timeout_s: float
    ) -> Iterator[Dialogue]:
        """Ask these platforms; each dialogue as soon as it is over."""
        waiting = [self.say(unit, performative, content, within_s=timeout_s) for unit in units]
        until_us = self.now_us() + round((timeout_s + _LAST_WORDS_S) * 1e6)
        while waiting:
            over = self._over(waiting, (until_us - self.now_us()) / 1e6)
            for dialogue in over:
                waiting.remove(dialogue)
                yield dialogue

    def _over(self, waiting: list[Dialogue], timeout_s: float) -> list[Dialogue]:
        """Wait until one of them is over, at most this long; then all of them have failed."""
        if not self.wait_for(lambda: any(dialogue.over for dialogue in waiting), max(0.0, timeout_s)):
            for dialogue in waiting:
                dialogue.failed, dialogue.over = dialogue.failed or "no answer in time", True
        return [dialogue for dialogue in waiting if dialogue.over]


@contextmanager
def connected(call: Call) -> Iterator[Client]:
    """The command centre of this call in its federation.

    Raises:
        SessionFailed: an endpoint cannot be listened on, or the configuration is refused.
    """
    keyring = _keyring(call)
    unit = f"{COMMAND_CENTRE}-{os.getpid()}"

    def centre(zid: str, now_us: int) -> CommandCentre:
        return CommandCentre(unit, call.settings.federation, now_us, zid=zid, keyring=keyring)

    with call.out.waiting("looking for platforms"):
        client = Client(_surroundings(call), centre)
    with client:
        yield client


def _surroundings(call: Call) -> Surroundings:
    """A Zenoh session and the clock of this process."""
    from proxies.zenoh_config import ZenohOptions
    from proxies.zenoh_edge import ZenohEdge

    wire = commands_wire(call)
    security = json.loads(wire.security.read_text(encoding="utf-8")) if wire.security else None
    options = ZenohOptions(
        wire.federation, wire.listen, wire.connect, wire.discover, wire.interface, wire.lease_ms, security=security
    )

    def opened(post: Callable[[WireEvent], None], now_us: Clock) -> Wire:
        edge = ZenohEdge(options, post, now_us)
        edge.open()
        return edge

    mailbox: SimpleQueue[WireEvent] = SimpleQueue()
    return Surroundings(mailbox, NodeClock().now_us, opened)


def _keyring(call: Call) -> Keyring | None:
    trust = trust_of(call, COMMAND_CENTRE)
    if trust.roster is None or trust.key is None:
        return None
    try:
        roster = Roster.parse(trust.roster.read_text(encoding="utf-8"))
        seed = bytes.fromhex(trust.key.read_text(encoding="ascii").strip())
    except OSError as error:
        raise WrongCall(f"--roster: {error.filename} cannot be read ({error.strerror}); check the path.") from None
    return Keyring(roster, Signer(seed, call.settings.federation))
