"""The simulated world: many platforms in one process, on a fake clock and a fake wire, all by chance from one seed.

The platforms and the command centre are those of real federations; only clock, wire and vehicles are simulated. Every
node has a clock of its own, which may be wrong and drift. Nothing here reads the time: a minute takes what its events
take, and the same seed gives the same events. Times are the world's, in microseconds since the epoch, or a node's.
"""

import gc
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import replace
from queue import Empty
from random import Random
from typing import Any, TypeVar

from dyknow.agents.config import PlatformConfig
from dyknow.agents.directory.directory import DirectoryAgent
from dyknow.agents.effects import (
    Compute,
    DropHost,
    Effect,
    EndSearch,
    Event,
    Halt,
    InjectFault,
    Keep,
    KeepEncounter,
    LeaveRequested,
    Note,
    Reported,
    RunSearch,
    Specify,
    TakeHost,
    Tell,
    TellHost,
)
from dyknow.agents.platform import Platform
from dyknow.federation.members.clock import FederationClock
from dyknow.federation.members.command_centre import CommandCentre
from dyknow.federation.members.member import Member
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import Content
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.federation.security.trust import Trust
from dyknow.federation.transport import Conflated, WireEvent
from dyknow.model.errors import Refused, TextError
from dyknow.navigation.vehicle import Command, Report
from dyknow.runtime.mailbox import Mailbox
from dyknow.sim_uavs.dynamics.faults import SimulatedFault, parse_fault
from dyknow.sim_uavs.world.agenda import Agenda
from dyknow.sim_uavs.world.searches import SEARCH_US, searched
from dyknow.sim_uavs.world.sessions import SessionLink
from dyknow.sim_uavs.world.units import DriftingClock, WorldNode, WorldVehicle
from dyknow.sim_uavs.world.wire import LEASE_US, Wire

START_US, TRUTH_US = 1_700_000_000_000_000, 100_000
T = TypeVar("T")


class World:
    """Units, their clocks and vehicles, and the wire between them.

    Args:
        seed: of all random choices.
        link, lease_us, reach: of the wire.
        trace: gets one line per event and effect, with its time.
        truth_us: how often true positions are noted; None: never.
    """

    raises = False  # whether a run raises at once what a part does; False: platforms contain it, as real ones do

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
        self.agenda, self.random = Agenda(start_us), Random(seed)
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
        """The platform `unit`. Raises LookupError when it does not run."""
        platform = self.nodes[unit].platform
        if platform is None:
            raise LookupError(f"no platform {unit} runs")
        return platform

    def run_until(self, at_us: int) -> None:
        """Let the world run. Meanwhile garbage is collected seldom: nearly all that a world makes stays."""
        thresholds = gc.get_threshold()
        gc.set_threshold(max(thresholds[0], 50_000), max(thresholds[1], 100), thresholds[2])
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
        vehicle: WorldVehicle | None = None,
        *,
        offset_us: int = 0,
        drift_ppm: float = 0.0,
    ) -> WorldNode:
        """A unit joins: its process starts, with a clock that is off by `offset_us`."""
        config = config or PlatformConfig(unit, 0)
        config = replace(config, unit=unit, vehicle=vehicle is not None, contained=config.contained and not self.raises)

        def make(zid: str, node_us: int) -> Platform:
            return Platform(replace(config, boot=node_us // 1000, zid=zid), node_us)

        clock = DriftingClock(self.now_us, offset_us, drift_ppm)
        node = WorldNode(unit, make, vehicle, clock, config.clock, offset_us=offset_us, drift_ppm=drift_ppm)
        if vehicle is not None:
            self.agenda.at(vehicle.deadline_us, self._fly, node, vehicle)
        return self._join(node)

    def add_command_centre(self, unit: str = "cc", *, trust: Trust | None = None) -> WorldNode:
        """A command centre, which delegates and asks, without a vehicle."""

        def make(zid: str, node_us: int) -> CommandCentre:
            return CommandCentre(unit, node_us, zid=zid, trust=trust)

        return self._join(WorldNode(unit, make, None, DriftingClock(self.now_us), FederationClock()))

    def _join(self, node: WorldNode) -> WorldNode:
        self.nodes[node.unit] = node
        self._boot(node)
        return node

    def kill(self, unit: str) -> None:
        """End its process without a word; the vehicle continues with its last order."""
        node = self.nodes[unit]
        if node.process is not None:
            self.wire.kill(unit)
            node.process, node.due_us, node.frozen, node.mailbox = None, None, False, None
            self._say(unit, "killed")

    def restart(self, unit: str) -> None:
        """Restart the process, under a new boot."""
        self.kill(unit)
        node = self.nodes[unit]
        node.clock = DriftingClock(self.now_us, node.offset_us, node.drift_ppm)
        self._boot(node)

    def freeze(self, unit: str) -> None:
        """Stop the process (SIGSTOP): messages to it wait in its sockets."""
        node = self.nodes[unit]
        if node.process is not None and not node.frozen:
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
            while mailbox is not None and node.process is not None:
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

    def speak(self, unit: str, do: Callable[[Member, int], T]) -> T:
        """Have a running process do something as a member (node clock), and carry out what follows from it.

        Raises LookupError when there is no process, or it stands still.
        """
        node = self.nodes[unit]
        process, node_us = node.process, node.clock.node_us(self.now_us)
        if process is None or node.frozen:
            raise LookupError(f"{unit} {'stands still' if node.frozen else 'does not run'}")
        result = do(process.member, node_us)
        self._perform(node, process.on_time(node_us))
        self._wake(node)
        return result

    def call(self, unit: str, do: Callable[[Platform, int], T]) -> T:
        """The same for what only a platform does."""
        platform = self.platform(unit)
        return self.speak(unit, lambda _member, now_us: do(platform, now_us))

    def specify(self, unit: str, text: str, file: str = "", named: tuple[tuple[str, str], ...] = ()) -> None:
        """Give its process a specification, in place of the one it has; `named`: the files that it names, path and text."""
        node = self.nodes[unit]
        self._reach(node, Specify(node.clock.node_us(self.now_us), text, file, named))

    def ask(
        self,
        by: str,
        to: str,
        content: Content,
        performative: Performative = Performative.REQUEST,
        within_us: int = 2_000_000,
    ) -> Dialogue:
        """`by` says something to the Interface Agent of `to`; the answers are collected as they come."""
        dialogue = Dialogue(to, about=content)

        def say(member: Member, now_us: int) -> None:
            try:
                dialogue.conversation = member.acts.ask(
                    to, content, now_us, performative=performative, on_reply=dialogue.on_reply,
                    on_silence=dialogue.on_silence, within_us=within_us, standing=content.lasting,
                )  # fmt: skip
            except Refused as refused:
                dialogue.on_silence(refused.reason, now_us)

        self.speak(by, say)
        centre = self.nodes[by].process
        if isinstance(centre, CommandCentre):
            centre.follow(dialogue)
        return dialogue

    def cancel(self, by: str, to: str, conversation: str) -> None:
        """`by` cancels its conversation."""
        centre = self.nodes[by].process
        if isinstance(centre, CommandCentre):
            centre.followed.pop(conversation, None)
        self.speak(by, lambda member, now_us: member.acts.cancel(to, conversation, now_us))

    # -- inside -------------------------------------------------------------------------------------------------

    def _boot(self, node: WorldNode) -> None:
        unit = node.unit
        node_us = node.clock.node_us(self.now_us)
        zid = f"{self.random.getrandbits(64) | 1:x}"
        process = node.make(zid, node_us)
        node.process, node.due_us = process, None
        node.lives.append(process)
        self._say(unit, "booted")

        agenda, clock = self.agenda, node.clock
        deadlines = process.deadlines if isinstance(process, Platform) else None

        def node_now_us() -> int:
            return clock.node_us(agenda.now_us)

        def post(event: WireEvent) -> None:
            if node.process is not process:
                return
            if node.mailbox is not None or self._trace is not None or deadlines is None:
                self._reach(node, event)
                return
            effects = process.on_event(event, event.at_us)  # it was stamped just now
            if effects:
                self._perform(node, effects)
            if deadlines.due_us != node.asked_us:
                self._wake(node)

        self.wire.open(unit, zid, post, node_now_us)
        self._perform(node, process.start(node_us))
        self._wake(node)

    def _reach(self, node: WorldNode, event: Event) -> None:
        """An event reached a process: taken at once, or found in the mailbox when the process continues."""
        if node.mailbox is not None:
            node.mailbox.post(event)
        else:
            self._step(node, event)
            self._wake(node)

    def _step(self, node: WorldNode, event: Event | Conflated) -> None:
        process = node.process
        if process is not None:
            if self._trace is not None:
                self._say(node.unit, f"< {event!r}")
            self._perform(node, process.on_event(event, node.clock.node_us(self.agenda.now_us)))

    def _wake(self, node: WorldNode) -> None:
        """See to it that the process is stepped when it is due."""
        process = node.process
        if process is None or node.frozen:
            return
        asked_us = process.deadline_us
        if node.due_us is not None and asked_us == node.asked_us:
            return
        node.asked_us = asked_us
        due_us = node.clock.world_us(asked_us)
        if node.due_us is None or due_us < node.due_us:
            node.due_us = due_us
            self.agenda.at(due_us, self._on_time, node, due_us)

    def _on_time(self, node: WorldNode, due_us: int) -> None:
        """The process is due; an appointment that an earlier one replaced is passed over."""
        process = node.process
        if process is None or node.frozen or node.due_us != due_us:
            return
        node.due_us = None
        node_us = node.clock.node_us(self.agenda.now_us)
        if process.deadline_us <= node_us:
            self._perform(node, process.on_time(node_us))
        self._wake(node)

    def _fly(self, node: WorldNode, vehicle: WorldVehicle) -> None:
        stamp_us = node.federation_clock.federation_us(node.clock.node_us(self.now_us))
        for report in vehicle.on_time(self.now_us, stamp_us):
            self._report(node, report)
        self.agenda.at(vehicle.deadline_us, self._fly, node, vehicle)

    def _report(self, node: WorldNode, report: Report) -> None:
        if node.process is not None:
            self._reach(node, Reported(node.clock.node_us(self.now_us), report))

    def _perform(self, node: WorldNode, effects: Iterable[Effect]) -> None:
        for effect in effects:
            if self._trace is not None:
                self._say(node.unit, f"> {effect!r}")
            match effect:
                case Command():
                    self._command(node, effect)
                case InjectFault():
                    self._injected(node, effect)
                case Note(_, text):
                    node.notes.append(text)
                case Tell(record):
                    node.results.append(record)
                case Halt():
                    node.halted.append(effect.reason)
                    self.agenda.at(self.now_us, self.kill, node.unit)
                case RunSearch():
                    over = searched(effect, node.clock.node_us(self.now_us))
                    self.agenda.at(self.now_us + SEARCH_US, self._reach, node, over)
                case Keep() | KeepEncounter():
                    node.keep(effect)
                case EndSearch() | TellHost() | TakeHost() | DropHost() | Compute():
                    pass  # this world has no hosts and no workers
                case _:
                    self.wire.perform(node.unit, effect)

    def _command(self, node: WorldNode, command: Command) -> None:
        if node.vehicle is not None:
            stamp_us = node.federation_clock.federation_us(node.clock.node_us(self.now_us))
            for after_us, report in node.vehicle.on_command(command, self.now_us, stamp_us):
                self.agenda.at(self.now_us + after_us, self._report, node, report)

    def _injected(self, node: WorldNode, effect: InjectFault) -> None:
        text = effect.kind if effect.value is None else f"{effect.kind}={effect.value}"
        duration_us = None
        if effect.until_us is not None:
            duration_us = effect.until_us - node.federation_clock.federation_us(node.clock.node_us(self.now_us))
        try:
            self.inject(node.unit, text, duration_us)
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
