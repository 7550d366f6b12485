"""A simulated vehicle without a protocol: it takes orders and gives reports, as a platform's edge would. Pure.

The same flight, sensors and faults as the autopilot that speaks MAVLink, for the world in a box.
"""

from math import isfinite
from typing import NamedTuple

import numpy as np

from dyknow.navigation import vehicle
from dyknow.navigation.cameras.pinhole import Attitude, PanTilt
from dyknow.navigation.cruise import CruiseReport
from dyknow.navigation.geodesy import LocalFrame
from dyknow.navigation.heard_aircraft import HeardAircraft
from dyknow.navigation.mission_plans import MissionPlanReport
from dyknow.sim_uavs.cameras.mount import Mount, MountLimits
from dyknow.sim_uavs.dynamics.aircraft import PassingAircraft, PassingTraffic
from dyknow.sim_uavs.dynamics.faults import ActiveFaults, FaultSchedule, SimulatedFault, spoil
from dyknow.sim_uavs.dynamics.fences import FlightFence
from dyknow.sim_uavs.dynamics.flight import GUIDED_MODES, Flight, FlightAnswer, GoingTo, Mode
from dyknow.sim_uavs.dynamics.link_loss import OWN_STATION, LinkFailsafe
from dyknow.sim_uavs.dynamics.missions import Item, flown_items
from dyknow.sim_uavs.dynamics.quadcopter import ZERO, Vector
from dyknow.sim_uavs.dynamics.sensors import GpsReading, next_wander, read_gps
from dyknow.sim_uavs.dynamics.settings import VehicleConfig
from dyknow.sim_uavs.dynamics.slung import Hoist, HoistFaults

REPORT_US = 100_000
SELDOM = 10
WINCH_EVERY = 2
_SOURCE = "GLOBAL_POSITION_INT"
_RETRY_US, _ATTEMPTS = 500_000, 4
"""How often an edge repeats an order that is not acknowledged (`dyknow.proxies.mavlink.orders`)."""
_REFUSALS = {
    1: FlightAnswer.REJECTED,
    2: FlightAnswer.DENIED,
    3: FlightAnswer.UNSUPPORTED,
    4: FlightAnswer.FAILED,
}


class TrueState(NamedTuple):
    """Where a vehicle really is: WGS-84 degrees, metres above mean sea level, metres per second (NED)."""

    at_us: int
    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    north_m_s: float
    east_m_s: float
    down_m_s: float


class SensedFlight:
    """A flight with its position sensor and the faults that hold, whichever protocol it is reported by.

    Args:
        period_us: how often its position is measured.
        rest_mode: of the flight.
    """

    def __init__(self, config: VehicleConfig, now_us: int, period_us: int, rest_mode: Mode | None = None) -> None:
        self.config = config
        self.flight = Flight(config, now_us, rest_mode)
        self._frame = LocalFrame(*config.home)
        self._faults = ActiveFaults()
        self._schedule = FaultSchedule(config.faults, now_us)
        self._rng = np.random.default_rng((config.seed, config.system_id, 2))
        self._wander = ZERO
        self._gps: GpsReading | None = None
        self._period_us = period_us
        self._orders_rng = np.random.default_rng((config.seed, config.system_id, 4))
        self._streamed: tuple[Vector, int] | None = None
        self._is_taken = False
        self._mount_rng = np.random.default_rng((config.seed, config.system_id, 5))
        self.mount = Mount(MountLimits(), self._mount_rng) if config.has_mount else None
        self._mounted_us = now_us
        self.hoist: Hoist | None = None
        self._traffic = PassingTraffic()
        self._failsafe = LinkFailsafe(self.flight, config.persona)
        self.fence = FlightFence(self.flight, self._frame, config.persona)
        self.fence.take(config.fence)

    def carry(self, hoist: Hoist) -> None:
        """Have a winch with a magnet, from now on."""
        self.hoist = self.flight.slung = hoist
        settings = self.flight.settings
        settings.gripper_on, settings.winch_type = 1.0, 2.0

    @property
    def working_hoist(self) -> Hoist | None:
        """The winch, if there is one and it is switched on."""
        return self.hoist if self.flight.settings.winch_type else None

    def inject(self, fault: SimulatedFault, now_us: int, until_us: int | None = None) -> None:
        """Begin a fault, until `until_us` or for good. `battery-low` empties the battery once, `killed` is for good."""
        if fault.kind == "battery-low":
            body = self.flight.body
            self.flight.body = body._replace(charge=min(body.charge, fault.amount / 100.0))
        elif fault.kind == "killed":
            self.flight.disarm(force=True)
            self._faults.inject(SimulatedFault("silence"), now_us)
        elif fault.kind == "dropped-box":
            if self.hoist is not None:
                self.hoist.drop(now_us)
        else:
            self._faults.inject(fault, now_us, until_us)

    def truth(self, now_us: int) -> TrueState:
        """Fly up to `now_us`; where it is then."""
        self.flight.on_time(now_us)
        body = self.flight.body
        return TrueState(now_us, *self._frame.from_ned(*body.position), *body.velocity)

    def level_pose(self, now_us: int) -> tuple[Vector, Attitude]:
        """Fly, and turn the mount, up to `now_us`; where the vehicle is, NED of home, and its heading."""
        self.flight.on_time(now_us)
        body = self.flight.body
        heading = Attitude(0.0, 0.0, body.yaw_rad)
        if self.mount is not None and now_us > self._mounted_us:
            self.mount.advance((now_us - self._mounted_us) / 1e6, heading, np.array(body.position))
            self._mounted_us = now_us
        return body.position, heading

    def looking(self, now_us: int) -> tuple[Vector, Attitude, PanTilt] | None:
        """Where the vehicle is, its heading, and where its mount points; None: its cameras show nothing, or it has no mount."""
        position, heading = self.level_pose(now_us)
        if self.mount is None or self._faults.holds("silence", now_us) or self._faults.holds("blind", now_us):
            return None
        return position, heading, self.mount.angles

    def aim(self, order: vehicle.MountOrder) -> FlightAnswer:
        """Turn the mount, as far as it turns."""
        if self.mount is None:
            return FlightAnswer.UNSUPPORTED
        if not all(map(isfinite, order)):
            return FlightAnswer.OUT_OF_RANGE
        if isinstance(order, vehicle.PointMountOrder):
            self.mount.turn(PanTilt(*order))
        else:
            self.mount.look_at(*self._frame.to_ned(*order))
        return FlightAnswer.ACCEPTED

    def _heard(self, now_us: int) -> list[PassingAircraft]:
        """Other aircraft that its receivers hear now."""
        return self._traffic.heard(now_us, self._faults, self.flight.body.position)

    def _suffer(self, now_us: int) -> None:
        """Have others command the vehicle, while that holds: a ground station, and a pilot at the sticks."""
        self._fail(now_us)
        self._failsafe.on_time(now_us)
        self.fence.on_time()
        flight, hertz = self.flight, self._faults.amount("stream-target", now_us)
        if hertz is None:
            self._streamed = None
        elif self._streamed is None:
            if isinstance(flight.target, GoingTo):
                self._streamed = flight.target.point, now_us + round(1e6 / hertz)
        elif now_us >= self._streamed[1]:
            flight.go_to(self._streamed[0])
            self._streamed = self._streamed[0], now_us + round(1e6 / hertz)
        taken = self._faults.holds("takeover", now_us)
        if taken is not self._is_taken:
            self._is_taken = taken
            flight.set_mode(Mode.LOITER if taken else Mode.GUIDED)

    def _fail(self, now_us: int) -> None:
        """Apply the active faults; faults of the schedule begin."""
        holds = self.hoist is not None and self.hoist.load_kg > 0.0
        for fault, until_us in self._schedule.due(now_us, is_armed=self.flight.armed, holds=holds):
            self.inject(fault, now_us, until_us)
        self.flight.is_stuck = self._faults.holds("failed-take-off", now_us)
        self.flight.takes = self._faults.amount("late", now_us) or 1.0
        if self.hoist is not None:
            misplaced_m = self._faults.amount("misplaced-box", now_us) or 0.0
            self.hoist.faults = HoistFaults(self._faults.holds("failed-attach", now_us), misplaced_m)
            self.hoist.rate_m_s = self.flight.settings.winch_m_s

    def _disobeys(self, now_us: int) -> FlightAnswer | None:
        """The autopilot's answer to an order that it does not carry out; None: it does."""
        result = self._faults.amount("refuse", now_us)
        if result is not None:
            return _REFUSALS[int(result)]
        return FlightAnswer.ACCEPTED if self._faults.holds("forget", now_us) else None

    def _loses_ack(self, now_us: int) -> bool:
        loss = self._faults.amount("ack-loss", now_us)
        return loss is not None and bool(self._orders_rng.random() * 100.0 < loss)

    def _ack_delay_us(self, now_us: int) -> int:
        return round((self._faults.amount("ack-delay", now_us) or 0.0) * 1e6)

    def _measure(self, now_us: int) -> None:
        noise = self.config.gps
        factor = self._faults.amount("gps-noise", now_us)
        self._wander = next_wander(self._wander, noise, self._period_us / 1e6, self._rng)
        reading = read_gps(self.flight.body, self._wander, noise if factor is None else noise.scaled(factor), self._rng)
        self._gps = spoil(reading, self._gps, self._faults, now_us)
        self.flight.position_ok = self._gps is not None


class SimulatedVehicle(SensedFlight):
    """One vehicle, from `now_us` on. It flies by the world's time; its reports are stamped by their receiver.

    Args:
        report_us: how often it reports position and velocity; the rest comes every `SELDOM`-th time.
        phase_us: when, within that period, it does.

    Attributes:
        is_attended: whether the process of its platform runs, of which it hears heartbeats.
    """

    def __init__(self, config: VehicleConfig, now_us: int, *, report_us: int = REPORT_US, phase_us: int = 0) -> None:
        super().__init__(config, now_us, report_us)
        self._phase_us = phase_us
        self._reports = 0
        self._loaded: tuple[Item, ...] = ()
        self.is_attended = True
        self.deadline_us = self._next_us(now_us)

    def _next_us(self, now_us: int) -> int:
        return ((now_us - self._phase_us) // self._period_us + 1) * self._period_us + self._phase_us

    def on_time(self, now_us: int, stamp_us: int) -> list[vehicle.Report]:
        """Fly, and report what is due, as valid at `stamp_us`."""
        self.flight.on_time(now_us)
        if self.is_attended and not self._faults.holds("silence", now_us):
            self._failsafe.on_heartbeat(OWN_STATION, now_us)
        self._suffer(now_us)
        if now_us < self.deadline_us:
            return []
        self.deadline_us = self._next_us(now_us)
        self._measure(now_us)
        seldom = self._reports % SELDOM == 0
        self._reports += 1
        if self._faults.holds("silence", now_us):
            return []
        reports = self._seldom(stamp_us) if seldom else []
        loss = self._faults.amount("packet-loss", now_us)
        if self._gps is not None and (loss is None or self._rng.random() * 100.0 >= loss):
            reports += self._often(self._gps, stamp_us)
        return (
            reports + self._mounted(now_us, stamp_us) + self._wound(stamp_us) + self._traffic_reports(now_us, stamp_us)
        )

    def _traffic_reports(self, now_us: int, stamp_us: int) -> list[vehicle.Report]:
        """Once a second what its receivers hear."""
        aircraft = tuple(
            HeardAircraft(
                stamp_us, "adsb" if one.kind == "helicopter" else "remote-id",
                "adsb-4ca123" if one.kind == "helicopter" else "rid-1sim5flyby", *self._frame.from_ned(*one.position), 60.0,
                "barometric", *one.velocity, kind=one.kind,
            )
            for one in self._heard(now_us)
        )  # fmt: skip
        return [vehicle.TrafficReport(stamp_us, aircraft)] if aircraft else []

    def _wound(self, stamp_us: int) -> list[vehicle.Report]:
        hoist = self.working_hoist
        if hoist is None or self._reports % WINCH_EVERY:
            return []
        is_moving = abs(hoist.speed_m_s) > 0.01
        return [vehicle.WinchReport(stamp_us, hoist.line_m, abs(hoist.speed_m_s), hoist.load_kg, True, is_moving)]

    def _mounted(self, now_us: int, stamp_us: int) -> list[vehicle.Report]:
        """The attitude and mount angles that the place of a camera's image follows from, next to the position."""
        looking = self.looking(now_us)
        if looking is None or self.mount is None:
            return []
        body, sd_rad = self.flight.body, self.config.imu.attitude_rad
        turned = self._mount_rng.normal((body.roll_rad, body.pitch_rad, body.yaw_rad), sd_rad).tolist()
        attitude = vehicle.AttitudeReport(stamp_us, "ATTITUDE", *turned)
        return [attitude, vehicle.MountReport(stamp_us, "MOUNT", *self.mount.reported())]

    def _often(self, gps: GpsReading, stamp_us: int) -> list[vehicle.Report]:
        latitude, longitude, altitude = self._frame.from_ned(*gps.position)
        height_m = altitude - self.config.home.altitude_m
        return [
            vehicle.PositionReport(stamp_us, _SOURCE, latitude, longitude, altitude, height_m=height_m),
            vehicle.VelocityReport(stamp_us, _SOURCE, *gps.velocity),
        ]

    def _seldom(self, stamp_us: int) -> list[vehicle.Report]:
        flight = self.flight
        found: list[vehicle.Report] = [
            vehicle.StatusReport(
                stamp_us, flight.armed, flight.mode in GUIDED_MODES, flight.airborne, flight.mode.value
            ),
            vehicle.HomeReport(stamp_us, *self.config.home),
            vehicle.BatteryReport(stamp_us, flight.body.charge),
            self._failsafe.report(stamp_us),
            CruiseReport(stamp_us, flight.settings.cruise_m_s, flight.settings.climb_m_s, flight.settings.descent_m_s),
        ]
        if isinstance(flight.target, GoingTo):
            found.append(vehicle.TargetReport(stamp_us, *self._frame.from_ned(*flight.target.point)))
        if flight.items:
            found.append(vehicle.MissionReport(stamp_us, flight.progress.item))
        if flight.items is not self._loaded:
            self._loaded = flight.items
            found.append(MissionPlanReport(stamp_us, flown_items(flight.items, self._frame)))
        return [*found, self.fence.report(stamp_us)]

    def on_command(self, command: vehicle.Command, now_us: int, stamp_us: int) -> list[tuple[int, vehicle.Report]]:
        """Carry out an order, or refuse it: the answer, and after how long it comes.

        An order whose acknowledgements are lost is repeated, as `dyknow.proxies.mavlink.orders` does.
        """
        after_us, accepted, reason = self._answer(command.order, now_us)
        return [(after_us, vehicle.CommandResult(stamp_us, command.number, accepted, reason))]

    def _answer(self, order: vehicle.Order, now_us: int) -> tuple[int, bool, str]:
        self.flight.on_time(now_us)
        delay_us = self._ack_delay_us(now_us)
        if self._faults.holds("silence", now_us):
            return _ATTEMPTS * _RETRY_US, False, vehicle.NO_ANSWER
        answer = self._disobeys(now_us) or self._obey(order)
        lost = next((count for count in range(_ATTEMPTS) if not self._loses_ack(now_us)), _ATTEMPTS)
        if lost == _ATTEMPTS:
            return _ATTEMPTS * _RETRY_US, False, vehicle.NO_ANSWER
        return delay_us + lost * _RETRY_US, answer is FlightAnswer.ACCEPTED, answer.value

    def _obey(self, order: vehicle.Order) -> FlightAnswer:
        flight = self.flight
        match order:
            case vehicle.GoToOrder() | vehicle.InterruptOrder():
                if isinstance(order, vehicle.InterruptOrder):
                    flight.set_mode(Mode.GUIDED)
                elif order.speed_m_s is not None:
                    flight.change_speed(order.speed_m_s)
                place = self._frame.to_ned(order.latitude_deg, order.longitude_deg, order.altitude_m)
                return flight.go_to(Vector(*place))
            case vehicle.HoldOrder():
                return flight.hold()
            case vehicle.LandOrder():
                return flight.set_mode(Mode.LAND)
            case vehicle.ReturnHomeOrder():
                return flight.set_mode(Mode.RTL)
            case vehicle.Arm():
                return flight.arm() if order.armed else flight.disarm()
            case vehicle.SetGuided():
                return flight.set_mode(Mode.GUIDED)
            case vehicle.TakeOffOrder():
                return flight.take_off(order.height_m)
            case vehicle.ResumeMissionOrder():
                return flight.set_mode(Mode.AUTO)
            case vehicle.MissionItemOrder():
                return flight.set_item(order.item)
            case vehicle.PointMountOrder() | vehicle.LookAtOrder():
                return self.aim(order)
            case vehicle.GripOrder() | vehicle.LineOrder():
                return self._handle(order)

    def _handle(self, order: vehicle.GripOrder | vehicle.LineOrder) -> FlightAnswer:
        """As the autopilot that speaks MAVLink does it."""
        hoist, is_on = self.working_hoist, bool(self.flight.settings.gripper_on)
        if hoist is None or (isinstance(order, vehicle.GripOrder) and not is_on):
            return FlightAnswer.FAILED
        if isinstance(order, vehicle.LineOrder):
            if not 0.0 <= order.line_m <= vehicle.LONGEST_LINE_M:
                return FlightAnswer.OUT_OF_RANGE
            hoist.let_out(order.line_m - hoist.line_m)
        elif order.holds:
            hoist.grip()
        else:
            hoist.release(self.flight.at_us)
        return FlightAnswer.ACCEPTED
