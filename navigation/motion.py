"""Position and velocity of one vehicle as a Kalman filter that answers for the recent past.

State x = (north, east, down, v_north, v_east, v_down), metres and metres per second in a `LocalFrame`.
Between measurements the acceleration is what the inertial sensors say, plus white noise of density q [m^2/s^3]:

    F = [[I, dt I], [0, I]],  u = mean acceleration,  Q = q [[dt^3/3 I, dt^2/2 I], [dt^2/2 I, dt I]]

so predicting in one step or in several gives the same covariance. Measurements may come out of order: the last second
of states is kept, and a late one is fused where it belongs.

The two steps of the filter are written out: they are filterpy's, to the bit, but its package imports scipy.stats with
itself, 1.1 s of processor in the start of every platform.
"""

from collections import deque
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Vector: TypeAlias = NDArray[np.float64]
Acceleration: TypeAlias = Callable[[int, int], tuple[float, float, float] | None]

HISTORY_US = 1_000_000
HISTORY_STATES = 128
_UNKNOWN_SPEED_VARIANCE = 100.0
_IDENTITY = np.eye(6)
_PUSH_PLACE, _PUSH_SPEED = _IDENTITY[:, :3], _IDENTITY[:, 3:]
_SHIFT = np.eye(6, k=3)
_BETWEEN = _SHIFT + _SHIFT.T
_PLACES, _SPEEDS = np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]), np.diag([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])
_OBSERVE = {"position": (0, 1, 2), "level": (0, 1), "velocity": (3, 4, 5), "level velocity": (3, 4)}
_MATRICES = {kind: _IDENTITY[list(rows)] for kind, rows in _OBSERVE.items()}


class Measurement(NamedTuple):
    """What was measured of the state: `kind` names the rows; values and variances in their order."""

    valid_us: int
    kind: str
    values: tuple[float, ...]
    variances: tuple[float, ...]


class MotionState(NamedTuple):
    """Mean (6,) and covariance (6, 6) at one instant."""

    valid_us: int
    mean: Vector
    covariance: Vector


class _Steps(NamedTuple):
    """F (6, 6), Q (6, 6), and B (6, 3), which turns a mean acceleration into u."""

    transition: Vector
    noise: Vector
    push: Vector


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
        mean = np.zeros(6)
        mean[: len(start.values)] = start.values
        variances = [*start.variances, *[1e6] * (3 - len(start.variances)), *[_UNKNOWN_SPEED_VARIANCE] * 3]
        self._kept: deque[_Kept] = deque([_Kept(MotionState(start.valid_us, mean, np.diag(variances)), None)])

    @property
    def latest(self) -> MotionState:
        return self._kept[-1].state

    @property
    def oldest_us(self) -> int:
        """A measurement from before this instant can no longer be fused."""
        return self._kept[0].state.valid_us

    def at(self, valid_us: int) -> MotionState:
        """The state predicted to an instant from what was known up to it. ValueError before `oldest_us`."""
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

    def move_origin(self, shift_m: tuple[float, float, float]) -> None:
        """Express the motion about a point `shift_m` away, forgetting all but the latest state."""
        valid_us, mean, covariance = self.latest
        moved = mean.copy()
        moved[:3] -= shift_m
        self._kept = deque([_Kept(MotionState(valid_us, moved, covariance), None)])

    def _predicted(self, state: MotionState, valid_us: int) -> MotionState:
        if valid_us == state.valid_us:
            return state
        measured = self._acceleration(state.valid_us, valid_us)
        before = self._foreseen
        if before is not None and before[0] is state and before[1].valid_us == valid_us and before[2] == measured:
            return before[1]  # who asks whether a measurement fits asks for the same as who fuses it
        steps = _steps((valid_us - state.valid_us) / 1e6, self._densities[measured is not None])
        mean = steps.transition @ state.mean
        if measured is not None:
            mean = mean + steps.push @ np.array(measured)
        covariance = steps.transition @ state.covariance @ steps.transition.T + steps.noise
        foreseen = MotionState(valid_us, mean, covariance)
        self._foreseen = state, foreseen, measured
        return foreseen


def updated(state: MotionState, measurement: Measurement) -> MotionState:
    """The state with a measurement taken in; the covariance in Joseph's form."""
    observe, noise = _MATRICES[measurement.kind], _diagonal(measurement.variances)
    seen = state.covariance @ observe.T
    gain = seen @ np.linalg.inv(observe @ seen + noise)
    mean = state.mean + gain @ (np.array(measurement.values) - observe @ state.mean)
    kept = _IDENTITY - gain @ observe
    return MotionState(state.valid_us, mean, kept @ state.covariance @ kept.T + gain @ noise @ gain.T)


@lru_cache(maxsize=256)
def _steps(dt: float, density: float) -> _Steps:
    """The matrices of a prediction over `dt` seconds; most vehicles report in even steps."""
    noise = density * (dt**3 / 3 * _PLACES + dt * dt / 2 * _BETWEEN + dt * _SPEEDS)
    return _Steps(_IDENTITY + dt * _SHIFT, noise, dt * dt / 2 * _PUSH_PLACE + dt * _PUSH_SPEED)


@lru_cache(maxsize=256)
def _diagonal(variances: tuple[float, ...]) -> Vector:
    return np.diag(variances)
