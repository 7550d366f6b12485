"""A simulated autopilot and the pilot of a platform, joined by the bytes that they exchange: no socket, no clock of its own."""

from typing import Any

from dyknow import Sample
from dyknow.agents.capabilities.flight.pilot import Pilot
from dyknow.navigation.vehicle import Command, GoToOrder, PositionReport, Report, VelocityReport
from dyknow.sim_uavs.dynamics.faults import parse_fault
from dyknow.sim_uavs.dynamics.settings import HomePlace, PersonaName, VehicleConfig
from tests.sim_uavs.wired import WiredVehicle

START_US = 1_700_000_000_000_000
HOME = HomePlace(58.0, 15.0, 50.0)
STEP_US = 20_000
NORTH_DEG = 1 / 111_194.9


class Piloted:
    """A vehicle that hovers at `height_m`, and the pilot that commands it.

    Attributes:
        notes: what the pilot has told.
    """

    def __init__(
        self,
        persona: PersonaName = "ardupilot",
        *,
        height_m: float = 50.0,
        seed: int = 0,
        asks: bool = True,
        fence_m: float | None = None,
    ) -> None:
        self.now_us = START_US
        self.vehicle = WiredVehicle(
            VehicleConfig(1, HOME, persona, airborne_m=height_m, seed=seed), START_US, asks=asks
        )
        self.flight = self.vehicle.flight
        self.settings = self.flight.settings
        if fence_m is not None:
            self.settings.fence_highest_m, self.settings.fence_on = fence_m, 1.0
        self.notes: list[str] = []
        self.pilot = Pilot(control=True, note=self.notes.append, clock=lambda: self.now_us)
        self._velocity: VelocityReport | None = None
        self.run(3.0)

    def run(self, seconds: float) -> None:
        """Let both live for so long."""
        end_us = self.now_us + round(seconds * 1e6)
        while self.now_us < end_us:
            self.now_us += STEP_US
            for report in self.vehicle.on_time(self.now_us, self.now_us):
                self._report(report)
            self.pilot.on_time(self.now_us)

    def until(self, holds: Any, within_s: float = 60.0) -> float:
        """Run until that holds; after how many seconds."""
        since_us = self.now_us
        while not holds():
            assert self.now_us - since_us < within_s * 1e6, "it does not happen"
            self.run(STEP_US / 1e6)
        return (self.now_us - since_us) / 1e6

    def command(self, commands: list[Command]) -> None:
        for command in commands:
            for _, report in self.vehicle.on_command(command, self.now_us, self.now_us):
                self._report(report)

    def inject(self, text: str, seconds: float | None = None) -> None:
        until_us = None if seconds is None else self.now_us + round(seconds * 1e6)
        self.vehicle.inject(parse_fault(text), self.now_us, until_us)

    def _report(self, report: Report) -> None:
        self.command(self.pilot.on_report(report, self.now_us))
        if isinstance(report, VelocityReport):
            self._velocity = report
        elif isinstance(report, PositionReport) and self._velocity is not None and report.altitude_m is not None:
            place = report.latitude_deg, report.longitude_deg, report.altitude_m
            moves = self._velocity.north_m_s, self._velocity.east_m_s, self._velocity.down_m_s
            self.command(self.pilot.on_estimate(Sample(self.now_us, self.now_us, (*place, *moves))))

    # -- what a test looks at ----------------------------------------------------------------------------------

    @property
    def sent(self) -> list[Any]:
        """The messages of the pilot's orders, in order; requests are not among them."""
        return [order.message for order in self.vehicle.sent]

    @property
    def height_m(self) -> float:
        return self.flight.body.height_m

    def goto(self, north_m: float, height_m: float = 50.0) -> None:
        """Order it to a point north of home."""
        order = GoToOrder(HOME.latitude_deg + north_m * NORTH_DEG, HOME.longitude_deg, HOME.altitude_m + height_m)
        self.command(self.pilot.order(order))

    def divert(self, height_m: float | None) -> None:
        self.command(self.pilot.divert(None if height_m is None else HOME.altitude_m + height_m))
