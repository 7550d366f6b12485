"""Position and velocity of one vehicle as a Kalman filter that answers for the recent past.

State x = (north, east, down, v_north, v_east, v_down), metres and metres per second in a `LocalFrame`. Between
measurements the acceleration is what the inertial sensors say, plus white noise of density q [m^2/s^3]. The axes are
independent, both in the motion and in the measurements, so each is a filter of two numbers of its own:

    F = [[1, dt], [0, 1]],  u = mean acceleration (dt^2/2, dt),  Q = q [[dt^3/3, dt^2/2], [dt^2/2, dt]]

and predicting in one step or in several gives the same covariance. Measurements may come out of order: the last second
of states is kept, and a late one is fused where it belongs.

The steps are written out in plain numbers: they are those of filterpy over six, within rounding, in a third of the time;
every vehicle takes some thirty of them a second.
"""

from collections import deque
from collections.abc import Callable
from typing import NamedTuple, TypeAlias

Acceleration: TypeAlias = Callable[[int, int], tuple[float, float, float] | None]

HISTORY_US = 1_000_000
HISTORY_STATES = 128
_UNKNOWN_SPEED_VARIANCE = 100.0
_UNMEASURED_VARIANCE = 1e6
_SPEEDS = frozenset({"velocity", "level velocity"})


class Measurement(NamedTuple):
    """A measurement of the state: places (`position`, `level`) or speeds (`velocity`, `level velocity`).

    Values and variances are those of north, east and, unless it is level, down.
    """

    valid_us: int
    kind: str
    values: tuple[float, ...]
    variances: tuple[float, ...]


class Axis(NamedTuple):
    """Place and speed along one axis, m and m/s, and their covariance."""

    place: float
    speed: float
    var_place: float
    between: float
    var_speed: float

    def after(self, dt: float, acceleration: float, density: float) -> "Axis":
        """Predicted `dt` seconds on."""
        place, speed, var_place, between, var_speed = self
        grown = dt * var_speed
        return Axis(
            place + dt * (speed + 0.5 * dt * acceleration),
            speed + dt * acceleration,
            var_place + dt * (2.0 * between + grown) + density * dt * dt * dt / 3.0,
            between + grown + 0.5 * density * dt * dt,
            var_speed + density * dt,
        )

    def placed(self, value: float, variance: float) -> "Axis":
        """With a measured place taken in; the covariance in Joseph's form."""
        place, speed, var_place, between, var_speed = self
        k, m = var_place / (var_place + variance), between / (var_place + variance)
        off, kept = value - place, 1.0 - k
        return Axis(
            place + k * off,
            speed + m * off,
            kept * kept * var_place + k * k * variance,
            kept * (between - m * var_place) + k * m * variance,
            var_speed - m * (2.0 * between - m * var_place) + m * m * variance,
        )

    def moving(self, value: float, variance: float) -> "Axis":
        """With a measured speed taken in; the covariance in Joseph's form."""
        place, speed, var_place, between, var_speed = self
        k, m = between / (var_speed + variance), var_speed / (var_speed + variance)
        off, kept = value - speed, 1.0 - m
        return Axis(
            place + k * off,
            speed + m * off,
            var_place - k * (2.0 * between - k * var_speed) + k * k * variance,
            kept * (between - k * var_speed) + k * m * variance,
            kept * kept * var_speed + m * m * variance,
        )


class MotionState(NamedTuple):
    """The axes north, east and down at one instant."""

    valid_us: int
    axes: tuple[Axis, ...]

    @property
    def places(self) -> tuple[float, ...]:
        return tuple([axis.place for axis in self.axes])

    @property
    def speeds(self) -> tuple[float, ...]:
        return tuple([axis.speed for axis in self.axes])


class _Kept(NamedTuple):
    state: MotionState
    measurement: Measurement | None


class Motion:
    """A Kalman filter with a memory.

    Args:
        start: the first position measurement; its rows set the first state, velocity is unknown (10 m/s).
        acceleration: mean of the measured acceleration (NED, m/s^2) between two instants, or None where there is none.
        densities: acceleration noise density in m^2/s^3 without and with measured acceleration.
    """

    def __init__(self, start: Measurement, acceleration: Acceleration, densities: tuple[float, float]) -> None:
        self._acceleration, self._densities = acceleration, densities
        self._foreseen: tuple[MotionState, MotionState, tuple[float, float, float] | None] | None = None
        known = zip(start.values, start.variances, strict=True)
        axes = [Axis(place, 0.0, variance, 0.0, _UNKNOWN_SPEED_VARIANCE) for place, variance in known]
        axes += [Axis(0.0, 0.0, _UNMEASURED_VARIANCE, 0.0, _UNKNOWN_SPEED_VARIANCE)] * (3 - len(axes))
        self._kept: deque[_Kept] = deque([_Kept(MotionState(start.valid_us, tuple(axes)), None)])

    @property
    def latest(self) -> MotionState:
        return self._kept[-1].state

    @property
    def oldest_us(self) -> int:
        """A measurement from before this instant can no longer be fused."""
        return self._kept[0].state.valid_us

    def at(self, valid_us: int) -> MotionState:
        """The state predicted to an instant from the states up to it. ValueError before `oldest_us`."""
        for kept in reversed(self._kept):
            if kept.state.valid_us <= valid_us:
                return self._predicted(kept.state, valid_us)
        raise ValueError(f"the motion is known from {self.oldest_us} us on, not at {valid_us}")

    def fuse(self, measurement: Measurement) -> None:
        """Take a measurement in, at its place in time. ValueError when it is older than `oldest_us`."""
        if measurement.valid_us < self.oldest_us:
            raise ValueError(f"measured at {measurement.valid_us} us, the motion is known from {self.oldest_us} us on")
        later: list[Measurement] = []
        while self._kept[-1].state.valid_us > measurement.valid_us:
            undone = self._kept.pop().measurement
            if undone is not None:
                later.append(undone)
        for each in (measurement, *reversed(later)):
            self._kept.append(_Kept(updated(self._predicted(self.latest, each.valid_us), each), each))
        oldest_us = self.latest.valid_us - HISTORY_US
        while len(self._kept) > HISTORY_STATES or (len(self._kept) > 1 and self._kept[1].state.valid_us <= oldest_us):
            self._kept.popleft()

    def move_origin(self, shift_m: tuple[float, ...]) -> None:
        """Express the motion about a point `shift_m` away, forgetting all but the latest state."""
        valid_us, axes = self.latest
        moved = [axis._replace(place=axis.place - shift) for axis, shift in zip(axes, shift_m, strict=True)]
        self._kept = deque([_Kept(MotionState(valid_us, tuple(moved)), None)])

    def _predicted(self, state: MotionState, valid_us: int) -> MotionState:
        if valid_us == state.valid_us:
            return state
        measured = self._acceleration(state.valid_us, valid_us)
        before = self._foreseen
        if before is not None and before[0] is state and before[1].valid_us == valid_us and before[2] == measured:
            return before[1]  # who asks whether a measurement fits asks for the same as who fuses it
        dt, density = (valid_us - state.valid_us) / 1e6, self._densities[measured is not None]
        north, east, down = state.axes
        a, b, c = (0.0, 0.0, 0.0) if measured is None else measured
        axes = north.after(dt, a, density), east.after(dt, b, density), down.after(dt, c, density)
        foreseen = MotionState(valid_us, axes)
        self._foreseen = state, foreseen, measured
        return foreseen


def updated(state: MotionState, measurement: Measurement) -> MotionState:
    """The state with a measurement taken in."""
    take = Axis.moving if measurement.kind in _SPEEDS else Axis.placed
    measured = map(take, state.axes, measurement.values, measurement.variances)
    return MotionState(state.valid_us, (*measured, *state.axes[len(measurement.values) :]))
