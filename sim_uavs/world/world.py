"""The simulated world: many platforms in one process, on a fake clock and a fake wire, all by chance from one seed.

The platforms are those that fly for real; only clock, wire and vehicles are simulated. Every node has a clock of its
own, which may be wrong and drift. Nothing here reads the time: a minute takes what its events take, and the same
seed gives the same events. Times are the world's, in microseconds since the epoch, unless they are called a node's.
"""

import gc
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import replace
from queue import Empty
from random import Random
from typing import Any

from agents.config import PlatformConfig
from agents.directory.directory import DirectoryAgent
from agents.effects import (
    DropHost,
    Effect,
    Event,
    Halt,
    InjectFault,
    LeaveRequested,
    Note,
    Reported,
    Specify,
    TakeHost,
    Tell,
    TellHost,
)
from agents.platform import Platform
from dyknow.model.errors import TextError
from federation.messages.acts import Act, Performative
from federation.messages.contents import Content
from federation.transport import Conflated, WireEvent
from navigation.vehicle import Command, Report
from runtime.mailbox import Mailbox
from sim_uavs.dynamics.faults import SimulatedFault, parse_fault
from sim_uavs.dynamics.vehicles import SimulatedVehicle
from sim_uavs.world.agenda import Agenda
from sim_uavs.world.sessions import SessionLink
from sim_uavs.world.units import DriftingClock, WorldDialogue, WorldNode
from sim_uavs.world.wire import LEASE_US, Wire

START_US = 1_700_000_000_000_000
TRUTH_US = 100_000


class World:
    """Units, their clocks and vehicles, and the wire between them.

    Args:
        seed: of everything that is by chance.
        link, lease_us, reach: of the wire.
        trace: gets one line per event and effect, with its time.
        truth_us: how often true positions are noted; None: never.
    """

    def __init__(
        self,
        seed: int,
        *,
        start_us: int = START_US,
        link: SessionLink | None = None,
        lease_us: int = LEASE_US,
        reach: Callable[[str, str], bool] = lambda _one, _other: True,
        trace: Callable[[str], None] | None = None,
        truth_us: int | None = TRUTH_US,
    ) -> None:
        self.agenda = Agenda(start_us)
        self.random = Random(seed)
        self.wire = Wire(self.agenda, Random(self.random.getrandbits(64)), link, lease_us=lease_us, reach=reach)
        self.nodes: dict[str, WorldNode] = {}
        self.start_us = start_us
        self._trace = trace
        if truth_us is not None:
            self.agenda.at(start_us, self._note_truth, truth_us)

    @property
    def now_us(self) -> int:
        return self.agenda.now_us

    def platform(self, unit: str) -> Platform:
        """The process of `unit`. Raises LookupError when there is none."""
        platform = self.nodes[unit].platform
        if platform is None:
            raise LookupError(f"{unit} does not run")
        return platform

    def run_until(self, at_us: int) -> None:
        """Let the world run. Meanwhile garbage is collected seldom: nearly all that a world makes stays."""
        thresholds = gc.get_threshold()
        gc.set_threshold(max(thresholds[0], 50_000), *thresholds[1:])
        try:
            self.agenda.run_until(at_us)
        finally:
            gc.set_threshold(*thresholds)

    def run_for(self, seconds: float) -> None:
        self.run_until(self.agenda.now_us + round(seconds * 1e6))

    def at(self, at_us: int, do: Callable[..., Any], *arguments: Any) -> None:
        """Have something done in the course of the run, e.g. `world.at(t, world.kill, "1")`."""
        self.agenda.at(at_us, do, *arguments)

    # -- units --------------------------------------------------------------------------------------------------

    def add(
        self,
        unit: str,
        config: PlatformConfig | None = None,
        vehicle: SimulatedVehicle | None = None,
        *,
        offset_us: int = 0,
        drift_ppm: float = 0.0,
    ) -> WorldNode:
        """A unit joins: its process starts, with a clock that is off by `offset_us`."""
        config = replace(config or PlatformConfig(unit, 0), unit=unit, vehicle=vehicle is not None)
        clock = DriftingClock(self.now_us, offset_us, drift_ppm)
        node = self.nodes[unit] = WorldNode(config, vehicle, clock, offset_us=offset_us, drift_ppm=drift_ppm)
        self._boot(node)
        if vehicle is not None:
            self.agenda.at(vehicle.deadline_us, self._fly, node, vehicle)
        return node

    def add_command_centre(self, unit: str = "cc") -> WorldNode:
        """A command centre, which delegates and asks, without a vehicle."""
        return self.add(unit, PlatformConfig(unit, 0, kind="command-centre"))

    def kill(self, unit: str) -> None:
        """End its process without a word; the vehicle continues with its last order."""
        node = self.nodes[unit]
        if node.platform is not None:
            self.wire.kill(unit)
            node.platform, node.due_us, node.frozen, node.mailbox = None, None, False, None
            self._say(unit, "killed")

    def restart(self, unit: str) -> None:
        """Restart the process, under a new boot."""
        self.kill(unit)
        node = self.nodes[unit]
        node.clock = DriftingClock(self.now_us, node.offset_us, node.drift_ppm)
        self._boot(node)

    def freeze(self, unit: str) -> None:
        """Stop the process (SIGSTOP): what is sent to it waits in its sockets."""
        node = self.nodes[unit]
        if node.platform is not None and not node.frozen:
            node.frozen, node.due_us = True, None
            node.mailbox = Mailbox(lambda: node.clock.node_us(self.now_us))
            self.wire.freeze(unit)
            self._say(unit, "frozen")

    def thaw(self, unit: str) -> None:
        """Let the process continue: it finds in its mailbox what the mailbox kept of all that came."""
        node = self.nodes[unit]
        if not node.frozen:
            return
        mailbox, node.frozen, node.mailbox = node.mailbox, False, None
        self.wire.thaw(unit)
        self._say(unit, "thawed")
        now_us = node.clock.node_us(self.now_us)
        with suppress(Empty):
            while mailbox is not None and node.platform is not None:
                event = mailbox.get(0)
                self._step(node, event._replace(at_us=now_us) if hasattr(event, "at_us") else event)
        self._wake(node)

    def partition(self, one: Iterable[str], other: Iterable[str]) -> None:
        """Nothing passes between the two groups, either way."""
        others = list(other)
        for a in one:
            for b in others:
                self.wire.cut(a, b)
                self.wire.cut(b, a)

    def heal(self, one: Iterable[str], other: Iterable[str]) -> None:
        others = list(other)
        for a in one:
            for b in others:
                self.wire.mend(a, b)
                self.wire.mend(b, a)

    def inject(self, unit: str, fault: SimulatedFault | str, duration_us: int | None = None) -> None:
        """Make the vehicle of `unit` fail, for a while or for good."""
        vehicle = self.nodes[unit].vehicle
        if vehicle is not None:
            until_us = None if duration_us is None else self.now_us + duration_us
            vehicle.inject(parse_fault(fault) if isinstance(fault, str) else fault, self.now_us, until_us)

    def leave(self, unit: str) -> None:
        """Its user takes it out of the federation; the process continues."""
        node = self.nodes[unit]
        if node.platform is not None:
            self._reach(node, LeaveRequested(node.clock.node_us(self.now_us)))

    def rejoin(self, unit: str) -> None:
        self.call(unit, lambda platform, now_us: platform.part(DirectoryAgent).rejoin(now_us))

    # -- what people do -----------------------------------------------------------------------------------------

    def call(self, unit: str, do: Callable[[Platform, int], Any]) -> Any:
        """Have a running platform do something, and carry out what follows from it.

        Raises LookupError when there is no process, or it stands still.
        """
        node = self.nodes[unit]
        platform = self.platform(unit)
        if node.frozen:
            raise LookupError(f"{unit} stands still")
        node_us = node.clock.node_us(self.now_us)
        result = do(platform, node_us)
        self._perform(node, platform.on_time(node_us))
        self._wake(node)
        return result

    def specify(self, unit: str, text: str, file: str = "") -> None:
        """Give its process a specification, in place of the one it has."""
        node = self.nodes[unit]
        self._reach(node, Specify(node.clock.node_us(self.now_us), text, file))

    def ask(
        self,
        by: str,
        to: str,
        content: Content,
        performative: Performative = Performative.REQUEST,
        within_us: int = 2_000_000,
    ) -> WorldDialogue:
        """`by` says something to the Interface Agent of `to`; the answers are collected as they come."""
        dialogue = WorldDialogue(by, to)

        def on_reply(act: Act, said: Content | None, _now_us: int) -> None:
            dialogue.replies.append((self.now_us, act, said))

        def on_silence(why: str, _now_us: int) -> None:
            dialogue.silence = why

        dialogue.conversation = self.call(
            by,
            lambda platform, now_us: platform.ports.agent.delegate(
                to,
                content,
                now_us,
                performative=performative,
                on_reply=on_reply,
                on_silence=on_silence,
                reply_within_us=within_us,
            ),
        )
        return dialogue

    def cancel(self, dialogue: WorldDialogue) -> None:
        """Cancel the conversation."""
        self.call(
            dialogue.by,
            lambda platform, now_us: platform.ports.agent.cancel(dialogue.to, dialogue.conversation, now_us),
        )

    # -- inside -------------------------------------------------------------------------------------------------

    def _boot(self, node: WorldNode) -> None:
        unit = node.config.unit
        node_us = node.clock.node_us(self.now_us)
        zid = f"{self.random.getrandbits(64) | 1:x}"
        platform = Platform(replace(node.config, boot=node_us // 1000, zid=zid), node_us)
        node.platform, node.due_us = platform, None
        node.lives.append(platform)
        self._say(unit, "booted")

        agenda, clock, deadlines = self.agenda, node.clock, platform.deadlines

        def node_now_us() -> int:
            return clock.node_us(agenda.now_us)

        def post(event: WireEvent) -> None:
            if node.platform is not platform:
                return
            if node.mailbox is not None or self._trace is not None:
                self._reach(node, event)
                return
            effects = platform.on_event(event, event.at_us)  # it was stamped just now
            if effects:
                self._perform(node, effects)
            if deadlines.due_us != node.asked_us:
                self._wake(node)

        self.wire.open(unit, zid, post, node_now_us)
        self._perform(node, platform.start(node_us))
        self._wake(node)

    def _reach(self, node: WorldNode, event: Event) -> None:
        """An event reached a process: taken at once, or found in the mailbox when the process continues."""
        if node.mailbox is not None:
            node.mailbox.post(event)
        else:
            self._step(node, event)
            self._wake(node)

    def _step(self, node: WorldNode, event: Event | Conflated) -> None:
        platform = node.platform
        if platform is not None:
            if self._trace is not None:
                self._say(node.config.unit, f"< {event!r}")
            self._perform(node, platform.on_event(event, node.clock.node_us(self.agenda.now_us)))

    def _wake(self, node: WorldNode) -> None:
        """See to it that the process is stepped when it is due."""
        platform = node.platform
        if platform is None or node.frozen:
            return
        asked_us = platform.deadline_us
        if node.due_us is not None and asked_us == node.asked_us:
            return
        node.asked_us = asked_us
        due_us = node.clock.world_us(asked_us)
        if node.due_us is None or due_us < node.due_us:
            node.due_us = due_us
            self.agenda.at(due_us, self._on_time, node, due_us)

    def _on_time(self, node: WorldNode, due_us: int) -> None:
        """The process is due; an appointment that an earlier one replaced is passed over."""
        platform = node.platform
        if platform is None or node.frozen or node.due_us != due_us:
            return
        node.due_us = None
        node_us = node.clock.node_us(self.agenda.now_us)
        if platform.deadline_us <= node_us:
            self._perform(node, platform.on_time(node_us))
        self._wake(node)

    def _fly(self, node: WorldNode, vehicle: SimulatedVehicle) -> None:
        stamp_us = node.config.clock.federation_us(node.clock.node_us(self.now_us))
        for report in vehicle.on_time(self.now_us, stamp_us):
            self._report(node, report)
        self.agenda.at(vehicle.deadline_us, self._fly, node, vehicle)

    def _report(self, node: WorldNode, report: Report) -> None:
        if node.platform is not None:
            self._reach(node, Reported(node.clock.node_us(self.now_us), report))

    def _perform(self, node: WorldNode, effects: Iterable[Effect]) -> None:
        for effect in effects:
            if self._trace is not None:
                self._say(node.config.unit, f"> {effect!r}")
            match effect:
                case Command():
                    self._command(node, effect)
                case InjectFault():
                    self._injected(node, effect)
                case Note():
                    node.notes.append(effect.text)
                case Tell():
                    node.told.append(effect.record)
                case Halt():
                    node.halted.append(effect.reason)
                    self.agenda.at(self.now_us, self.kill, node.config.unit)
                case TellHost() | TakeHost() | DropHost():
                    pass  # there are no hosts in this world
                case _:
                    self.wire.perform(node.config.unit, effect)

    def _command(self, node: WorldNode, command: Command) -> None:
        if node.vehicle is not None:
            stamp_us = node.config.clock.federation_us(node.clock.node_us(self.now_us))
            result = node.vehicle.on_command(command, self.now_us, stamp_us)
            self.agenda.at(self.now_us, self._report, node, result)

    def _injected(self, node: WorldNode, effect: InjectFault) -> None:
        text = effect.kind if effect.value is None else f"{effect.kind}={effect.value}"
        duration_us = None
        if effect.until_us is not None:
            duration_us = effect.until_us - node.config.clock.federation_us(node.clock.node_us(self.now_us))
        try:
            self.inject(node.config.unit, text, duration_us)
        except TextError as wrong:
            node.notes.append(str(wrong))

    def _note_truth(self, period_us: int) -> None:
        for node in self.nodes.values():
            if node.vehicle is not None:
                node.truth.append(node.vehicle.truth(self.now_us))
        self.agenda.at(self.now_us + period_us, self._note_truth, period_us)

    def _say(self, unit: str, text: str) -> None:
        if self._trace is not None:
            self._trace(f"{self.agenda.now_us} {unit} {text}")
