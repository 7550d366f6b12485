"""A program's connection to its federation: a command centre stepped in the caller's thread."""

from collections.abc import Callable, Generator, Sequence
from contextlib import suppress
from functools import cached_property
from logging import getLogger
from pathlib import Path
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import NamedTuple, Protocol, Self, TypeAlias, TypeVar

from dyknow.federation.members.command_centre import CommandCentre, PlatformView, Steppable
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import Content
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.federation.sharing.ontology import Ontology
from dyknow.federation.transport import WireEffect, WireEvent
from dyknow.model.errors import NothingFound, did_you_mean
from dyknow.runtime.clock import NodeClock
from dyknow.runtime.configuration.config import WireConfig
from dyknow.runtime.configuration.ontologies import ontology_of
from dyknow.runtime.configuration.reach import COMMAND_CENTRE, speaks_as, trust_files
from dyknow.runtime.configuration.session import load_trust
from dyknow.runtime.configuration.settings import Settings

T = TypeVar("T")
SETTLE_S = 1.0
ALONE_US = 600_000
"""After this long without a link to anyone there is no platform to wait for."""
QUIET_US = 250_000
_LAST_WORDS_S = 0.3
_STEP_S = 0.05


class Wait(NamedTuple):
    """A job's wait for a condition, for some seconds at most; the result is whether the condition holds."""

    condition: Callable[[], bool]
    within_s: float


Job: TypeAlias = Generator[Wait, bool, T]
"""Steps of a member, between which it takes events: alone (`Client.run`) or among others (`MemberThread.post`)."""


class WireEdge(Protocol):
    """An open edge."""

    @property
    def zid(self) -> str: ...
    def peers(self) -> tuple[str, ...]: ...
    def perform(self, effect: WireEffect) -> None: ...
    def close(self) -> None: ...


class EventQueue(Protocol):
    """Where the wire's events wait; `get` raises queue.Empty when `timeout` seconds pass without one."""

    def put(self, item: WireEvent, /) -> None: ...
    def get(self, block: bool = True, timeout: float | None = None) -> WireEvent: ...


Clock = Callable[[], int]
_log = getLogger("dyknow")


class ClientPorts(NamedTuple):
    """The ports of a client.

    Attributes:
        mailbox: where its events wait.
        now_us: the node clock, in microseconds.
        open_wire: how its wire is opened.
        trouble: why there may be no platform, a phrase for each endpoint that cannot be reached.
    """

    mailbox: EventQueue
    now_us: Clock
    open_wire: Callable[[Callable[[WireEvent], None], Clock], WireEdge]
    trouble: Callable[[], list[str]] = list


class Client:
    """A command centre, its mailbox and its wire. Nothing happens but inside `step`, which its waiting calls.

    Args:
        ports: its ports.
        make_centre: given the identity of the session, for tokens, and the time.
        federation: its name, for messages.
        extensions: modules that bring further tasks and semantic labels.
        ontology: file of semantic labels.

    Attributes:
        on_trouble: called with a platform and why its answer is not among those of a question to many.
    """

    def __init__(
        self,
        ports: ClientPorts,
        make_centre: Callable[[str, int], CommandCentre],
        federation: str = "default",
        extensions: tuple[str, ...] = (),
        ontology: Path | None = None,
    ) -> None:
        self.federation, self.extensions = federation, extensions
        self._ontology_file = ontology
        self.on_trouble: Callable[[str, str], None] = lambda unit, why: _log.warning("platform %s: %s", unit, why)
        self.now_us, self._mailbox, self._trouble = ports.now_us, ports.mailbox, ports.trouble
        self._wire = ports.open_wire(self._mailbox.put, self.now_us)
        self._since_us = self.now_us()
        self.centre, self._not_heard = make_centre(self._wire.zid, self._since_us), set[str]()
        self.centre.on_refused = self._say_refused
        self._perform(self.centre.start(self.now_us()))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Leave: acts that are not acknowledged yet get a last moment, unless something went wrong."""
        try:
            if kind is None:
                self.wait_for(lambda: not self.centre.member.acts.conversations.delivery.unacknowledged, _LAST_WORDS_S)
            self._perform(self.centre.leave(self.now_us()))
        finally:
            self._wire.close()

    def _say_refused(self, unit: str) -> None:
        """Say once of each member that it speaks in a conversation of others."""
        if unit not in self._not_heard:
            self._not_heard.add(unit)
            self.on_trouble(unit, "it spoke in a conversation that it takes no part in, and is not heard there")

    def _perform(self, effects: list[WireEffect]) -> None:
        for effect in effects:
            self._wire.perform(effect)

    # Waiting

    def step(self, timeout_s: float) -> None:
        """Wait for the next event or deadline, at most `timeout_s`, and act on it."""
        with suppress(Empty):
            self.take(self._mailbox.get(timeout=min(timeout_s, self.due_s)))
        self.pass_time()

    def take(self, event: WireEvent) -> None:
        """Act on one event of the wire."""
        self._perform(self.centre.on_event(event, self.now_us()))

    @property
    def due_s(self) -> float:
        """How long until `pass_time` has work; seconds, 0 if it has."""
        return max(0, self.centre.deadline_us - self.now_us()) / 1e6

    def pass_time(self) -> None:
        """Do what is due by now."""
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

    def run(self, job: "Job[T]") -> T:
        """Do a job in the caller's thread; its result, or its error."""
        try:
            wait = next(job)
            while True:
                wait = job.send(self.wait_for(wait.condition, wait.within_s))
        except StopIteration as done:
            result: T = done.value
            return result

    def settle(self, timeout_s: float = SETTLE_S) -> list[PlatformView]:
        """Wait until the directory has settled; the platforms that are there."""
        self.wait_for(self.is_settled, timeout_s)
        return self.centre.platforms()

    def is_settled(self) -> bool:
        """Whether the directory has settled, or there has been no link to anyone for so long that none will come."""
        now_us = self.now_us()
        if self.centre.settled(now_us, QUIET_US):
            return True
        is_alone = now_us >= self._since_us + ALONE_US and not self.centre.platforms(all_kinds=True)
        return is_alone and not self._wire.peers()

    def no_platform(self) -> str:
        """That there is no platform, and what to do about it."""
        trouble = "".join(f"\n{why}" for why in self._trouble())
        signs = "" if self.centre.member.trust is not None else ", or their roster, if they have one, with --roster"
        return (
            f"no platform of federation {self.federation} is there; start some with dyknow up, "
            f"or name the federation they are in with --federation (and how to reach it with --connect){signs}.{trouble}"
        )

    @cached_property
    def ontology(self) -> Ontology:
        """The semantic labels that this program knows itself: of every member, of extensions, of its file.

        Raises:
            UnitError: an extension does not load.
            TextErrors, WrongCall: the file does not read.
        """
        return ontology_of(self.extensions, self._ontology_file)

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

    def begin(self, call: Steppable) -> None:
        """Step a call of ours from now on."""
        self._perform(self.centre.begin(call, self.now_us()))

    def end(self, call: Steppable) -> None:
        """The call is over."""
        self._perform(self.centre.end(call, self.now_us()))

    def decide(self, dialogue: Dialogue, performative: Performative, content: Content) -> None:
        """Accept or reject what was proposed in a call of ours."""
        self._perform(self.centre.decide(dialogue, performative, content, self.now_us()))

    def over(self, task: str) -> None:
        """Have each platform know that a task has ended."""
        self._perform(self.centre.over(task, self.now_us()))

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
        self.settle()
        return self.pick(unit)

    def pick(self, unit: str | None) -> list[str]:
        """The same, of those that are known by now.

        Raises:
            NothingFound: as `chosen`.
        """
        units = [view.unit for view in self.centre.platforms()]
        if not units:
            raise NothingFound(self.no_platform())
        if unit is None:
            return units
        if unit not in units:
            raise NothingFound(f"no platform {unit!r} is there.{did_you_mean(unit, units)}")
        return [unit]

    def answers(
        self,
        units: Sequence[str],
        content: Content,
        performative: Performative,
        within_s: float,
        take: Callable[[Dialogue], object] = lambda _dialogue: None,
    ) -> "Job[list[Dialogue]]":
        """Ask these platforms; the dialogues in the order in which they were over. `take` gets each as soon as it is."""
        waiting = [self.say(unit, performative, content, within_s=within_s) for unit in units]
        until_us, ended = self.now_us() + round((within_s + _LAST_WORDS_S) * 1e6), list[Dialogue]()
        while waiting:
            if not (yield Wait(lambda: any(one.over for one in waiting), max(0, until_us - self.now_us()) / 1e6)):
                for dialogue in waiting:
                    dialogue.failed, dialogue.over = dialogue.failed or "no answer in time", True
            for dialogue in [one for one in waiting if one.over]:
                waiting.remove(dialogue)
                ended.append(dialogue)
                take(dialogue)
        return ended

    def ask(
        self, units: Sequence[str], content: Content, performative: Performative, timeout_s: float
    ) -> list[Dialogue]:
        """The same, done."""
        return self.run(self.answers(units, content, performative, timeout_s))


def command_centre(settings: Settings, unit: str, key: Path | None = None) -> Callable[[str, int], CommandCentre]:
    """A function that makes the member of a `Client`, given the identity of its session and the time.

    Raises:
        RosterError: the roster does not load; the key, when the member is made.
    """
    files = trust_files(settings, COMMAND_CENTRE if settings.roster is None else speaks_as(settings, key).unit, key)

    def made(zid: str, now_us: int) -> CommandCentre:
        return CommandCentre(unit, now_us, zid=zid, trust=load_trust(files, settings.federation, now_us, unit))

    return made


def client_ports(wire: WireConfig) -> ClientPorts:
    """A Zenoh session and the clock of this process.

    Raises:
        SessionFailed: on opening; an endpoint cannot be listened on, or the configuration is refused.
        RosterError: the security file does not load.
    """
    from dyknow.proxies.zenoh.edge import ZenohEdge
    from dyknow.runtime.configuration.session import wire_options

    options = wire_options(wire)

    def opened(post: Callable[[WireEvent], None], now_us: Clock) -> WireEdge:
        edge = ZenohEdge(options, post, now_us)
        edge.open()
        return edge

    def trouble() -> list[str]:
        from dyknow.proxies.zenoh.reachability import unreachable

        return unreachable(wire.connect)

    return ClientPorts(SimpleQueue(), NodeClock().now_us, opened, trouble)
