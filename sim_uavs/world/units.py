"""The units of the simulated world, each with a clock of its own."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from dyknow.agents.effects import Effect, Keep, KeepEncounter
from dyknow.agents.platform import Platform
from dyknow.federation.members.clock import FederationClock
from dyknow.federation.members.member import Member
from dyknow.navigation.vehicle import Command, Report
from dyknow.runtime.mailbox import Mailbox
from dyknow.sim_uavs.dynamics.faults import SimulatedFault
from dyknow.sim_uavs.dynamics.vehicles import TrueState


class DriftingClock:
    """A node's clock: UTC at its start, `offset_us` off, and from then on `drift_ppm` too fast; never set back."""

    def __init__(self, now_us: int, offset_us: int = 0, drift_ppm: float = 0.0) -> None:
        self._since_us, self._offset_us, self._ppb = now_us, offset_us, round(drift_ppm * 1000)

    def mislead(self, now_us: int, step_us: int = 0, drift_ppm: float = 0.0) -> None:
        """From `now_us` on it is that much ahead of its earlier course, and so much too fast."""
        self._offset_us, self._since_us = self.node_us(now_us) + step_us - now_us, now_us
        self._ppb = round(drift_ppm * 1000)

    def node_us(self, now_us: int) -> int:
        """Its reading at an instant of the world."""
        if not self._ppb:
            return now_us + self._offset_us
        return now_us + self._offset_us + (now_us - self._since_us) * self._ppb // 1_000_000_000

    def world_us(self, node_us: int) -> int:
        """The first instant of the world at which it shows that."""
        if not self._ppb:
            return node_us - self._offset_us
        elapsed_us = node_us - self._offset_us - self._since_us
        found = self._since_us + elapsed_us * 1_000_000_000 // (1_000_000_000 + self._ppb) - 2
        while self.node_us(found) < node_us:
            found += 1
        return found


class WorldVehicle(Protocol):
    """A vehicle as the world flies it: orders in, reports out, stamped by their receiver."""

    @property
    def deadline_us(self) -> int: ...
    def truth(self, now_us: int) -> TrueState: ...
    def inject(self, fault: SimulatedFault, now_us: int, until_us: int | None = None) -> None: ...
    def on_time(self, now_us: int, stamp_us: int) -> Sequence[Report]: ...
    def on_command(self, command: Command, now_us: int, stamp_us: int) -> Sequence[tuple[int, Report]]: ...


class WorldProcess(Protocol):
    """A platform or a command centre."""

    @property
    def member(self) -> Member: ...
    @property
    def deadline_us(self) -> int: ...
    def start(self, now_us: int) -> Sequence[Effect]: ...
    def on_event(self, event: Any, now_us: int) -> Sequence[Effect]: ...
    def on_time(self, now_us: int) -> Sequence[Effect]: ...


@dataclass(slots=True)
class WorldNode:
    """One unit: its process, while it runs, and its vehicle, which flies whatever becomes of the process.

    Attributes:
        make: makes its process, given the identity of its session and the time (node clock).
        lives: all processes that have run under this name, the present one last.
        halted: why a process of it ended by itself.
        notes: its processes' reports to the user.
        results: the records of its specification: samples, alarms, monitors.
        kept: its learnt knowledge; encounters: records of them.
    """

    unit: str
    make: Callable[[str, int], WorldProcess]
    vehicle: WorldVehicle | None
    clock: DriftingClock
    federation_clock: FederationClock
    process: WorldProcess | None = None
    frozen: bool = False
    offset_us: int = 0
    drift_ppm: float = 0.0
    lives: list[WorldProcess] = field(default_factory=list)
    halted: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    results: list[Mapping[str, Any]] = field(default_factory=list)
    kept: list[Keep] = field(default_factory=list)
    encounters: list[KeepEncounter] = field(default_factory=list)
    truth: list[TrueState] = field(default_factory=list)
    due_us: int | None = None
    asked_us: int | None = None
    mailbox: Mailbox | None = None

    def keep(self, effect: Keep | KeepEncounter) -> None:
        """Keep a text that its process would write to a file."""
        if isinstance(effect, Keep):
            self.kept.append(effect)
        else:
            self.encounters.append(effect)

    @property
    def platform(self) -> Platform | None:
        """Its process, if that is a platform."""
        return self.process if isinstance(self.process, Platform) else None
