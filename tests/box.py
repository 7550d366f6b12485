"""The fake world of all tests: platforms and command centres on the wire of the simulated world, for one test.

Beside what that world can do it keeps every put, loses what a test wants lost, and has vehicles that fly straight.
"""

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property
from itertools import count
from queue import Empty
from random import Random
from typing import Any, NamedTuple

from dyknow.agents.config import PlatformConfig
from dyknow.agents.effects import Event
from dyknow.agents.platform import Platform
from dyknow.federation import keys
from dyknow.federation.members.clock import FederationClock
from dyknow.federation.members.command_centre import CommandCentre
from dyknow.federation.members.member import Member
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.codec import decode_act
from dyknow.federation.messages.contents import Content
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.federation.messages.receipts import RECEIPT_AGENT
from dyknow.federation.security.trust import Trust
from dyknow.federation.transport import Ask, Put, Reopen, WireEffect
from dyknow.navigation.vehicle import (
    NO_ANSWER,
    BatteryReport,
    Command,
    CommandResult,
    HomeReport,
    PositionReport,
    Report,
    StatusReport,
    VelocityReport,
)
from dyknow.runtime.client import ClientPorts
from dyknow.sim_uavs.dynamics.faults import SimulatedFault
from dyknow.sim_uavs.world.sessions import Direction, Session, SessionLink
from dyknow.sim_uavs.world.units import WorldNode
from dyknow.sim_uavs.world.wire import Wire
from dyknow.sim_uavs.world.world import START_US, World

EPOCH = START_US
METRE_DEG = 1 / 111_320.0
REPORT_US = 100_000
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
    None: they are never acknowledged. `is_lost`: it does not say where it is. `battery` is the fraction that is left, None while it says none.
    """

    north_m: float = 0.0
    east_m: float = 0.0
    altitude_m: float = 100.0
    north_m_s: float = 0.0
    east_m_s: float = 0.0
    is_silent: bool = False
    is_lost: bool = False
    answer: str | None = ""
    armed: bool = True
    guided: bool = True
    airborne: bool | None = True
    mode: str = "GUIDED"
    says_status: bool = True
    home_m: float | None = 50.0
    battery: float | None = None
    deadline_us: int = 0
    commands: list[tuple[int, Command]] = field(default_factory=list)
    faults: list[tuple[SimulatedFault, int | None]] = field(default_factory=list)

    def states(self, stamp_us: int) -> list[Report]:
        """What it says of itself besides how it moves."""
        found: list[Report] = []
        if self.home_m is not None:
            found.append(HomeReport(stamp_us, 58.0, 15.0, self.home_m))
        if self.says_status:
            found.append(StatusReport(stamp_us, self.armed, self.guided, self.airborne, self.mode))
        if self.battery is not None:
            found.append(BatteryReport(stamp_us, self.battery))
        return found

    def on_time(self, now_us: int, stamp_us: int) -> list[Report]:
        """Ten times a second: where it is, and what it says of itself."""
        self.deadline_us = now_us + REPORT_US
        if self.is_silent:
            return []
        if self.is_lost:
            return self.states(stamp_us)
        since_s = (now_us - EPOCH) / 1e6
        latitude = 58.0 + (self.north_m + self.north_m_s * since_s) * METRE_DEG
        longitude = 15.0 + (self.east_m + self.east_m_s * since_s) * METRE_DEG / 0.5299
        return [
            *self.states(stamp_us),
            PositionReport(stamp_us, "GLOBAL_POSITION_INT", latitude, longitude, self.altitude_m),
            VelocityReport(stamp_us, "GLOBAL_POSITION_INT", self.north_m_s, self.east_m_s, 0.0),
        ]

    def on_command(self, command: Command, now_us: int, stamp_us: int) -> list[tuple[int, CommandResult]]:
        self.commands.append((now_us, command))
        if self.answer is None:
            return [(2_000_000, CommandResult(stamp_us, command.number, False, NO_ANSWER))]
        return [(0, CommandResult(stamp_us, command.number, not self.answer, self.answer))]

    def inject(self, fault: SimulatedFault, _now_us: int, until_us: int | None = None) -> None:
        self.faults.append((fault, until_us))


@dataclass
class Question:
    """What was asked, and what came: answers, or why there is none (`failed`)."""

    dialogue: Dialogue

    @property
    def conversation(self) -> str:
        return self.dialogue.conversation

    @property
    def failed(self) -> str | None:
        return self.dialogue.failed

    @property
    def answers(self) -> list[Said]:
        return [Said(act.performative, content, act) for act, content in self.dialogue.said]

    @property
    def performatives(self) -> list[Performative]:
        return [answer.performative for answer in self.answers]

    @property
    def contents(self) -> list[Content | None]:
        return [answer.content for answer in self.answers]

    @property
    def reason(self) -> str:
        """The text of the reason in the last answer."""
        return getattr(self.contents[-1], "text", "") if self.answers else ""


class RecordedWire(Wire):
    """A wire that keeps every put, and notes who asks and who opens a new session. `deaf[a, b]`: b hears nothing of a; `drop` says of a put whether it is lost."""

    log: list[Crossed]
    noted: list[tuple[int, str, Ask | Reopen]]
    deaf: set[tuple[str, str]]
    drop: Callable[[str, str, Put], bool]

    def perform(self, unit: str, effect: WireEffect) -> None:
        if isinstance(effect, Ask | Reopen):
            self.noted.append((self._agenda.now_us, unit, effect))
        super().perform(unit, effect)

    def _put(self, session: Session, effect: Put) -> None:
        self.log.append(Crossed(self._agenda.now_us, session.unit, effect))
        for direction in self._routes.of(session, effect.key):
            if not self.drop(session.unit, direction.to.unit, effect):
                self._pass(direction, 0, direction.to.arrive, effect.key, effect.payload)

    def _pass(self, direction: Direction, not_before_us: int, arrive: Callable[..., None], *what: Any) -> int:
        if (direction.by.unit, direction.to.unit) in self.deaf:
            return 0
        return super()._pass(direction, not_before_us, arrive, *what)

    def session(self, unit: str) -> Session:
        return self._sessions[unit]

    def put(self, sender: str, put: Put) -> None:
        """Have a platform, or `""` for somebody who is none, put bytes on a key."""
        if sender:
            self._put(self._sessions[sender], put)
            return
        self.log.append(Crossed(self._agenda.now_us, "", put))
        for session in self._routes._subscribed.matching(put.key):
            self._agenda.at(self._agenda.now_us + self.link.delay_us, session.arrive, put.key, put.payload)

    def expire(self, unit: str) -> None:
        """The lease of every connection with a unit is over."""
        for transport in list(self._sessions[unit].transports.values()):
            self._end(transport)

    def mend_all(self) -> None:
        for sender, receiver in list(self._cut):
            self.mend(sender, receiver)


class Inbox(deque[Any]):
    """The mailbox of a program in this process: its waiting makes the world go on."""

    def __init__(self, box: "Box") -> None:
        super().__init__()
        self._box = box

    put = deque.append

    def get(self, block: bool = True, timeout: float | None = None) -> Any:
        until_us = self._box.now_us + round((timeout or 0.0) * 1e6)
        while not self:
            if not self._box.step(until_us):
                raise Empty
        return self.popleft()


class ProgramWire:
    """The session of a program in this process."""

    def __init__(self, box: "Box", post: Callable[[Any], None]) -> None:
        self._wire, self._name = box.wire, f"program {next(box.numbers)}"
        self.zid = f"{box.random.getrandbits(64) | 1:x}"
        self._wire.open(self._name, self.zid, post, lambda: box.now_us)

    def peers(self) -> tuple[str, ...]:
        return tuple(map(str, self._wire.session(self._name).transports))

    def perform(self, effect: WireEffect) -> None:
        self._wire.perform(self._name, effect)

    def close(self) -> None:
        self._wire.kill(self._name)


class Box(World):
    """The world. Puts take `delay_us`, and none is lost unless a test says so.

    Attributes:
        clock: of all platforms.
        report_us: how long a report is under way from its vehicle.
        lacking: kinds of reports that vehicles do not send.
    """

    wire: RecordedWire
    report_us = 0
    raises = False  # each platform as it joins

    def __init__(
        self,
        seed: int = 0,
        *,
        delay_us: int = 500,
        link: SessionLink | None = None,
        clock: FederationClock | None = None,
    ) -> None:
        super().__init__(seed, truth_us=None)
        self.clock, self.lacking = clock or FederationClock(), set[type]()
        self.wire = RecordedWire(self.agenda, Random(seed), link or SessionLink(delay_us=delay_us, jitter_us=0))
        self.wire.log, self.wire.noted, self.wire.deaf, self.wire.drop = (
            [],
            [],
            set(),
            lambda _sender, _receiver, _put: False,
        )

    @cached_property
    def numbers(self) -> Any:
        """Numbers that nobody else uses."""
        return count(1)

    # -- what tests do -----------------------------------------------------------------------------------------

    def join(self, unit: str, vehicle: Vehicle | None = None, **config: Any) -> Platform:
        """A platform starts, with a vehicle."""
        given = PlatformConfig(unit, 0, **{"clock": self.clock, "contained": False, **config})
        self.add(unit, given, vehicle or Vehicle())  # type: ignore[arg-type]
        return self.platform(unit)

    def fly(self, unit: str, north_m: float, east_m: float, north_m_s: float = 0.0, **config: Any) -> Platform:
        """A platform starts whose simulated vehicle flies north, 40 m above home, and has a battery."""
        vehicle = Vehicle(north_m, east_m, 60.0, north_m_s, home_m=20.0, battery=0.8)
        return self.join(unit, vehicle, **{"simulated": True, **config})

    def end(self, unit: str) -> None:
        """A platform says good-bye and ends."""
        self.leave(unit)
        self.kill(unit)

    def centre(self, unit: str = "cc", trust: Trust | None = None) -> CommandCentre:
        """A command centre starts."""
        centre = self.add_command_centre(unit, trust=trust).process
        assert isinstance(centre, CommandCentre)
        return centre

    def question(
        self, by: str, to: str, content: Content, performative: Performative = P.REQUEST, within_us: int = 2_000_000
    ) -> Question:
        """One member asks another; `run` to hear the answers."""
        return Question(self.ask(by, to, content, performative, within_us))

    def asked(self, by: str, unit: str, content: Content, performative: Performative = P.REQUEST) -> Question:
        """Ask, and wait a tenth of a second for answers."""
        question = self.question(by, unit, content, performative)
        self.run(0.1)
        return question

    def shown(
        self, by: str, to: str, content: Content, evidence: bytes, performative: Performative = P.REQUEST
    ) -> Question:
        """Ask with evidence for a task, and wait a tenth of a second for answers."""
        dialogue = Dialogue(to)

        def ask(member: Member, now_us: int) -> None:
            dialogue.conversation = member.acts.ask(
                to, content, now_us, performative=performative, on_reply=dialogue.on_reply,
                on_silence=dialogue.on_silence, evidence=evidence,
            )  # fmt: skip

        self.speak(by, ask)
        self.run(0.1)
        return Question(dialogue)

    def evidence(self, task: str) -> bytes:
        """The act that delegated a task, as it crossed."""
        for crossed in self.wire.log:
            key = keys.parse_key(crossed.put.key)
            if isinstance(key, keys.ActKey) and key.agent != RECEIPT_AGENT and crossed.sender:
                act = decode_act(crossed.put.payload)[0]
                if act.conversation_id == task and act.performative in {P.REQUEST, P.REQUEST_WHEN}:
                    return crossed.put.payload
        raise LookupError(task)

    def cancel_task(self, by: str, unit: str, conversation: str) -> Dialogue:
        """End a task of `unit` that `by` need not have delegated."""
        dialogue = Dialogue(unit, conversation)
        self.speak(
            by,
            lambda member, now_us: member.acts.cancel_task(
                unit, conversation, now_us, on_reply=dialogue.on_reply, on_silence=dialogue.on_silence
            ),
        )
        return dialogue

    def settle(self, unit: str) -> None:
        """Send what a platform has to say after it was stepped by hand."""
        self.speak(unit, lambda _member, _now_us: None)

    def happens(self, unit: str, event: Event) -> None:
        """An event that is not of the wire reaches a platform."""
        self._step(self.nodes[unit], event)
        self._wake(self.nodes[unit])

    def put(self, key: str, payload: bytes) -> None:
        """Somebody who is no platform puts bytes on a key."""
        self.wire.put("", Put(key, payload, None))  # type: ignore[arg-type]

    def cut(self, one: Iterable[str], other: Iterable[str]) -> None:
        self.partition(one, other)

    def client_ports(self) -> ClientPorts:
        """For a program that takes part."""
        return ClientPorts(Inbox(self), lambda: self.now_us, lambda post, _now_us: ProgramWire(self, post))

    def step(self, until_us: int) -> bool:
        """Do what is due next by `until_us`; False, and that time, if there is nothing."""
        queue = self.agenda._queue
        is_due = bool(queue) and queue[0][0] <= until_us
        self.agenda.run_until(queue[0][0] if is_due else until_us)
        return is_due

    def run(self, seconds: float) -> None:
        self.run_for(seconds)

    def _report(self, node: WorldNode, report: Report) -> None:
        is_unanswered = isinstance(report, CommandResult) and self.vehicle(node.unit).answer is None
        if type(report) not in self.lacking and not is_unanswered:
            if self.report_us:
                self.agenda.at(self.now_us + self.report_us, super()._report, node, report)
            else:
                super()._report(node, report)

    # -- what tests look at ------------------------------------------------------------------------------------

    @property
    def running(self) -> dict[str, WorldNode]:
        """The nodes whose processes run and do not stand still."""
        return {unit: node for unit, node in self.nodes.items() if node.process is not None and not node.frozen}

    @property
    def platforms(self) -> dict[str, Platform]:
        """Those that run, or stand still, by unit."""
        return {unit: node.platform for unit, node in self.nodes.items() if node.platform is not None}

    def member(self, unit: str) -> Member:
        process = self.nodes[unit].process
        assert process is not None
        return process.member

    def vehicle(self, unit: str) -> Vehicle:
        vehicle = self.nodes[unit].vehicle
        assert isinstance(vehicle, Vehicle)
        return vehicle

    def acts(self, sender: str | None = None, receiver: str | None = None, head: str | None = None) -> list[Act]:
        """Every act that crossed, once each, however often it was put."""
        found: dict[tuple[str, int, int], Act] = {}
        for crossed in self.wire.log:
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
            for crossed in self.wire.log
        )
