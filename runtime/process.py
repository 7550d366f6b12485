"""One platform, one process: edges post into the mailbox, one thread steps the platform and performs its effects.

What the process says goes to standard output as JSON lines: `joined`, `directory` (whom it has found), `note`, `ended`.
"""

import contextlib
import json
import os
import signal
import stat
import sys
import threading
from collections.abc import Callable, Iterable
from dataclasses import replace
from queue import Empty
from typing import Any, Protocol

from agents.effects import Event, Halt, HostEffect, InjectFault, Leave, Note, Reported, Tell, Waited
from agents.own_streams import ESTIMATE
from agents.plans import PlanBook
from agents.platform import Platform
from dyknow import Policy
from dyknow.errors import DecodeError, DyknowError, EndpointFailed, RosterError, UnitError
from federation import contents
from federation.clock import FederationClock
from federation.codec import decode_description
from federation.transport import Answered, Ask, Put
from navigation.vehicle import Command, Report
from proxies.host_door import HostDoor
from proxies.journal_file import CLOCK_EPOCH, CLOCK_SPEED
from proxies.zenoh_edge import ZenohEdge
from reasoning import builtin_profiles
from runtime.clock import NodeClock
from runtime.config import NodeConfig
from runtime.configured import platform_config, reaches_beyond, wire_options
from runtime.journal import Journal, Journalled
from runtime.loop import Node, leave_alone_what_is_loaded, step
from runtime.mailbox import Mailbox
from runtime.specified import Specified

WRONG, FAILED = 2, 3
"""How the process ends: what it was given does not work, or what it met."""
WEIGH_US = 100_000
ASK_US = 300_000
ADOPT_US = 2_000_000
"""How often a process that joins a faster federation asks for its epoch, and how long it waits to be told."""


class VehicleEdge(Protocol):
    """What a platform flies: started with the process, stopped with it."""

    def start(self) -> None: ...
    def stop(self) -> None: ...
    def command(self, command: Command) -> None: ...
    def inject(self, fault: InjectFault) -> None: ...


MakeVehicle = Callable[[NodeConfig, FederationClock, NodeClock, Callable[[Report], None], Callable[[], None]], "Fitted"]
"""(configuration, federation clock, node clock, post a report, the vehicle ended) -> the vehicle and what it is."""


class Fitted:
    """A vehicle and what the platform is to know of it beforehand."""

    def __init__(self, edge: VehicleEdge | None, changes: dict[str, Any]) -> None:
        self.edge, self.changes = edge, changes


class Process:
    """A platform running for real.

    Args:
        config: of this platform.
        make_vehicle: builds what it flies.
        say: takes one JSON object for standard output.
    """

    def __init__(self, config: NodeConfig, make_vehicle: MakeVehicle, say: Callable[[dict[str, Any]], None]) -> None:
        self.config, self._say = config, say
        self.clock = NodeClock(config.clock.skew_us)
        self.mailbox = Mailbox(self.clock.now_us)
        self._going = True
        self._code = 0
        self._journal: Journal | None = None
        self._edge = ZenohEdge(wire_options(config), self.mailbox.post, self.clock.now_us)
        self._make_vehicle = make_vehicle
        epoch_us = config.clock.epoch_us
        self._federation_clock = FederationClock(
            self.clock.now_us() if epoch_us is None else epoch_us, config.clock.speed
        )
        self._vehicle: VehicleEdge | None = None
        self._specified: Specified | None = None
        self._door = None if config.hosts is None else HostDoor(config.hosts, self.mailbox.post, self.clock.now_us)
        self._told: tuple[str, ...] = ()
        self._weighed_us = 0

    def run(self) -> int:
        """Join, step until stopped, leave; the exit code.

        Raises:
            RosterError: the federation has no roster and would reach beyond loopback, which nobody allowed.
        """
        self._insist_on_trust()
        contents.prepare()
        PlanBook(self.config.unit, builtin_profiles()).prepare()
        self._edge.open()
        try:
            chosen = self.config.clock
            if chosen.speed != 1.0 and (chosen.epoch_us is None or chosen.yields):
                self._adopt_epoch()
            self._specified = self._specification()
            fitted = self._make_vehicle(self.config, self._federation_clock, self.clock, self._reported, self.stop)
            self._vehicle = fitted.edge
            self._serve(fitted)
        finally:
            if self._specified is not None:
                self._specified.stop()
            if self._vehicle is not None:
                self._vehicle.stop()
            if self._door is not None:
                self._door.close()
            self._edge.close()
            if self._journal is not None:
                self._journal.close()
        return self._code

    def _serve(self, fitted: "Fitted") -> None:
        started_us = self.clock.now_us()
        platform = Platform(
            replace(
                platform_config(self.config, self._federation_clock, started_us, self._edge.zid),
                monotonic_offset_us=self.clock.monotonic_offset_us,
                **fitted.changes,
            ),
            started_us,
        )
        self._perform_all(platform.start(self.clock.now_us()))
        self._let_hosts_in()
        labels = [] if platform.own is None else [entry.label for entry in platform.own.entries()]
        self._say({"event": "joined", "unit": self.config.unit, "labels": labels, "at_us": self.clock.now_us()})
        if self._vehicle is not None:
            self._vehicle.start()
        if self._specified is not None:
            self._specified.start()
        ends_us = None if self.config.duration_s is None else started_us + round(self.config.duration_s * 1e6)
        node = self._journalled(platform)
        if ends_us is not None:
            node = _Until(node, ends_us)
        leave_alone_what_is_loaded()
        while self._going:
            step(node, self.mailbox, self.clock.now_us, self._perform)
            self._tell_directory(platform)
            self._tell_waiting()
            if ends_us is not None and self.clock.now_us() >= ends_us:
                break
        self._perform_all(platform.on_event(Leave(self.clock.now_us()), self.clock.now_us()))
        self._say({"event": "ended", "unit": self.config.unit, "at_us": self.clock.now_us()})

    def _let_hosts_in(self) -> None:
        """A platform goes on without hosts, too."""
        try:
            if self._door is not None:
                self._door.open()
        except EndpointFailed as wrong:
            self._note(str(wrong))

    def _specification(self) -> Specified | None:
        """What the platform is to run; its times are those of the clock as it is now."""
        config, clock = self.config, self._federation_clock
        if config.spec is None:
            return None
        return Specified(
            config.spec, config.feed, self.mailbox.post, self._note, self.clock.now_us, clock.federation_us
        )

    def _journalled(self, platform: Platform) -> Node[Event, Any]:
        """The platform, or the platform with its journal: events, timers, and what was estimated."""
        if self.config.journal is None:
            return platform
        clock = self._federation_clock
        journal = self._journal = Journal(
            self.config.journal,
            {
                "config": self.config.model_dump_json(),
                CLOCK_EPOCH: str(clock.epoch_us),
                CLOCK_SPEED: str(clock.speed),
            },
        )
        if platform.own is not None:
            label, fields = str(platform.own.estimate), [field.name for field in ESTIMATE.fields]
            platform.network.subscribe(platform.own.estimate, Policy(), lambda s: journal.on_sample(label, fields, s))
        return Journalled(platform, journal)

    def _insist_on_trust(self) -> None:
        if self.config.trust.roster is not None:
            return
        beyond = reaches_beyond(self.config.wire)
        if beyond and not (self.config.wire.open or os.environ.get("DYKNOW_OPEN") == "1"):
            raise RosterError(
                f"{beyond} lies beyond loopback, and this federation has no roster: anybody there could command it. "
                "Make one with `dyknow roster init`, or set DYKNOW_OPEN=1 to allow it all the same"
            )
        self._note(
            f"open federation: acts are not signed{f', and {beyond} reaches beyond this machine' if beyond else ''}"
        )

    def _adopt_epoch(self) -> None:
        """Take over the epoch of a federation that is there and runs at our speed, so that all clocks agree.

        A session that has just been opened may not have met anybody yet: the question is asked until it is answered.
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

    def stop(self) -> None:
        """End the process; from any thread, or a signal."""
        self._going = False
        self.mailbox.post(Leave(self.clock.now_us()))

    def _reported(self, report: Report) -> None:
        self.mailbox.post(Reported(self.clock.now_us(), report))

    def _perform_all(self, effects: Iterable[Any]) -> None:
        for effect in effects:
            self._perform(effect)

    def _perform(self, effect: Any) -> None:
        kind = type(effect)
        if kind is Put:
            self._edge.perform(effect)
        elif kind is Command:
            self._order(effect)
        elif kind is InjectFault:
            self._inject(effect)
        elif kind is Note:
            self._note(effect.text)
        elif isinstance(effect, HostEffect):
            if self._door is not None:
                self._door.perform(effect)
        elif kind is Tell:
            self._say({**effect.record, "unit": self.config.unit})
        elif kind is Halt:
            self._say(
                {"event": "halted", "unit": self.config.unit, "reason": effect.reason, "at_us": self.clock.now_us()}
            )
            sys.stderr.write(f"{effect.reason}\n")
            self._code = 3
            self._going = False
        else:
            self._edge.perform(effect)

    def _inject(self, fault: InjectFault) -> None:
        try:
            if self._vehicle is not None:
                self._vehicle.inject(fault)
        except DyknowError as wrong:
            self._note(str(wrong))

    def _order(self, command: Command) -> None:
        try:
            if self._vehicle is not None:
                self._vehicle.command(command)
        except DyknowError as wrong:
            self._note(str(wrong))

    def _note(self, text: str) -> None:
        self._say({"event": "note", "unit": self.config.unit, "text": text, "at_us": self.clock.now_us()})

    def _tell_waiting(self) -> None:
        """The governor is told how busy this process is."""
        now_us = self.clock.now_us()
        if self.config.govern_ms is not None and now_us >= self._weighed_us + WEIGH_US:
            self._weighed_us = now_us
            self.mailbox.post(Waited(now_us, self.mailbox.waited_us))

    def _tell_directory(self, platform: Platform) -> None:
        """Say whom this platform has found, whenever that changed."""
        found = platform.membership.found
        if found != self._told:
            self._told = found
            self._say(
                {"event": "directory", "unit": self.config.unit, "units": list(found), "at_us": self.clock.now_us()}
            )


class _Until:
    """A node that is looked at again when its time is over, at the latest."""

    def __init__(self, node: Node[Event, Any], ends_us: int) -> None:
        self._node, self._ends_us = node, ends_us
        self.on_event, self.on_time = node.on_event, node.on_time

    @property
    def deadline_us(self) -> int:
        due_us = self._node.deadline_us
        return self._ends_us if due_us is None else min(due_us, self._ends_us)


def serve(config: NodeConfig, make_vehicle: MakeVehicle) -> int:
    """Run one platform until a signal, its duration, or the end of the process that started it."""

    def say(said: dict[str, Any]) -> None:
        with contextlib.suppress(BrokenPipeError):
            sys.stdout.write(json.dumps(said) + "\n")
            sys.stdout.flush()

    try:
        process = Process(config, make_vehicle, say)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda _number, _frame: process.stop())
        if stat.S_ISFIFO(os.fstat(0).st_mode):
            threading.Thread(target=_lifeline, args=(process.stop,), daemon=True).start()
        return process.run()
    except DyknowError as wrong:
        sys.stderr.write(f"platform {config.unit}: {wrong}\n")
        return WRONG if isinstance(wrong, UnitError) else FAILED


def _lifeline(stop: Callable[[], None]) -> None:
    """Standard input ends when the process that started us does."""
    while os.read(0, 4096):
        pass
    stop()
