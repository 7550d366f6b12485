"""Platforms on a fake wire and clock, with vehicles that fly straight: a federation in a box, for one test."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from heapq import heappop, heappush
from itertools import count
from typing import Any, NamedTuple

from agents.config import PlatformConfig
from agents.effects import Effect, Event, Halt, Note, Reported
from agents.platform import Platform
from dyknow.model.errors import Refused
from federation import keys
from federation.members.command_centre import CommandCentre
from federation.members.member import Member
from federation.messages.acts import Act, Performative
from federation.messages.codec import decode_act
from federation.messages.contents import Content
from federation.messages.dialogue import Dialogue
from federation.messages.receipts import RECEIPT_AGENT
from federation.security.trust import Trust
from federation.transport import (
    Answer,
    Answered,
    AnswerEnd,
    Arrived,
    Ask,
    Asked,
    AskEnded,
    DeclareQueryable,
    DeclareToken,
    Put,
    Reopen,
    Subscribe,
    TokenChanged,
    UndeclareToken,
    Unsubscribe,
    WatchTokens,
)
from navigation.vehicle import Command, CommandResult, HomeReport, PositionReport, Report, StatusReport, VelocityReport
from sim_uavs.world.units import WorldProcess
from sim_uavs.world.world import LASTING

EPOCH = 1_700_000_000_000_000
METRE_DEG = 1 / 111_320.0
P = Performative


class Crossed(NamedTuple):
    """One put, as it left its sender (`""`: somebody who is no platform)."""

    at_us: int
    sender: str
    put: Put


class Said(NamedTuple):
    """One answer, as the asker got it."""

    performative: Performative
    content: Content | None
    act: Act


@dataclass
class Vehicle:
    """Flies straight and level: metres north and east of 58 N 15 E, metres above mean sea level, metres per second.

    `armed`, `guided`, `airborne`, `mode` are what it says of itself, nothing if `says_status` is not set; `home_m` is
    the height of its home above mean sea level, None while it has none. Orders it accepts, or refuses with `answer`;
    None: they are never acknowledged.
    """

    north_m: float = 0.0
    east_m: float = 0.0
    altitude_m: float = 100.0
    north_m_s: float = 0.0
    east_m_s: float = 0.0
    is_silent: bool = False
    answer: str | None = ""
    armed: bool = True
    guided: bool = True
    airborne: bool | None = True
    mode: str = "GUIDED"
    says_status: bool = True
    home_m: float | None = 50.0

    def states(self, now_us: int) -> list[Report]:
        """What it says of itself beside how it moves."""
        found: list[Report] = []
        if self.home_m is not None:
            found.append(HomeReport(now_us, 58.0, 15.0, self.home_m))
        if self.says_status:
            found.append(StatusReport(now_us, self.armed, self.guided, self.airborne, self.mode))
        return found


@dataclass
class Node:
    process: WorldProcess
    vehicle: Vehicle | None = None
    subscriptions: set[str] = field(default_factory=set)
    queryables: set[str] = field(default_factory=set)
    tokens: set[str] = field(default_factory=set)
    watches: set[str] = field(default_factory=set)
    commands: list[tuple[int, Command]] = field(default_factory=list)
    other: list[Effect] = field(default_factory=list)
    frozen: bool = False
    waiting: list[Event] = field(default_factory=list)

    @property
    def platform(self) -> Platform:
        assert isinstance(self.process, Platform)
        return self.process


@dataclass
class Question:
    """What was asked, and what came: nothing (`why_silent`) or answers."""

    conversation: str
    answers: list[Said] = field(default_factory=list)
    why_silent: str | None = None

    @property
    def performatives(self) -> list[Performative]:
        return [said.performative for said in self.answers]

    @property
    def contents(self) -> list[Content | None]:
        return [said.content for said in self.answers]

    @property
    def reason(self) -> str:
        """The text of the reason in the last answer."""
        return getattr(self.answers[-1].content, "text", "") if self.answers else ""


class Wire:
    """The world. `log` holds every put; `deaf[a, b]`: b hears nothing of a."""

    def __init__(self, delay_us: int = 500) -> None:
        self.now_us, self.delay_us = EPOCH, delay_us
        self.nodes: dict[str, Node] = {}
        self.log: list[Crossed] = []
        self.deaf: set[tuple[str, str]] = set()
        self.drop: Callable[[str, str, Put], bool] = lambda _sender, _receiver, _put: False
        self._queue: list[tuple[int, int, Callable[[], None]]] = []
        self._numbers = count(1)
        self._boots = count(1)
        self._asked: dict[int, tuple[Node, int]] = {}
        self.feeding = True

    # -- what tests do -----------------------------------------------------------------------------------------

    def join(self, unit: str, vehicle: Vehicle | None = None, **config: Any) -> Platform:
        """A platform starts."""
        platform = Platform(
            PlatformConfig(unit, **{"boot": self.now_us // 1000 + next(self._boots), **config}), self.now_us
        )
        node = self._start(unit, Node(platform, vehicle or Vehicle()))
        self._later(0, lambda: self._report(unit, node))
        return platform

    def centre(self, unit: str = "cc", trust: Trust | None = None) -> CommandCentre:
        """A command centre, which has no vehicle, starts."""
        centre = CommandCentre(unit, self.now_us, trust=trust)
        self._start(unit, Node(centre))
        return centre

    def _start(self, unit: str, node: Node) -> Node:
        self.nodes[unit] = node
        self.perform(unit, node.process.start(self.now_us))
        return node

    def ask(
        self, by: str, unit: str, content: Content, performative: Performative = P.REQUEST, within_us: int = 2_000_000
    ) -> Question:
        """One platform's interface agent asks another's; `run` to hear the answers."""
        question = Question("")

        def on_reply(act: Act, said: Content | None, _is_last: bool, _now_us: int) -> None:
            question.answers.append(Said(act.performative, said, act))

        def on_silence(why: str, _now_us: int) -> None:
            question.why_silent = why

        try:
            question.conversation = self.member(by).acts.ask(
                unit, content, self.now_us, performative=performative, on_reply=on_reply, on_silence=on_silence,
                within_us=within_us, standing=content.head in LASTING,
            )  # fmt: skip
        except Refused as refused:
            question.why_silent = refused.reason
        self.settle(by)
        return question

    def asked(self, by: str, unit: str, content: Content, performative: Performative = P.REQUEST) -> Question:
        """Ask, and wait a tenth of a second for answers."""
        question = self.ask(by, unit, content, performative)
        self.run(0.1)
        return question

    def cancel(self, by: str, unit: str, conversation: str) -> None:
        self.member(by).acts.cancel(unit, conversation, self.now_us)
        self.settle(by)

    def cancel_task(self, by: str, unit: str, conversation: str) -> Dialogue:
        """End a task of `unit` that `by` need not have delegated."""
        dialogue = Dialogue(unit, conversation)
        self.member(by).acts.cancel_task(
            unit, conversation, self.now_us, on_reply=dialogue.on_reply, on_silence=dialogue.on_silence
        )
        self.settle(by)
        return dialogue

    def settle(self, unit: str) -> None:
        """Send what a platform has to say after it was stepped by hand."""
        self.perform(unit, self.nodes[unit].process.on_time(self.now_us))

    def inject(self, key: str, payload: bytes) -> None:
        """Somebody who is no platform puts bytes on a key."""
        self._put("", Put(key, payload, None))  # type: ignore[arg-type]

    def kill(self, unit: str) -> None:
        node = self.nodes.pop(unit)
        for token in node.tokens:
            self._tell_token(unit, token, alive=False)

    def freeze(self, unit: str) -> None:
        self.nodes[unit].frozen = True

    def expire(self, unit: str) -> None:
        """The sessions of the others end theirs with a platform that has been silent for the length of a lease."""
        for token in self.nodes[unit].tokens:
            self._tell_token(unit, token, alive=False)

    def thaw(self, unit: str) -> None:
        node = self.nodes[unit]
        node.frozen = False
        waiting, node.waiting = node.waiting, []
        for event in waiting:
            self._deliver(unit, node, event)

    def cut(self, one: Iterable[str], other: Iterable[str]) -> None:
        others = list(other)
        for a in one:
            for b in others:
                self.deaf |= {(a, b), (b, a)}

    def heal(self) -> None:
        self.deaf.clear()
        for unit, node in self.nodes.items():
            for token in node.tokens:
                self._tell_token(unit, token, alive=True)

    def run(self, seconds: float) -> None:
        until_us = self.now_us + round(seconds * 1e6)
        while True:
            due_us, unit = min(
                ((n.process.deadline_us, u) for u, n in self.nodes.items() if not n.frozen), default=(until_us + 1, "")
            )
            if self._queue and self._queue[0][0] <= due_us:
                if self._queue[0][0] > until_us:
                    break
                at_us, _, happen = heappop(self._queue)
                self.now_us = max(self.now_us, at_us)
                happen()
            elif due_us > until_us:
                break
            else:
                self.now_us = max(self.now_us, due_us)
                self.perform(unit, self.nodes[unit].process.on_time(self.now_us))
        self.now_us = until_us

    # -- what tests look at ------------------------------------------------------------------------------------

    @property
    def platforms(self) -> dict[str, Platform]:
        """Those that run, by unit."""
        return {unit: node.process for unit, node in self.nodes.items() if isinstance(node.process, Platform)}

    def member(self, unit: str) -> Member:
        return self.nodes[unit].process.member

    def platform(self, unit: str) -> Platform:
        return self.nodes[unit].platform

    def acts(self, sender: str | None = None, receiver: str | None = None, head: str | None = None) -> list[Act]:
        """Every act that crossed, once each, however often it was put."""
        found: dict[tuple[str, int, int], Act] = {}
        for crossed in self.log:
            key = keys.parse_key(crossed.put.key)
            if isinstance(key, keys.ActKey) and key.agent != RECEIPT_AGENT and crossed.sender:
                act = decode_act(crossed.put.payload)[0]
                found.setdefault((act.sender.unit, act.boot, act.seq), act)
        return [
            act
            for act in found.values()
            if (sender is None or act.sender.unit == sender)
            and (receiver is None or act.receiver.unit == receiver)
            and (head is None or (act.content is not None and act.content.head == head))
        ]

    def samples(self, owner: str, since_us: int = 0) -> int:
        """How many stream samples an owner has put."""
        return sum(
            crossed.sender == owner and crossed.at_us >= since_us and crossed.put.key.startswith(f"x/{owner}/")
            for crossed in self.log
        )

    # -- the wire ----------------------------------------------------------------------------------------------

    def perform(self, unit: str, effects: Iterable[Effect]) -> None:
        node = self.nodes[unit]
        for effect in effects:
            match effect:
                case Put():
                    self._put(unit, effect)
                case Subscribe(expr):
                    node.subscriptions.add(expr)
                case Unsubscribe(expr):
                    assert expr in node.subscriptions, f"{unit} ends {expr}, which it never began"
                    node.subscriptions.discard(expr)
                case DeclareQueryable(expr):
                    node.queryables.add(expr)
                case DeclareToken(key):
                    node.tokens.add(key)
                    self._tell_token(unit, key, alive=True)
                case UndeclareToken(key):
                    node.tokens.discard(key)
                    self._tell_token(unit, key, alive=False)
                case WatchTokens(expr):
                    node.watches.add(expr)
                    for owner, other in self.nodes.items():
                        for token in other.tokens if owner != unit else ():
                            self._post(owner, unit, TokenChanged(token, 0, alive=True))
                case Ask():
                    self._ask(unit, node, effect)
                case Answer(ask, key, payload):
                    asker, question = self._asked[ask]
                    self._post(unit, asker.process.member.unit, Answered(question, key, 0, payload))
                case AnswerEnd(ask):
                    asker, question = self._asked.pop(ask)
                    self._post(unit, asker.process.member.unit, AskEnded(question, 0))
                case Command():
                    node.commands.append((self.now_us, effect))
                    answer = node.vehicle.answer if node.vehicle is not None else ""
                    if answer is not None:
                        result = CommandResult(self.now_us, effect.number, not answer, answer)
                        self._post(unit, unit, Reported(self.now_us, result))
                case Note() | Halt() | Reopen():
                    node.other.append(effect)
                case _:
                    node.other.append(effect)

    def _put(self, sender: str, put: Put) -> None:
        self.log.append(Crossed(self.now_us, sender, put))
        for unit, node in list(self.nodes.items()):
            heard = any(keys.matches(expr, put.key) for expr in node.subscriptions)
            if unit != sender and heard and not self.drop(sender, unit, put):
                self._post(sender, unit, Arrived(put.key, 0, put.payload))

    def _tell_token(self, owner: str, token: str, *, alive: bool) -> None:
        for unit, node in list(self.nodes.items()):
            if unit != owner and any(keys.matches(expr, token) for expr in node.watches):
                self._post(owner, unit, TokenChanged(token, 0, alive=alive))

    def _ask(self, unit: str, asker: Node, ask: Ask) -> None:
        """Answered by whoever has a queryable there; over at the end of the answer, or of the time."""
        for other, node in list(self.nodes.items()):
            if other != unit and any(keys.matches(expr, ask.key) for expr in node.queryables):
                number = next(self._numbers)
                self._asked[number] = (asker, ask.question)
                self._post(unit, other, Asked(number, ask.key, 0, ask.payload))
        self._later(ask.timeout_us, lambda: self._deliver(unit, asker, AskEnded(ask.question, self.now_us)))

    def _post(self, sender: str, receiver: str, event: Any) -> None:
        if (sender, receiver) in self.deaf:
            return
        node = self.nodes.get(receiver)
        if node is not None:
            self._later(self.delay_us, lambda: self._deliver(receiver, node, event._replace(at_us=self.now_us)))

    def _deliver(self, unit: str, node: Node, event: Event) -> None:
        if self.nodes.get(unit) is not node:
            return
        if node.frozen:
            node.waiting.append(event)
            return
        self.perform(unit, node.process.on_event(event, self.now_us))

    def _later(self, after_us: int, happen: Callable[[], None]) -> None:
        heappush(self._queue, (self.now_us + after_us, next(self._numbers), happen))

    # -- vehicles ----------------------------------------------------------------------------------------------

    def _report(self, unit: str, node: Node) -> None:
        """Ten times a second: where the vehicle is, and what it says of itself."""
        if self.nodes.get(unit) is not node or node.vehicle is None:
            return
        self._later(100_000, lambda: self._report(unit, node))
        vehicle, now_us = node.vehicle, self.now_us
        if vehicle.is_silent:
            return
        since_s = (now_us - EPOCH) / 1e6
        latitude = 58.0 + (vehicle.north_m + vehicle.north_m_s * since_s) * METRE_DEG
        longitude = 15.0 + (vehicle.east_m + vehicle.east_m_s * since_s) * METRE_DEG / 0.5299
        for report in (
            *vehicle.states(now_us),
            PositionReport(now_us, "GLOBAL_POSITION_INT", latitude, longitude, vehicle.altitude_m),
            VelocityReport(now_us, "GLOBAL_POSITION_INT", vehicle.north_m_s, vehicle.east_m_s, 0.0),
        ):
            self._deliver(unit, node, Reported(now_us, report))
