"""The commands of one action, one after another, as orders to the pilot: each is done when the vehicle shows that it is.

| command | ordered | done when |
|---|---|---|
| take-off h | guided mode, arming, take-off; in the air: climb | it flies, and is at most 1 m below h |
| goto lat lon h, climb h | guided target; it climbs where it was sent, if it is there | 1.5 m from it level and 1 m in height, slower than 1 m/s |
| land, return-home | the mode | it stands disarmed |
| winch m | so much line out | it is, within 15 cm |
| magnet 1, magnet 0 | the gripper | it is acknowledged; the mass on the line shows whether it holds something |
| hold | guided target where it is | slower than 1 m/s |
| look-down | the camera's mount straight down, and it stays so for the other commands | at once: a camera without a mount looks down |
| wait s | nothing | the time is over |

Heights are metres above the vehicle's home. Nothing is sent while the pilot gives way or its vehicle is in other hands; a
target is ordered again after that. Times are federation time.
"""

from dataclasses import dataclass
from math import pi
from typing import Final, NamedTuple

from dyknow.agents.capabilities.flight.arbiter import Commander
from dyknow.agents.capabilities.flight.pilot import Pilot
from dyknow.agents.places import Fix
from dyknow.model.errors import Refused
from dyknow.navigation.geodesy import distance_m
from dyknow.navigation.vehicle import (
    Arm,
    Command,
    GoToOrder,
    GripOrder,
    HoldOrder,
    LandOrder,
    LineOrder,
    Order,
    PointMountOrder,
    ReturnHomeOrder,
    SetGuided,
    TakeOffOrder,
)

LEVEL_M: Final = 1.5
UPRIGHT_M: Final = 1.0
SLOW_M_S: Final = 1.0
AGAIN_US: Final = 3_000_000
"""After this long an order for taking off is repeated whose effect does not show."""
ATTEMPTS: Final = 4
LINE_M: Final = 0.15
DOWN: Final = PointMountOrder(0.0, pi / 2.0)
_WAITED_FOR: Final = frozenset({"hands", "giving-way"})


class VehicleCommand(NamedTuple):
    """One command with its numbers: degrees, metres above home, seconds."""

    name: str
    numbers: tuple[float, ...] = ()


@dataclass(slots=True)
class CommandRun:
    """Commands under way.

    Attributes:
        failure: why they failed; empty: they did not.
        is_done: whether all are done.
    """

    commands: tuple[VehicleCommand, ...]
    failure: str = ""
    is_done: bool = False
    _at: int = 0
    _since_us: int | None = None
    _order: Order | None = None
    _ordered_us: int = 0
    _attempts: int = 0

    @property
    def is_over(self) -> bool:
        return self.is_done or bool(self.failure)

    def step(self, pilot: Pilot, now_us: int) -> list[Command]:
        """What to send now; call a few times a second."""
        if pilot.mission.waits or pilot.diversion is not None:
            self._order = None if pilot.mission.waits else self._order
            return []
        while not self.is_over:
            if self._at == len(self.commands):
                self.is_done = True
                break
            command = self.commands[self._at]
            self._since_us = now_us if self._since_us is None else self._since_us
            try:
                commands = self._begin(command, pilot, now_us)
            except Refused as refused:
                if refused.code not in _WAITED_FOR:
                    self.failure = f"{command.name}: {refused.reason}"
                return []
            if commands or not self._is_done(command, pilot, now_us):
                return commands
            self._at, self._since_us, self._order, self._attempts = self._at + 1, None, None, 0
        return []

    # -- ordered -----------------------------------------------------------------------------------------------

    def _begin(self, command: VehicleCommand, pilot: Pilot, now_us: int) -> list[Command]:
        """The orders for it now; raises Refused."""
        status = pilot.status
        if command.name == "take-off" and (status is None or not status.airborne):
            return self._take_off(command.numbers[0], pilot, now_us)
        if isinstance(self._order, TakeOffOrder):
            return []  # it rises
        if command.name in {"winch", "magnet", "look-down"}:
            return self._handle(command, pilot, now_us)
        wanted = self._wanted(command, pilot)
        if wanted is None or self._is_shown(wanted, pilot):
            return []
        if self._order is not None:
            self._look(command, pilot)
            return []
        commands = pilot.order(wanted, Commander.MISSION)
        self._order, self._ordered_us = wanted, now_us
        return commands

    def _wanted(self, command: VehicleCommand, pilot: Pilot) -> Order | None:
        match command:
            case ("goto", (latitude_deg, longitude_deg, height_m)):
                return GoToOrder(latitude_deg, longitude_deg, _altitude_m(pilot, height_m))
            case ("take-off" | "climb", (height_m,)) if pilot.fix is not None:
                if isinstance(self._order, GoToOrder):
                    return self._order
                latitude_deg, longitude_deg = _place(pilot, pilot.fix)
                return GoToOrder(latitude_deg, longitude_deg, _altitude_m(pilot, height_m))
            case ("hold", _):
                return HoldOrder()
            case ("land", _):
                return LandOrder()
            case ("return-home", _):
                return ReturnHomeOrder()
        return None

    def _handle(self, command: VehicleCommand, pilot: Pilot, now_us: int) -> list[Command]:
        """Winch, gripper, and the camera's mount; raises Refused."""
        number = next(iter(command.numbers), 0.0)
        handlings: dict[str, LineOrder | GripOrder] = {"winch": LineOrder(number), "magnet": GripOrder(bool(number))}
        wanted = handlings.get(command.name, DOWN)
        if self._order == wanted:
            if wanted != DOWN and pilot.handled is not None and not pilot.handled.accepted:
                self.failure = f"{command.name}: autopilot: {pilot.handled.reason}"
            return []
        pilot.claims.check(Commander.MISSION)
        self._order, self._ordered_us = wanted, now_us
        return [pilot.handle(wanted)]

    def _is_shown(self, wanted: Order, pilot: Pilot) -> bool:
        """Whether the vehicle is in the wanted state without an order: a standing one need not be landed."""
        status = pilot.status
        if isinstance(wanted, LandOrder | ReturnHomeOrder):
            return status is not None and not status.armed
        return False

    def _look(self, command: VehicleCommand, pilot: Pilot) -> None:
        """Order again what giving way or another order ended; fail where the vehicle does not do it."""
        errand = pilot.errand
        if pilot.standing == self._order and errand is not None and errand.order == self._order:
            if errand.has_failed:
                self.failure = f"{command.name}: {errand.reason}"
        elif pilot.standing != self._order:
            self._order = None

    def _take_off(self, height_m: float, pilot: Pilot, now_us: int) -> list[Command]:
        """Guided mode, arming, take-off, each until its effect shows; raises Refused."""
        status = pilot.status
        if status is None:
            return []
        wanted: Order = TakeOffOrder(height_m) if status.armed else Arm() if status.guided else SetGuided()
        if wanted == self._order and now_us - self._ordered_us < AGAIN_US and not pilot.mission.refusal:
            return []
        if wanted == self._order:
            self._attempts += 1
            if self._attempts >= ATTEMPTS:
                what = type(wanted).__name__.removesuffix("Order")
                self.failure = f"take-off: {pilot.mission.refusal or f'{what} does not show in the vehicle'}"
                return []
            if now_us - self._ordered_us < AGAIN_US:
                return []
        else:
            self._attempts = 0
        commands = pilot.prepare(wanted)
        self._order, self._ordered_us = wanted, now_us
        return commands

    # -- done --------------------------------------------------------------------------------------------------

    def _is_done(self, command: VehicleCommand, pilot: Pilot, now_us: int) -> bool:
        fix, status = pilot.fix, pilot.status
        if fix is None or status is None or self.failure:
            return False
        match command.name:
            case "take-off":
                return bool(status.airborne) and fix.altitude_m >= _altitude_m(pilot, command.numbers[0]) - UPRIGHT_M
            case "land" | "return-home":
                return not status.armed
            case "look-down":
                return True
            case "magnet":
                return pilot.handled is not None and pilot.handled.accepted
            case "winch":
                return self._is_out(command.numbers[0], pilot)
            case "wait":
                return now_us >= (self._since_us or 0) + round(command.numbers[0] * 1e6)
        order = self._order
        if order is None or pilot.standing != order or fix.speed_m_s > SLOW_M_S or fix.valid_us < self._ordered_us:
            return False
        if not isinstance(order, GoToOrder):
            return pilot.errand is not None and pilot.errand.is_taken
        away_m = distance_m(fix.latitude_deg, fix.longitude_deg, order.latitude_deg, order.longitude_deg)
        return away_m <= LEVEL_M and abs(fix.altitude_m - order.altitude_m) <= UPRIGHT_M

    def _is_out(self, line_m: float, pilot: Pilot) -> bool:
        report = pilot.winch
        is_newer = report is not None and report.valid_us > self._ordered_us
        return bool(is_newer and report and report.line_m is not None and abs(report.line_m - line_m) <= LINE_M)


def _place(pilot: Pilot, fix: Fix) -> tuple[float, float]:
    """Where it climbs: where it was sent, if it is there, so that it still comes nearer, else where it is."""
    sent = pilot.standing
    if isinstance(sent, GoToOrder):
        away_m = distance_m(fix.latitude_deg, fix.longitude_deg, sent.latitude_deg, sent.longitude_deg)
        if away_m <= 2.0 * LEVEL_M:
            return sent.latitude_deg, sent.longitude_deg
    return fix.latitude_deg, fix.longitude_deg


def _altitude_m(pilot: Pilot, height_m: float) -> float:
    """Above mean sea level; raises Refused while home is not known."""
    home_m = pilot.bounds.home_altitude_m
    if home_m is None:
        raise Refused("the vehicle's home is not known", "forbidden")
    return home_m + height_m
