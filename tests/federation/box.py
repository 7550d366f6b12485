"""Directories on a fake wire and clock: delay, loss, cuts in one or both directions, kills, freezes, restarts."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from heapq import heappop, heappush
from itertools import count
from random import Random

from federation import keys
from federation.members.directory import DirectoryEvent, DirectoryFacilitator
from federation.members.offers import Service, Visibility
from federation.messages.codec import decode_heartbeat
from federation.messages.descriptions import LabelEntry
from federation.transport import (
    Answer,
    Answered,
    AnswerEnd,
    Ask,
    Asked,
    AskEnded,
    DeclareToken,
    Put,
    Reopen,
    UndeclareToken,
)

FEDERATION = Service("dyknow-federation", "federation", Visibility.PROTECTED)
ALARMS = Service("alarms", "alarms", Visibility.PUBLIC)
SECRET = Service("local-instance", "gateway", Visibility.PRIVATE)
POSITION = LabelEntry(label="heli-position", sort="position", type_hash="0a1b2c3d", period_us=100_000)
ALTITUDE = LabelEntry(label="heli-altitude", sort="altitude", type_hash="1a1b2c3d", period_us=100_000)


@dataclass
class Node:
    """One platform: its directory, what it was told, and its session on the wire."""

    directory: DirectoryFacilitator
    events: list[tuple[int, DirectoryEvent]] = field(default_factory=list)
    tokens: set[str] = field(default_factory=set)
    reopened: list[int] = field(default_factory=list)
    asks: int = 0
    alive: bool = True
    frozen: bool = False
    waiting: list[Callable[[], None]] = field(default_factory=list)


class Box:
    """A world of directories. `deaf[a, b]` means that b hears nothing of what a says."""

    def __init__(self, seed: int = 0, delay_us: int = 500, loss: float = 0.0) -> None:
        self.now_us = 1_700_000_000_000_000
        self.nodes: dict[str, Node] = {}
        self.deaf: set[tuple[str, str]] = set()
        self.random, self.delay_us, self.loss = Random(seed), delay_us, loss
        self._queue: list[tuple[int, int, Callable[[], None]]] = []
        self._numbers = count()
        self._boots = count(1_000)
        self.heals_by_reopening = True

    # what tests do

    def join(
        self, unit: str, services: Iterable[Service] = (FEDERATION,), labels: Iterable[LabelEntry] = (POSITION,)
    ) -> Node:
        directory = DirectoryFacilitator(unit, next(self._boots), "uav", self.now_us)
        node = self.nodes[unit] = Node(directory)
        directory.declare(services, labels, self.now_us)
        self._perform(unit, node, directory.start(self.now_us))
        for other in self.nodes.values():
            for token in other.tokens:
                self._tell_token(other.directory.unit, unit, token, alive=True)
        return node

    def kill(self, unit: str, token_after_us: int | None = 10_000) -> None:
        """The process is gone; the others' transports notice after `token_after_us`, or (None) not at all."""
        node = self.nodes.pop(unit)
        node.alive = False
        if token_after_us is not None:
            for token in node.tokens:
                self._later(token_after_us, lambda token=token: self._broadcast_token(unit, token, alive=False))

    def freeze(self, unit: str) -> None:
        self.nodes[unit].frozen = True

    def thaw(self, unit: str) -> None:
        node = self.nodes[unit]
        node.frozen = False
        waiting, node.waiting = node.waiting, []
        self._step(unit, node)
        for arrived in waiting:
            arrived()

    def cut(self, one: Iterable[str], other: Iterable[str], *, both_ways: bool = True) -> None:
        for a in one:
            for b in other:
                self.deaf.add((a, b))
                if both_ways:
                    self.deaf.add((b, a))

    def heal(self) -> None:
        self.deaf.clear()
        for unit, node in self.nodes.items():
            for token in node.tokens:
                self._broadcast_token(unit, token, alive=True)

    def run(self, seconds: float) -> None:
        until_us = self.now_us + round(seconds * 1e6)
        while True:
            due = [(node.directory.deadline_us, unit) for unit, node in self.nodes.items() if not node.frozen]
            next_us, unit = min(due, default=(until_us + 1, ""))
            if self._queue and self._queue[0][0] <= next_us:
                if self._queue[0][0] > until_us:
                    break
                self.now_us, _, arrived = heappop(self._queue)
                arrived()
                continue
            if next_us > until_us:
                break
            self.now_us = max(self.now_us, next_us)
            self._step(unit, self.nodes[unit])
        self.now_us = until_us

    def present(self, unit: str) -> set[str]:
        return {entry.unit for entry in self.nodes[unit].directory.entries()} - {unit}

    def seen(self, unit: str, *kinds: type) -> list[DirectoryEvent]:
        return [event for _, event in self.nodes[unit].events if isinstance(event, kinds)]

    def when(self, unit: str, kind: type, about: str) -> int:
        """When `unit` was last told such an event about `about`."""
        return max(at_us for at_us, event in self.nodes[unit].events if isinstance(event, kind) and event.unit == about)

    # the wire

    def _step(self, unit: str, node: Node) -> None:
        self._perform(unit, node, node.directory.on_time(self.now_us))

    def _perform(self, unit: str, node: Node, outcome: Iterable[object]) -> None:
        for effect in outcome:
            match effect:
                case Put(key, payload):
                    self._each(unit, lambda _, to, k=key, p=payload: self._hear(to, lambda: self._put(to, k, p)))
                case DeclareToken(key):
                    node.tokens.add(key)
                    self._broadcast_token(unit, key, alive=True)
                case UndeclareToken(key):
                    node.tokens.discard(key)
                    self._broadcast_token(unit, key, alive=False)
                case Ask():
                    node.asks += 1
                    self._ask(unit, node, effect)
                case Reopen():
                    node.reopened.append(self.now_us)
                    if self.heals_by_reopening:
                        self.deaf = {pair for pair in self.deaf if unit not in pair}
                case tuple() if type(effect).__module__.startswith("federation.") and not _is_wire(effect):
                    node.events.append((self.now_us, effect))  # type: ignore[arg-type]

    def _put(self, node: Node, key: str, payload: bytes) -> None:
        directory, parsed = node.directory, keys.parse_key(key)
        if isinstance(parsed, keys.AnnouncementKey):
            outcome = directory.on_announced(parsed.unit, payload, self.now_us)
        else:
            outcome = directory.on_heartbeat(decode_heartbeat(payload), self.now_us)
        self._perform(directory.unit, node, outcome)

    def _each(self, sender: str, deliver: Callable[[str, Node], None]) -> None:
        for unit, node in list(self.nodes.items()):
            if unit != sender and (sender, unit) not in self.deaf and self.random.random() >= self.loss:
                self._later(self._delay(), lambda unit=unit, node=node: deliver(unit, node))

    def _hear(self, node: Node, arrived: Callable[[], None]) -> None:
        if not node.alive:
            return
        if node.frozen:
            node.waiting.append(arrived)
        else:
            arrived()

    def _broadcast_token(self, owner: str, token: str, *, alive: bool) -> None:
        for unit in list(self.nodes):
            self._tell_token(owner, unit, token, alive=alive)

    def _tell_token(self, owner: str, unit: str, token: str, *, alive: bool) -> None:
        node = self.nodes[unit]
        if owner == unit or (owner, unit) in self.deaf:
            return
        parsed = keys.parse_key(token)
        assert parsed is not None
        self._later(
            self._delay(),
            lambda: self._hear(
                node, lambda: self._perform(unit, node, node.directory.on_token(parsed, alive, self.now_us))
            ),
        )

    def _ask(self, unit: str, node: Node, ask: Ask) -> None:
        owner = ask.key.removesuffix("/df")
        other = self.nodes.get(owner)
        link = {(unit, owner), (owner, unit)}
        if other is None or link & self.deaf or other.frozen or self.random.random() < self.loss:
            wait_us = 0 if other is None else ask.timeout_us
            self._later(wait_us, lambda: node.directory.on_ask_ended(AskEnded(ask.question, self.now_us)))
            return

        def answered() -> None:
            for said in other.directory.on_asked(Asked(ask.question, ask.key, self.now_us, ask.payload)):
                if isinstance(said, Answer):
                    found = Answered(ask.question, ask.key, self.now_us, said.payload)
                    self._hear(node, lambda f=found: self._perform(unit, node, node.directory.on_answered(f)))
                elif isinstance(said, AnswerEnd):
                    node.directory.on_ask_ended(AskEnded(ask.question, self.now_us))

        self._later(2 * self._delay(), answered)

    def _delay(self) -> int:
        return self.random.randrange(self.delay_us) + 1

    def _later(self, after_us: int, what: Callable[[], None]) -> None:
        heappush(self._queue, (self.now_us + after_us, next(self._numbers), what))


def _is_wire(effect: object) -> bool:
    return type(effect).__module__ == "federation.transport"


def three(delay_us: int = 500) -> Box:
    """Platforms 0, 1, 2 that have found each other."""
    box = Box(delay_us=delay_us)
    for unit in ("0", "1", "2"):
        box.join(unit)
    box.run(2)
    return box
