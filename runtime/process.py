"""One platform, one process: edges post into the mailbox, one thread steps the platform and performs its effects.

The process writes records (`dyknow.runtime.records`): `joined`, `directory` (the peers it has found), `note`, `ended`.
"""

import contextlib
import os
import sys
import threading
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from queue import Empty
from typing import TYPE_CHECKING, Any

from dyknow.agents.capabilities.flight.flight import FlightAgent
from dyknow.agents.capabilities.separation.options import EncounterOptions
from dyknow.agents.directory.directory import DirectoryAgent
from dyknow.agents.effects import (
    Compute,
    Event,
    Halt,
    HostEffect,
    Impaired,
    InjectFault,
    Keep,
    KeepEncounter,
    LeaveRequested,
    Note,
    Pressed,
    Reported,
    SearchEffect,
    Tell,
    Waited,
)  # fmt: skip
from dyknow.agents.monitoring.monitor_plans import PlanBook
from dyknow.agents.platform import Platform
from dyknow.agents.specification.options import RunOptions, SpecificationOptions
from dyknow.federation.members.clock import FederationClock
from dyknow.federation.messages import contents
from dyknow.federation.messages.codec import decode_description
from dyknow.federation.transport import Answered, Ask
from dyknow.model.errors import DecodeError, DyknowError, EndpointFailed, RosterError
from dyknow.navigation.vehicle import Command, Report
from dyknow.proxies.hosts.listener import HostDoor
from dyknow.proxies.zenoh.edge import ZenohEdge
from dyknow.reasoning import builtin_profiles
from dyknow.runtime.accepted_acts import AcceptedActs
from dyknow.runtime.clock import NodeClock, Stopwatch
from dyknow.runtime.configuration.config import NodeConfig
from dyknow.runtime.configuration.resolved import platform_config
from dyknow.runtime.configuration.road_files import check_place
from dyknow.runtime.configuration.session import reaches_beyond, unprotected, wire_options
from dyknow.runtime.learnt_files import keep
from dyknow.runtime.loop import Pressure, SteppedNode, leave_alone_what_is_loaded, step
from dyknow.runtime.mailbox import Mailbox
from dyknow.runtime.records import NoteLimit
from dyknow.runtime.searches.workers import SearchWorkers
from dyknow.runtime.specified import Specified
from dyknow.runtime.vehicles import Vehicle, VehiclePorts
from dyknow.runtime.workers import WorkerThreads

if TYPE_CHECKING:
    from dyknow.runtime.journal.journal import Journal
    from dyknow.runtime.metrics import PlatformMetrics

WRONG, FAILED = 2, 3
"""Exit codes of the process: its configuration does not work, or it failed later."""
WEIGH_US = 100_000
ASK_US = 300_000
ADOPT_US = 2_000_000
"""How often a process that joins a faster federation asks for its epoch, and how long it waits for the answer."""


class PlatformProcess:
    """A platform running for real.

    Args:
        config: of this platform.
        make_vehicle: builds what it flies.
        say: takes one JSON object for standard output.
    """

    def __init__(
        self,
        config: NodeConfig,
        make_vehicle: Callable[[VehiclePorts], Vehicle],
        say: Callable[[dict[str, Any]], None],
    ) -> None:
        self.config, self._say, self._notes = config, say, NoteLimit()
        self.clock = NodeClock(config.clock.skew_us)
        self.mailbox = Mailbox(self.clock.now_us)
        self._going, self._is_open, self._is_journal_lost, self._code = True, False, False, 0
        self._platform: Platform
        self._node: SteppedNode[Event, Any]
        self._journal: Journal | None = None
        self._accepted: AcceptedActs | None = None
        self._metrics: PlatformMetrics | None = None
        self._edge = ZenohEdge(wire_options(config.wire), self.mailbox.post, self.clock.now_us)
        self._make_vehicle = make_vehicle
        epoch_us = config.clock.epoch_us
        self._federation_clock = FederationClock(
            self.clock.now_us() if epoch_us is None else epoch_us, config.clock.speed
        )
        self._vehicle = Vehicle()
        self._specified: Specified | None = None
        self._door = None if config.hosts is None else HostDoor(config.hosts, self.mailbox.post, self.clock.now_us)
        self._stopwatch = Stopwatch(self.federation_us, keeps=config.journal is not None)
        self._workers = WorkerThreads(self.mailbox.post, self.clock.now_us, self._note)
        self._searches = SearchWorkers(self.mailbox.post, self.clock.now_us)
        self._told: tuple[str, ...] = ()
        self._impaired: set[str] = set()
        self._weighed_us = 0
        self._pressure = Pressure()

    def run(self) -> int:
        """Join, step until stopped, leave; the exit code.

        Raises:
            RosterError: the federation lacks a roster or TLS and would reach beyond loopback, which was not allowed.
        """
        try:
            self.open()
            leave_alone_what_is_loaded()
            while self.is_running:
                self.step()
            self.leave()
        finally:
            self.close()
        return self._code

    def open(self) -> None:
        """Join: the session, the vehicle, the specification.

        Raises:
            RosterError: the federation lacks a roster or TLS and would reach beyond loopback, which is not allowed.
            SessionFailed: the session does not open.
        """
        self._insist_on_trust()
        contents.prepare()
        PlanBook(self.config.unit, builtin_profiles()).prepare()
        self._edge.open()
        self._is_open = True
        chosen = self.config.clock
        if chosen.speed != 1.0 and (chosen.epoch_us is None or chosen.yields):
            self._adopt_epoch()
        self._specified = self._specification()
        self._vehicle = self._make_vehicle(
            VehiclePorts(
                self.config,
                self._federation_clock,
                self.clock,
                self._reported,
                self.stop,
                None,
                self.mailbox.post,
                self._note,
            )
        )
        self._join()

    def _join(self) -> None:
        started_us = self.clock.now_us()
        config = replace(
            platform_config(self.config, self._federation_clock, started_us, self._edge.zid),
            stopwatch=self._stopwatch.now_us,
            monotonic_offset_us=self.clock.monotonic_offset_us,
            **self._vehicle.settings,
        )
        check_place(self.config[RunOptions].roads, config.roads, config.cameras)
        platform = self._platform = Platform(config, started_us)
        if self.config.metrics is not None:
            from dyknow.runtime.metrics import metrics_of

            self._metrics = metrics_of(self.config, platform, self.clock.now_us, self.mailbox, lambda: self._journal)
        self._perform_all(platform.start(self.clock.now_us()))
        self._let_hosts_in()
        labels = [entry.label for part in _flights(platform) for entry in part.labels()]
        self._tell("joined", labels=labels)
        self._vehicle.start()
        if self._specified is not None:
            self._specified.start()
        self._node = platform if self.config.journal is None else self._journalled(platform, self.config.journal)
        trust, key = platform.config.trust, self.config.trust.key
        if trust is not None and key is not None:
            self._accepted = AcceptedActs(key, trust.verifier, self.impair)
        if self.config.duration_s is not None:
            end = threading.Timer(self.config.duration_s, self.stop)
            end.daemon = True
            end.start()

    @property
    def is_open(self) -> bool:
        """Whether it is between `open` and `close`."""
        return self._is_open

    @property
    def is_running(self) -> bool:
        """Whether it was not stopped."""
        return self._going

    def step(self, timeout_s: float | None = None) -> None:
        """Wait for the next event or deadline, at most `timeout_s`, and act on it."""
        now_us = self.clock.now_us()
        self.mailbox.pause_s = self._pressure.pause_s(now_us) / max(1.0, self.config.clock.speed)
        if self._pressure.is_news:
            self.mailbox.post(Pressed(now_us, self._pressure.reported()))
        step(self._node, self.mailbox, self.clock.now_us, self._perform, timeout_s)
        call = self._platform.containment.call
        if self._accepted is not None:
            call(self._accepted.step, otherwise=None)
        if self._journal is not None and self._journal.failed is not None and not self._is_journal_lost:
            self._is_journal_lost = True
            self.impair(f"the journal has ended: {self._journal.failed}")
        call(self._tell_directory, self._platform, otherwise=None)
        self._tell_waiting()

    def leave(self) -> None:
        """Leave the federation."""
        self._perform_all(self._platform.on_event(LeaveRequested(self.clock.now_us()), self.clock.now_us()))
        self._tell("ended")

    def close(self) -> None:
        """Close all that `open` opened, however far it came."""
        if not self._is_open:
            return
        self._is_open = False
        if self._specified is not None:
            self._specified.stop()
        self._vehicle.stop()
        if self._door is not None:
            self._door.close()
        self._edge.close()
        self._workers.close()
        self._searches.close()
        for each in (self._journal, self._accepted, self._metrics):
            if each is not None:
                each.close()

    def _let_hosts_in(self) -> None:
        """Open the door for hosts; a platform runs without them, too."""
        try:
            if self._door is not None:
                self._door.open()
        except EndpointFailed as wrong:
            self._warn(str(wrong))

    def _specification(self) -> Specified | None:
        """The platform's specification; its times are those of the clock as it is now."""
        file, feed, clock = self.config[SpecificationOptions].spec, self.config[RunOptions].feed, self._federation_clock
        if file is None:
            return None
        return Specified(file, feed, self.mailbox.post, self._note, self.clock.now_us, clock.federation_us)

    def _journalled(self, platform: Platform, path: Path) -> SteppedNode[Event, Any]:
        from dyknow.runtime.journal.journal import Journal
        from dyknow.runtime.journal.recorded_runs import about, journalled

        try:
            self._journal = Journal(path, about(self.config, self._federation_clock))
        except OSError as wrong:
            self.impair(f"there is no journal: {wrong}")
            return platform
        return journalled(platform, self._journal, self._stopwatch)

    def _insist_on_trust(self) -> None:
        """Refuse to take part where strangers could, unless that is allowed; note what is not protected."""
        wire = self.config.wire
        lacking = unprotected(wire, has_roster=self.config.trust.roster is not None)
        if lacking is None:
            return
        beyond = reaches_beyond(wire)
        if beyond and not (wire.open or os.environ.get("DYKNOW_OPEN") == "1"):
            raise RosterError(f"{beyond} lies beyond loopback. {lacking.danger} {lacking.remedy}")
        self._note(f"{lacking.note}{f', and {beyond} reaches beyond this machine' if beyond else ''}")

    def _adopt_epoch(self) -> None:
        """Take over the epoch of a federation that is there and runs at our speed, so that all clocks agree.

        A session that has just been opened may not have met any peer yet: the question is repeated until it is answered.
        """
        until_us = self.clock.now_us() + ADOPT_US
        again_us = 0
        while (now_us := self.clock.now_us()) < until_us:
            if now_us >= again_us:
                self._edge.perform(Ask(0, "*/df", b"", ASK_US))
                again_us = now_us + ASK_US
            with contextlib.suppress(Empty, DecodeError):
                event = self.mailbox.get((min(again_us, until_us) - now_us) / 1e6)
                found = decode_description(event.payload) if isinstance(event, Answered) else None
                if found is not None and found.kind == "uav" and found.clock_speed == self.config.clock.speed:
                    self._federation_clock = FederationClock(found.clock_epoch_us, found.clock_speed)
                    return

    def federation_us(self) -> int:
        """Federation time."""
        return self._federation_clock.federation_us(self.clock.now_us())

    def stop(self) -> None:
        """End the process; from any thread, or a signal."""
        self._going = False
        self.mailbox.post(LeaveRequested(self.clock.now_us()))

    def _reported(self, report: Report) -> None:
        self.mailbox.post(Reported(self.clock.now_us(), report))

    def _perform_all(self, effects: Iterable[Any]) -> None:
        for effect in effects:
            self._perform(effect)

    def _perform(self, effect: Any) -> None:
        """Carry out one effect; an effect that raises is lost, and the platform is impaired."""
        try:
            self._carry_out(effect)
        except Exception as error:  # noqa: BLE001  (contained)
            self._platform.containment.caught(f"effect {type(effect).__name__}", error)

    def _carry_out(self, effect: Any) -> None:
        kind = type(effect)
        if kind is Command or kind is InjectFault:
            self._fly(effect)
        elif kind is Note:
            self._note(effect.text)
        elif kind is Compute:
            self._workers.perform(effect)
        elif isinstance(effect, SearchEffect):
            self._searches.perform(effect)
        elif isinstance(effect, HostEffect):
            if self._door is not None:
                self._door.perform(effect)
        elif kind is Keep:
            keep(self.config[SpecificationOptions].learnt, self.config.unit, effect, self._note)
        elif kind is KeepEncounter:
            from dyknow.runtime.recordings.encounter_files import keep_encounter

            keep_encounter(self.config[EncounterOptions].encounters, self.config.unit, effect, self._note)
        elif kind is Tell:
            self._say({**effect.record, "unit": self.config.unit})
        elif kind is Halt:
            self._tell("halted", reason=effect.reason)
            with contextlib.suppress(OSError):
                sys.stderr.write(f"{effect.reason}\n")
            self._code = 3
            self._going = False
        else:
            self._edge.perform(effect)

    def _fly(self, effect: Command | InjectFault) -> None:
        """Command the vehicle, or make it fail; a refusal is noted."""
        try:
            self._vehicle.command(effect) if isinstance(effect, Command) else self._vehicle.inject(effect)
        except DyknowError as wrong:
            self._warn(str(wrong))

    def _tell(self, event: str, **more: Any) -> None:
        self._say({"event": event, "unit": self.config.unit, **more, "at_us": self.clock.now_us()})

    def _note(self, text: str) -> None:
        for line in self._notes.lines(text, self.clock.now_us()):
            self._tell("note", text=line, level="error" if text in self._impaired else "info")

    def _warn(self, text: str) -> None:
        for line in self._notes.lines(text, self.clock.now_us()):
            self._tell("note", text=line, level="warning")

    def impair(self, text: str) -> None:
        """Something of this process failed, not the platform: it is noted and listed by `dyknow ls`; from any thread."""
        self._impaired.add(text)
        self.mailbox.post(Impaired(self.clock.now_us(), text))

    def _tell_waiting(self) -> None:
        """Report to the governor how busy this process is."""
        now_us = self.clock.now_us()
        if self.config[RunOptions].govern_us is not None and now_us >= self._weighed_us + WEIGH_US:
            self._weighed_us = now_us
            self.mailbox.post(Waited(now_us, self.mailbox.waited_us))

    def _tell_directory(self, platform: Platform) -> None:
        """Say whom this platform has found, whenever that changed."""
        found = platform.part(DirectoryAgent).members
        if found != self._told:
            self._told = found
            self._tell("directory", units=list(found))


def _flights(platform: Platform) -> list[FlightAgent]:
    """The part that flies, if there is a vehicle."""
    return [part for part in platform.parts if isinstance(part, FlightAgent)]
