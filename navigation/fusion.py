"""The fused position of one vehicle: reports in, estimates on a time grid out. Pure; time is an argument.

A vehicle's reports are weighed by their stated accuracy; where a message states none, by `Accuracy`. A grid point g (a
multiple of the period since the epoch) is put out by predicting to it what was known: when a position valid at g or
later has come, at the latest `wait_us` after g. No grid point lies further than a short horizon beyond the last good
position: after silence nothing is invented, and points of the grid without a report stay empty.

The outcome depends on the reports and their available times alone, not on when timers happen to fire: a timer that is
due before a report is carried out before it.
"""

import math
from collections import Counter
from typing import Literal, NamedTuple

from dyknow.model.sample import Sample
from dyknow.navigation import faults, vehicle
from dyknow.navigation.faults import Candidate, FrozenSource, PlausibleLimits
from dyknow.navigation.geodesy import LocalFrame
from dyknow.navigation.inertial import InertialInput
from dyknow.navigation.motion import Measurement, Motion, MotionState

_REANCHOR_M = 2_000.0
_VELOCITY_ALLOWANCE_M_S = 3.0
_LONGEST_SILENCE_US = 5_000_000
_SAME_MESSAGE_US = 300_000
_DRIFT_M_S = 0.5
"""How fast a position is assumed to go wrong without satellites. ArduCopter 3.3 was 3 m off after 16 s of hovering."""
_LARGEST_SD = 1e6
_SETTLES_US = 10_000_000
"""How long an autopilot may take to bring its position back to the satellites' once it has a fix again."""


class Estimate(NamedTuple):
    """Degrees (WGS-84), metres above mean sea level, metres per second north-east-down; variances in their squares."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    north_m_s: float
    east_m_s: float
    down_m_s: float
    var_n: float
    var_e: float
    var_d: float
    var_vn: float
    var_ve: float
    var_vd: float


class Health(NamedTuple):
    """Whether estimates are being put out. `since_us` is federation time.

    `reason` says why not; while they are put out it is empty, or says why they are less certain than usual.
    """

    state: Literal["ok", "stale"]
    reason: str
    since_us: int


class Accuracy(NamedTuple):
    """The assumed accuracy of reports that state none.

    Standard deviations in metres and metres per second; acceleration noise densities in m^2/s^3 without and with
    measured acceleration.
    """

    position_m: float = 0.3
    velocity_m_s: float = 0.3
    density: float = 8.0
    density_inertial: float = 4.0


class PositionFilter:
    """A computational unit: `Report`s of one vehicle in, samples of `Estimate` out.

    Args:
        period_us: distance of the grid points, which are multiples of it since the epoch.
        wait_us: how long after a grid point (by available time) a position at or beyond it is waited for;
            half a period if None.
        horizon_us: the furthest prediction beyond the last position; shortened to 2.5 of the source's own intervals.
    """

    def __init__(
        self,
        period_us: int,
        *,
        wait_us: int | None = None,
        horizon_us: int = 1_000_000,
        accuracy: Accuracy | None = None,
        limits: PlausibleLimits | None = None,
    ) -> None:
        if period_us <= 0:
            raise ValueError(f"the period of the position filter must be positive, got {period_us} us")
        self._period_us, self._horizon_us = period_us, horizon_us
        self._wait_us = period_us // 2 if wait_us is None else wait_us
        self._accuracy, self._limits = accuracy or Accuracy(), limits or PlausibleLimits()
        self.health = Health("stale", faults.NO_POSITION, 0)
        self.rejected: Counter[str] = Counter()
        self._frame: LocalFrame | None = None
        self._motion: Motion | None = None
        self._inertial = InertialInput()
        self._frozen: dict[str, FrozenSource] = {}
        self._candidate: Candidate | None = None
        self._reason = faults.SILENT
        self._velocity: Measurement | None = None
        self._position_us = self._altitude_us = self._arrived_us = 0
        self._interval_us = self._altitude_interval_us = horizon_us * 2 // 5
        self._has_fix: bool | None = None
        self._lost_us: int | None = None
        self._regained_us: int | None = None
        self._end_us = self._last_predictable_us()
        self._next_us = 0
        self._available_us = 0

    @property
    def deadline_us(self) -> int | None:
        """When `on_time` has work: the next grid point's wait is over, or the stream goes stale. None: nothing waits."""
        if self.health.state == "stale":
            return self._silent_us if self.health.reason == faults.LATE else None
        return min(self._next_us, self._end_us) + self._wait_us

    def on_report(self, report: vehicle.Report, now_us: int) -> list[Sample]:
        """Take in a report that became available at `now_us`; the samples that are due by it."""
        found = self._until(now_us - 1)
        match report:
            case vehicle.PositionReport():
                self._arrived_us = now_us
                found += self._on_position(report, now_us)
            case vehicle.VelocityReport() | vehicle.LocalPositionReport():
                self._on_velocity(report, now_us)
            case vehicle.AttitudeReport():
                self._inertial.on_attitude(report)
            case vehicle.AccelerationReport():
                self._inertial.on_acceleration(report)
            case vehicle.FixReport():
                self._on_fix(report, now_us)
            case _:
                pass
        return found

    def on_time(self, now_us: int) -> list[Sample]:
        return self._until(now_us)

    @property
    def _silent_us(self) -> int:
        """From when on nothing has come at all; until then what comes is late."""
        return self._arrived_us + self._interval_us * 3 // 2 + 1

    def _last_predictable_us(self) -> int:
        """The last instant that may be predicted to."""
        return min(
            last_us + min(self._horizon_us, max(2 * self._period_us, interval_us * 5 // 2))
            for last_us, interval_us in (
                (self._position_us, self._interval_us),
                (self._altitude_us, self._altitude_interval_us),
            )
        )

    def _on_fix(self, report: vehicle.FixReport, now_us: int) -> None:
        """Satellites that were there are lost, or are there again; a vehicle that never had any does without."""
        if report.has_fix:
            self._regained_us = report.valid_us if self._lost_us is not None else None
        elif self._has_fix:
            self._lost_us, self._regained_us = report.valid_us, None
        self._has_fix = report.has_fix
        if self.health.state == "ok" and self.health.reason != self._uncertainty:
            self.health = Health("ok", self._uncertainty, now_us)

    @property
    def _uncertainty(self) -> str:
        return faults.NO_GPS if self._lost_us is not None and self._regained_us is None else ""

    def _drift_m2(self, valid_us: int) -> float:
        """The variance, for each level axis, of the autopilot's drift while it had no satellites."""
        if self._lost_us is None:
            return 0.0
        ends_us = valid_us
        if self._regained_us is not None:
            if valid_us > self._regained_us + _SETTLES_US:
                self._lost_us = self._regained_us = None
                return 0.0
            ends_us = min(valid_us, self._regained_us)
        return (_DRIFT_M_S * max(0, ends_us - self._lost_us) / 1e6) ** 2

    def _until(self, now_us: int) -> list[Sample]:
        """Put out the grid points whose wait is over at `now_us`, and go stale when the last of them has been."""
        if self.health.state == "stale":
            if self.health.reason == faults.LATE and now_us >= self._silent_us:
                self.health = self.health._replace(reason=faults.SILENT)
            return []
        due_us, end_us = now_us - self._wait_us, self._end_us
        if due_us < self._next_us and due_us < end_us:
            return []
        found = self._grid(min(due_us, end_us), now_us)
        if self._next_us > end_us and due_us >= end_us:
            fresh = self._position_us > self._altitude_us
            missing = faults.NO_ALTITUDE if fresh else faults.LATE if now_us < self._silent_us else faults.SILENT
            reason = missing if self._reason == faults.SILENT else self._reason
            self.health = Health("stale", reason, min(self._position_us, self._altitude_us))
        return found

    def _grid(self, last_us: int, now_us: int) -> list[Sample]:
        """The grid points not put out yet, up to `last_us`."""
        found: list[Sample] = []
        motion = self._motion
        while motion is not None and self._next_us <= last_us:
            if self._next_us >= motion.oldest_us:
                self._available_us = max(now_us, self._available_us + 1)
                found.append(Sample(self._available_us, self._next_us, self._estimate(motion.at(self._next_us))))
            self._next_us += self._period_us
        return found

    def _estimate(self, state: MotionState) -> Estimate:
        frame = self._frame
        assert frame is not None  # noqa: S101 - set together with the motion
        (n, vn, var_n, _, var_vn), (e, ve, var_e, _, var_ve), (d, vd, var_d, _, var_vd) = state.axes
        drift = self._drift_m2(state.valid_us)
        place = frame.from_ned(n, e, d)
        return Estimate(*place, vn, ve, vd, var_n + drift, var_e + drift, var_d, var_vn, var_ve, var_vd)

    def _on_position(self, report: vehicle.PositionReport, now_us: int) -> list[Sample]:
        reason = faults.implausible_position(report)
        if reason is None and report.valid_us > now_us + self._limits.ahead_us:
            reason = faults.AHEAD
        if reason is None:
            frozen = self._frozen.setdefault(report.source, FrozenSource(self._limits))
            reason = frozen.on_position(report, self._believed_speed(report.valid_us))
        if reason is not None:
            self._refuse(reason)
            return []
        motion = self._motion
        if motion is None:
            self._start(report)
            return self._accepted(report, now_us)
        measured = self._measured(report)
        if self._begins(report, measured, motion):
            self._start(report)
        elif report.valid_us < motion.oldest_us:
            return self._on_disagreement(report, faults.TOO_LATE, now_us)
        elif not self._agrees(measured, motion):
            return self._on_disagreement(report, faults.TELEPORT, now_us)
        else:
            motion.fuse(measured)
        return self._accepted(report, now_us)

    def _begins(self, report: vehicle.PositionReport, measured: Measurement, motion: Motion) -> bool:
        """Nothing of the past helps: the first altitude, or a long silence after which the place is still credible."""
        first_altitude = self._altitude_us == 0 and report.altitude_m is not None
        long_silent = report.valid_us > self._position_us + _LONGEST_SILENCE_US
        return (first_altitude or long_silent) and self._reachable(measured, motion)

    def _accepted(self, report: vehicle.PositionReport, now_us: int) -> list[Sample]:
        self._candidate, self._reason = None, faults.SILENT
        self._interval_us = self._typical(self._interval_us, self._position_us, report.valid_us)
        self._position_us = max(self._position_us, report.valid_us)
        if report.altitude_m is not None:
            before_us, self._altitude_us = self._altitude_us, max(self._altitude_us, report.valid_us)
            self._altitude_interval_us = self._typical(self._altitude_interval_us, before_us, report.valid_us)
        self._end_us = self._last_predictable_us()
        if self.health.state == "stale":
            next_us = max(self._next_us, -(-report.valid_us // self._period_us) * self._period_us)
            if next_us > self._end_us:
                return []
            self._next_us, self.health = next_us, Health("ok", self._uncertainty, now_us)
        found = self._grid(min(report.valid_us, self._end_us), now_us)
        self._reanchor()
        return found

    def _typical(self, typical_us: int, before_us: int, valid_us: int) -> int:
        """The interval of a source's reports: the longest, slowly forgotten."""
        interval_us = min(valid_us - before_us, self._horizon_us)
        return max(interval_us, typical_us * 9 // 10) if interval_us > 0 and before_us else typical_us

    def _measured(self, report: vehicle.PositionReport) -> Measurement:
        """In the local frame. Without an altitude the frame's own stands in, and only the level rows are used."""
        frame = self._frame
        assert frame is not None  # noqa: S101 - set together with the motion
        unstated = self._accuracy.position_m
        level = _variance(report.horizontal_sd_m or unstated)
        steep = _variance(report.vertical_sd_m or unstated)
        altitude_m = frame.altitude_m if report.altitude_m is None else report.altitude_m
        north, east, down = frame.to_ned(report.latitude_deg, report.longitude_deg, altitude_m)
        if report.altitude_m is None:
            return Measurement(report.valid_us, "level", (north, east), (level, level))
        return Measurement(report.valid_us, "position", (north, east, down), (level, level, steep))

    def _start(self, report: vehicle.PositionReport) -> None:
        self._frame = LocalFrame(report.latitude_deg, report.longitude_deg, report.altitude_m or 0.0)
        densities = (self._accuracy.density, self._accuracy.density_inertial)
        self._motion = Motion(self._measured(report), self._inertial.mean, densities)
        if self._velocity is not None and abs(report.valid_us - self._velocity.valid_us) <= _SAME_MESSAGE_US:
            self._motion.fuse(self._velocity._replace(valid_us=report.valid_us))
        self._position_us = report.valid_us
        self._altitude_us = report.valid_us if report.altitude_m is not None else 0

    def _agrees(self, measured: Measurement, motion: Motion) -> bool:
        """Innovation gate, with what sources may honestly disagree by; and nothing is faster than `speed_m_s`."""
        axes = motion.at(measured.valid_us).axes
        allowed = self._limits.allowance_m**2 + self._drift_m2(measured.valid_us)
        squares = 0.0
        for value, variance, axis in zip(measured.values, measured.variances, axes, strict=False):
            squares += (value - axis.place) ** 2 / (axis.var_place + variance + allowed)
        return squares <= self._limits.gate and self._reachable(measured, motion)

    def _reachable(self, measured: Measurement, motion: Motion) -> bool:
        latest = motion.latest
        moved = math.dist(measured.values[:2], latest.places[:2])
        seconds = abs(measured.valid_us - latest.valid_us) / 1e6
        drift = self._drift_m2(measured.valid_us)
        spread = math.sqrt(latest.axes[0].var_place + measured.variances[0] + drift)
        return moved <= self._limits.speed_m_s * seconds + 5 * spread + 3 * self._limits.allowance_m

    def _on_disagreement(self, report: vehicle.PositionReport, reason: str, now_us: int) -> list[Sample]:
        """Refuse it; but positions that keep agreeing with each other are where the vehicle is."""
        self._refuse(reason)
        last = self._candidate
        if last is None or not self._follows(report, last.report):
            last = Candidate(report, 0, report.valid_us)
        found = self._candidate = Candidate(report, last.found + 1, last.since_us)
        lasted_us = report.valid_us - found.since_us
        if found.found < self._limits.reacquire or lasted_us < self._limits.reacquire_us:
            return []
        self.rejected["reacquired"] += 1
        self._start(report)
        return self._accepted(report, now_us)

    def _follows(self, report: vehicle.PositionReport, last: vehicle.PositionReport) -> bool:
        if report.valid_us <= last.valid_us:
            return False
        frame = LocalFrame(last.latitude_deg, last.longitude_deg, 0.0)
        north, east, _ = frame.to_ned(report.latitude_deg, report.longitude_deg, 0.0)
        seconds = (report.valid_us - last.valid_us) / 1e6
        spread = (report.horizontal_sd_m or self._accuracy.position_m) + self._limits.allowance_m
        return math.hypot(north, east) <= self._limits.speed_m_s * seconds + 5 * spread

    def _on_velocity(self, report: vehicle.VelocityReport | vehicle.LocalPositionReport, now_us: int) -> None:
        motion = self._motion
        reason = faults.implausible_velocity(report, self._limits.speed_m_s)
        if reason is None and report.valid_us > now_us + self._limits.ahead_us:
            reason = faults.AHEAD
        if reason is not None:
            self.rejected[reason] += 1
            return
        stated = report.sd_m_s if isinstance(report, vehicle.VelocityReport) else None
        variance = _variance(stated or self._accuracy.velocity_m_s)
        level = (report.north_m_s, report.east_m_s)
        values = level if report.down_m_s is None else (*level, report.down_m_s)
        kind = "velocity" if len(values) == 3 else "level velocity"
        measured = Measurement(report.valid_us, kind, values, (variance,) * len(values))
        if motion is None or report.valid_us > self._position_us + self._horizon_us:
            self._velocity = measured  # it places nothing, but the next position may begin with it
            return
        if report.valid_us < motion.oldest_us:
            return
        state = motion.at(report.valid_us)
        off = math.dist(values, state.speeds[: len(values)])
        spread = math.sqrt(state.axes[0].var_speed + variance)
        if off > 5 * spread + _VELOCITY_ALLOWANCE_M_S:
            self.rejected[faults.VELOCITY_JUMP] += 1
            return
        self._velocity = measured
        motion.fuse(measured)

    def _believed_speed(self, valid_us: int) -> float:
        """The vehicle's reported speed, else the speed of the fused positions."""
        if self._velocity is not None and abs(valid_us - self._velocity.valid_us) <= self._horizon_us:
            return math.hypot(*self._velocity.values[:2])
        return 0.0 if self._motion is None else math.hypot(*self._motion.latest.speeds[:2])

    def _refuse(self, reason: str) -> None:
        self.rejected[reason] += 1
        self._reason = reason

    def _reanchor(self) -> None:
        """Keep the frame near the vehicle: over 2 km the tangent plane turns by a third of a milliradian."""
        frame, motion = self._frame, self._motion
        if frame is None or motion is None or math.hypot(*motion.latest.places[:2]) < _REANCHOR_M:
            return
        north, east, down = motion.latest.places
        self._frame = LocalFrame(*frame.from_ned(north, east, down))
        motion.move_origin((north, east, down))


def _variance(sd: float) -> float:
    """Of a standard deviation that a report may state in any size."""
    return min(max(sd, 0.01), _LARGEST_SD) ** 2
