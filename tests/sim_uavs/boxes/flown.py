"""A UAV with a winch over boxes and carriers, commanded over MAVLink and stepped by its own clock."""

from collections.abc import Sequence

from dyknow.navigation.geodesy import LocalFrame
from dyknow.navigation.vehicle import Command, CommandResult, GoToOrder, Order, Report, WinchReport
from dyknow.sim_uavs.boxes.handled import BoxWorld, Placed
from dyknow.sim_uavs.boxes.shared import HandlingList, HandlingLog, SharedBoxes
from dyknow.sim_uavs.boxes.winch import MagnetHoist
from dyknow.sim_uavs.dynamics.faults import parse_fault
from dyknow.sim_uavs.dynamics.scenarios import ORIGIN
from dyknow.sim_uavs.dynamics.settings import PersonaName, VehicleConfig
from dyknow.sim_uavs.dynamics.slung import Thing
from tests.sim_uavs.wired import WiredVehicle

START_US = 1_700_000_000_000_000
BOX, CARRIER = Thing("b1", "box", "red", 0.0, 0.0), Thing("c1", "carrier", "grey", 0.0, 10.0)


class FlownBoxes:
    """One UAV that hovers 7 m above the origin."""

    def __init__(
        self,
        things: Sequence[Thing] = (BOX, CARRIER),
        *,
        seed: int = 1,
        log: HandlingLog | None = None,
        name: str = "0",
        persona: PersonaName = "ardupilot",
        equipped: bool = True,
    ) -> None:
        self.now_us, self._number, self.reports = START_US, 0, list[Report]()
        config = VehicleConfig(3, ORIGIN, persona, airborne_m=7.0, seed=seed)
        self.vehicle = WiredVehicle(config, START_US)
        self.boxes = SharedBoxes(BoxWorld(things, seed), log or HandlingList())
        if equipped:
            self.vehicle.autopilot.carry(MagnetHoist(name, self.boxes, seed=seed))
        self.run(2.0)

    def run(self, seconds: float) -> None:
        until_us = self.now_us + round(seconds * 1e6)
        while self.now_us < until_us:
            self.now_us += 50_000
            self.reports += self.vehicle.on_time(self.now_us, self.now_us)

    def order(self, order: Order, seconds: float) -> CommandResult:
        """The answer to an order, and the time that it takes to carry it out."""
        self._number += 1
        told = self.vehicle.on_command(Command(self._number, order), self.now_us, self.now_us)
        self.reports += [report for _, report in told]
        self.run(seconds)
        return next(each for each in self.reports if isinstance(each, CommandResult) and each.number == self._number)

    def fly(self, east_m: float, north_m: float, height_m: float, seconds: float = 8.0) -> None:
        assert self.order(GoToOrder(*LocalFrame(*ORIGIN).from_ned(north_m, east_m, -height_m)), seconds).accepted

    def fail(self, text: str, seconds: float | None = None) -> None:
        until_us = None if seconds is None else self.now_us + round(seconds * 1e6)
        self.vehicle.autopilot.inject(parse_fault(text), self.now_us, until_us)

    @property
    def winch(self) -> WinchReport:
        return next(each for each in reversed(self.reports) if isinstance(each, WinchReport))

    def placed(self, name: str) -> Placed:
        return next(each for each in self.boxes.at(self.now_us) if each.thing.name == name)
