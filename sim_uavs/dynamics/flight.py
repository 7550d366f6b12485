"""The flying part of an autopilot: modes, arming, targets, missions, failsafes. Pure, stepped in 20 ms.

It knows metres north, east and down of its home and no protocol. Orders are answered at once with `Answer`; later
changes on its own are reported in `events`.
"""

from collections.abc import Callable
from dataclasses import replace
from enum import StrEnum
from math import isfinite, radians
from typing import NamedTuple, TypeAlias

import numpy as np

from dyknow.sim_uavs.dynamics import quadcopter as dynamics
from dyknow.sim_uavs.dynamics.guidance import Speeds, heading_to, velocity_to
from dyknow.sim_uavs.dynamics.missions import Item, MissionAction, MissionProgress
from dyknow.sim_uavs.dynamics.quadcopter import ZERO, Body, Vector
from dyknow.sim_uavs.dynamics.settings import VehicleConfig
from dyknow.sim_uavs.dynamics.slung import Hoist

STEP_US = 20_000
_LONGEST_CATCH_UP_US = 10_000_000  # a process that was stopped for longer resumes where it stood
_VELOCITY_HOLDS_US = 3_000_000  # a velocity demand that is not renewed ends in a hover
_NEAR_M = 0.5
_SETTLE_US = 1_000_000  # on the ground after landing before the motors stop
_FARTHEST_M = 50_000.0


class Mode(StrEnum):
    """Without a pilot's sticks STABILIZE, LOITER and BRAKE all mean: stop and stay."""

    STABILIZE = "STABILIZE"
    LOITER = "LOITER"
    BRAKE = "BRAKE"
    GUIDED = "GUIDED"
    OFFBOARD = "OFFBOARD"
    AUTO = "AUTO"
    RTL = "RTL"
    LAND = "LAND"


GUIDED_MODES = frozenset({Mode.GUIDED, Mode.OFFBOARD})
_ON_LOW_BATTERY = {1: Mode.LAND, 2: Mode.RTL}
"""`battery_low_action`, as ArduCopter's BATT_FS_LOW_ACT has it."""


class FlightAnswer(StrEnum):
    """Why an order was declined is the value; ACCEPTED is the only success."""

    ACCEPTED = "accepted"
    NOT_ARMED = "not armed"
    NOT_GUIDED = "not in a guided mode"
    AIRBORNE = "already airborne"
    ON_GROUND = "not airborne"
    NO_POSITION = "PreArm: no GPS fix"
    NO_CHARGE = "PreArm: battery too low"
    MODE_NOT_ARMABLE = "mode not armable"
    NO_MISSION = "no mission"
    OUT_OF_RANGE = "out of range"
    OUTSIDE_FENCE = "outside the fence"
    REJECTED = "temporarily rejected"
    DENIED = "denied"
    UNSUPPORTED = "unsupported"
    FAILED = "failed"


class GoingTo(NamedTuple):
    """Fly to a point and stay there; `yaw_rad` None looks ahead. `taking_off` until the height is reached."""

    point: Vector
    yaw_rad: float | None = None
    taking_off: bool = False


class Drifting(NamedTuple):
    """Fly with a velocity until `until_us`."""

    velocity: Vector
    until_us: int


Target: TypeAlias = GoingTo | Drifting


class StatusText(NamedTuple):
    """A text for the operator; MAVLink severities (2 critical, 4 warning, 6 info)."""

    severity: int
    text: str


class Reached(NamedTuple):
    """A mission item was reached."""

    item: int


Event: TypeAlias = StatusText | Reached


class Flight:
    """One vehicle in the air or on the ground, from `now_us` on.

    `rest_mode` is the mode in which it starts and to which it returns after a landing; None: STABILIZE, and it stays
    as it is.

    Attributes:
        at_us: how far it has flown.
        slung: the body below it, if it has a line.
        is_stuck: it does not leave the ground, whatever it is ordered.
        is_barred: whether a point lies outside of the areas of its fence.
        takes: how many times as long as usual it takes to get anywhere.
    """

    def __init__(self, config: VehicleConfig, now_us: int, rest_mode: Mode | None = None) -> None:
        self.limits, self.settings = config.limits, replace(config.settings)
        self.body = Body(
            Vector(0.0, 0.0, -config.airborne_m), yaw_rad=radians(config.heading_deg), charge=config.charge
        )
        self.armed = config.airborne_m > 0.0
        self.mode = Mode.GUIDED if self.armed else rest_mode or Mode.STABILIZE
        self.target: Target | None = GoingTo(self.body.position) if self.armed else None
        self.items: tuple[Item, ...] = ()
        self.progress = MissionProgress()
        self.first_item = 0
        self.speed_m_s: float | None = None
        self.events: list[Event] = []
        self.position_ok = True
        self.slung: Hoist | None = None
        self.is_stuck, self.takes = False, 1.0
        self._rest_mode = rest_mode
        self.is_barred: Callable[[Vector], bool] = lambda _point: False
        self._wind, self._gust = config.wind, ZERO
        self._rng = np.random.default_rng((config.seed, config.system_id, 1))
        self.at_us = now_us
        self._grounded_us = now_us
        self._flew = self.armed
        self._warned = False

    @property
    def airborne(self) -> bool:
        return not self.body.on_ground

    @property
    def landing(self) -> bool:
        is_home = self.mode is Mode.RTL and self._over_home and not self.settings.final_m
        return self.airborne and (self.mode is Mode.LAND or is_home)

    @property
    def taking_off(self) -> bool:
        return isinstance(self.target, GoingTo) and self.target.taking_off

    # Orders. Each is harmless when it is heard twice.

    def arm(self, *, force: bool = False) -> FlightAnswer:
        if self.armed:
            return FlightAnswer.ACCEPTED
        if not self.position_ok and not force:
            return FlightAnswer.NO_POSITION
        if self.body.charge <= self.settings.battery_critical:
            return FlightAnswer.NO_CHARGE
        if self.mode in {Mode.RTL, Mode.LAND, Mode.AUTO}:
            return FlightAnswer.MODE_NOT_ARMABLE
        self.armed, self._flew, self._grounded_us = True, False, self.at_us
        return FlightAnswer.ACCEPTED

    def disarm(self, *, force: bool = False) -> FlightAnswer:
        if self.armed and self.airborne and not force:
            return FlightAnswer.AIRBORNE
        self.armed, self.target = False, None
        return FlightAnswer.ACCEPTED

    def set_mode(self, mode: Mode) -> FlightAnswer:
        if mode is self.mode:
            return FlightAnswer.ACCEPTED
        if mode is Mode.AUTO and not self.items[self.first_item :]:
            return FlightAnswer.NO_MISSION
        self.mode = mode
        self.speed_m_s = None
        self.target = GoingTo(self._stop_point()) if self.armed and self.airborne else None
        if mode is Mode.AUTO:
            begin = self.progress.complete or self.progress.item < self.first_item
            self.progress = MissionProgress(self.first_item if begin else self.progress.item)
        return FlightAnswer.ACCEPTED

    def take_off(self, height_m: float) -> FlightAnswer:
        """Rise to `height_m` above home. Heard again while rising to the same height it changes nothing."""
        if not self.armed:
            return FlightAnswer.NOT_ARMED
        if self.mode not in GUIDED_MODES:
            return FlightAnswer.NOT_GUIDED
        if not (isfinite(height_m) and 0.0 < height_m <= _FARTHEST_M):
            return FlightAnswer.OUT_OF_RANGE
        here = self.body.position
        if self.airborne:
            same = isinstance(self.target, GoingTo) and abs(self.target.point.down + height_m) < _NEAR_M
            return FlightAnswer.ACCEPTED if same else FlightAnswer.AIRBORNE
        self.target = GoingTo(Vector(here.north, here.east, -height_m), self.body.yaw_rad, taking_off=True)
        return FlightAnswer.ACCEPTED

    def go_to(self, point: Vector, yaw_rad: float | None = None) -> FlightAnswer:
        refused = self._not_flying_guided()
        if refused:
            return refused
        if not all(map(isfinite, point)) or point.horizontal > _FARTHEST_M or not -_FARTHEST_M <= point.down <= 0.0:
            return FlightAnswer.OUT_OF_RANGE
        if self.settings.is_fenced_off(point.horizontal, -point.down) or self.is_barred(point):
            return FlightAnswer.OUTSIDE_FENCE
        self.target = GoingTo(point, yaw_rad if yaw_rad is not None and isfinite(yaw_rad) else None)
        return FlightAnswer.ACCEPTED

    def drift(self, velocity: Vector) -> FlightAnswer:
        """Fly with a velocity (m/s) for three seconds unless renewed."""
        refused = self._not_flying_guided()
        if refused:
            return refused
        if not all(map(isfinite, velocity)):
            return FlightAnswer.OUT_OF_RANGE
        self.target = Drifting(velocity, self.at_us + _VELOCITY_HOLDS_US)
        return FlightAnswer.ACCEPTED

    def change_speed(self, speed_m_s: float) -> FlightAnswer:
        """The speed over ground until the mode changes, m/s."""
        if not (isfinite(speed_m_s) and speed_m_s > 0.0):
            return FlightAnswer.OUT_OF_RANGE
        self.speed_m_s = min(speed_m_s, self.limits.speed_m_s)
        return FlightAnswer.ACCEPTED

    def hold(self) -> FlightAnswer:
        refused = self._not_flying_guided()
        if not refused:
            self.target = GoingTo(self._stop_point())
        return refused or FlightAnswer.ACCEPTED

    def set_item(self, index: int) -> FlightAnswer:
        if not 0 <= index < len(self.items):
            return FlightAnswer.OUT_OF_RANGE
        if index != self.progress.item or self.progress.complete:
            self.progress = MissionProgress(index)
        return FlightAnswer.ACCEPTED

    def _not_flying_guided(self) -> FlightAnswer | None:
        if not self.armed:
            return FlightAnswer.NOT_ARMED
        if not self.airborne:
            return FlightAnswer.ON_GROUND
        return None if self.mode in GUIDED_MODES else FlightAnswer.NOT_GUIDED

    def take_events(self) -> list[Event]:
        """The events since the last call."""
        events, self.events = self.events, []
        return events

    # Time.

    def on_time(self, now_us: int) -> None:
        """Fly up to `now_us`, in whole steps counted from the epoch, so that it does not matter how often this runs."""
        if now_us - self.at_us > _LONGEST_CATCH_UP_US:
            self.at_us = now_us - STEP_US
        while self.at_us // STEP_US < now_us // STEP_US:
            self.at_us = (self.at_us // STEP_US + 1) * STEP_US
            self._step()

    def _step(self) -> None:
        demand, yaw_rad = self._demand()
        self._gust = self._wind.next_gust(self._gust, STEP_US / 1e6, self._rng)
        motors = self.armed and self.body.charge > 0.0 and (self.airborne or (demand.down < 0.0 and not self.is_stuck))
        limits = self.limits if self.slung is None else dynamics.laden(self.limits, self.slung.load_kg)
        self.body = dynamics.step(
            self.body, demand, yaw_rad, self._wind.with_gust(self._gust), STEP_US / 1e6, limits, motors=motors
        )
        if self.slung is not None:
            self.slung.step(self.body, self.at_us)
        self._watch_ground()
        self._watch_battery()

    def _demand(self) -> tuple[Vector, float]:
        """The velocity and heading of this step."""
        if not self.armed:
            return ZERO, self.body.yaw_rad
        if self.mode is Mode.LAND or (self.mode is Mode.RTL and self.airborne):
            return self._come_down() if self.mode is Mode.LAND else self._return()
        if self.mode is Mode.AUTO:
            return self._mission()
        if isinstance(self.target, Drifting):
            if self.at_us < self.target.until_us:
                return self.target.velocity, self.body.yaw_rad
            self.target = GoingTo(self._stop_point())
        return self._follow(self.target) if self.target is not None else (ZERO, self.body.yaw_rad)

    def _follow(self, target: GoingTo) -> tuple[Vector, float]:
        if target.taking_off and abs(target.point.down - self.body.position.down) < _NEAR_M:
            self.target = target._replace(taking_off=False)
        yaw_rad = target.yaw_rad
        if yaw_rad is None:
            yaw_rad = heading_to(self.body.position, target.point, self.body.yaw_rad)
        return velocity_to(self.body.position, target.point, self._speeds(), self.limits), yaw_rad

    def _speeds(self) -> Speeds:
        s = self.settings
        mass_kg, load_kg = self.limits.mass_kg, 0.0 if self.slung is None else self.slung.load_kg
        climb_m_s = s.climb_m_s * mass_kg / (mass_kg + load_kg)
        return Speeds((self.speed_m_s or s.cruise_m_s) / self.takes, climb_m_s, s.descent_m_s)

    def _come_down(self) -> tuple[Vector, float]:
        """Straight down, slowly near the ground, holding the place over which it began."""
        over = self.target.point if isinstance(self.target, GoingTo) else self.body.position
        down = self.settings.land_m_s if self.body.height_m < 8.0 else self.settings.descent_m_s
        velocity = velocity_to(self.body.position, Vector(over.north, over.east, 0.0), self._speeds(), self.limits)
        return Vector(velocity.north, velocity.east, down), self.body.yaw_rad

    @property
    def _over_home(self) -> bool:
        return self.body.position.horizontal < _NEAR_M * 2

    def _return(self) -> tuple[Vector, float]:
        """Rise to the return height where it is, never sink to it; fly home; land, or stay at the final height."""
        here, final = self.body.position, GoingTo(Vector(0.0, 0.0, -self.settings.final_m))
        if self._over_home or (self.target == final and here.horizontal < 5.0):
            self.target = final
            return self._follow(final) if self.settings.final_m else self._come_down()
        height_m = max(self.settings.return_m, self.body.height_m)
        if self.body.height_m < self.settings.return_m - _NEAR_M:
            return self._follow(GoingTo(Vector(here.north, here.east, -height_m), self.body.yaw_rad))
        return self._follow(GoingTo(Vector(0.0, 0.0, -height_m)))

    def _mission(self) -> tuple[Vector, float]:
        """Fly the present item; step to the next when it is done; hold after the last."""
        item = self.items[self.progress.item] if self.progress.item < len(self.items) else None
        if item is None:
            return self._follow(GoingTo(self._stop_point()))
        if item.action is MissionAction.SET_SPEED:
            self.change_speed(item.speed_m_s)
            self.events.append(Reached(self.progress.item))
            return self._item_done()
        here = self.body.position
        if item.action is MissionAction.LAND and item.point and here.minus(item.point).horizontal > item.within_m:
            return self._follow(GoingTo(Vector(item.point.north, item.point.east, here.down)))
        if item.action in {MissionAction.LAND, MissionAction.RETURN}:
            self.events.append(Reached(self.progress.item))
            self.progress = self.progress._replace(complete=True)
            self.set_mode(Mode.LAND if item.action is MissionAction.LAND else Mode.RTL)
            return self._demand()
        point = item.point or here
        if item.action is MissionAction.TAKE_OFF:
            point = Vector(here.north, here.east, point.down)
        self.target = GoingTo(point)
        if self.progress.reached_us is None and here.is_close_to(point, item.within_m):
            self.progress = MissionProgress(self.progress.item, self.at_us)
            self.events.append(Reached(self.progress.item))
        since_us = self.progress.reached_us
        if since_us is not None and item.stay_us is not None and self.at_us - since_us >= item.stay_us:
            return self._item_done()
        return self._follow(self.target)

    def _item_done(self) -> tuple[Vector, float]:
        following = self.progress.item + 1
        if following >= len(self.items):
            self.progress = self.progress._replace(complete=True)
            self.events.append(StatusText(6, "Mission complete"))
            self.set_mode(Mode.GUIDED)
        else:
            self.progress = MissionProgress(following)
        return ZERO if not self.airborne else self.body.velocity, self.body.yaw_rad

    def _stop_point(self) -> Vector:
        """Where braking at the limit ends: stopping there does not swing back."""
        velocity = self.body.velocity
        reach_s = velocity.horizontal / (1.2 * self.limits.acceleration_m_s2)
        point = self.body.position.plus(Vector(velocity.north, velocity.east, 0.0), reach_s)
        return Vector(point.north, point.east, min(0.0, point.down))

    def _watch_ground(self) -> None:
        if self.airborne:
            self._flew, self._grounded_us = True, self.at_us
            return
        waits_us = _SETTLE_US if self._flew else round(self.settings.disarm_s * 1e6)
        if self.armed and not self.taking_off and self.at_us - self._grounded_us >= waits_us:
            self.armed, self.target = False, None
            self.mode = self._rest_mode or self.mode
            self.events.append(StatusText(6, "Landed, disarmed" if self._flew else "Disarmed: idle on the ground"))

    def _watch_battery(self) -> None:
        charge = self.body.charge
        if charge <= self.settings.battery_low and not self._warned:
            self._warned = True
            self.events.append(StatusText(4, f"Battery low: {charge:.0%}"))
            action = _ON_LOW_BATTERY.get(int(self.settings.battery_low_action))
            if action is not None and self.airborne and self.armed and self.mode not in {Mode.LAND, action}:
                self.set_mode(action)
        if charge <= self.settings.battery_critical and self.airborne and self.armed and self.mode is not Mode.LAND:
            self.events.append(StatusText(2, f"Battery critical: {charge:.0%}, landing"))
            self.set_mode(Mode.LAND)
