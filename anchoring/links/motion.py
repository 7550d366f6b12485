"""Usual motion: how objects change their velocity, by their kind or by their speed, and how far apart they are.

`thresh` follows from that. Let S be the sum of the covariances of a position that is seen and of one that is expected, d what is
between both, and r the density, per square metre, of other things that could have come into view there. The position is more
likely that of the known object than of another as long as

    d^T S^-1 d < 2 ln(1 / (2 pi sqrt(det S) r))

and `thresh` is the length of the longest d of that direction. Where it is known too badly, in a crowd, for any distance to be
evidence, that is 0.
"""

from collections.abc import Iterable, Mapping, Sequence
from math import exp, log, pi, sqrt
from typing import Final, NamedTuple

import numpy as np

from dyknow import US_PER_S
from dyknow.anchoring.links.individuals import Individual
from dyknow.anchoring.links.prediction import ObjectPrediction, certain
from dyknow.anchoring.links.states import ObjectState, moved


class MotionKind(NamedTuple):
    """Things of one kind.

    Attributes:
        size_m: no two of them are nearer to each other, from middle to middle.
        least_noise, most_noise: densities of the acceleration noise, m^2/s^3, of one that stands and of one that is fast.
    """

    size_m: float
    least_noise: float
    most_noise: float


WALKER: Final = MotionKind(0.5, 0.04, 0.2)
BIKE: Final = MotionKind(1.8, 0.04, 1.5)
CAR: Final = MotionKind(4.5, 0.6, 4.0)
KINDS: Final[Mapping[str, MotionKind]] = {
    **dict.fromkeys(("walker", "pedestrian", "person"), WALKER),
    **dict.fromkeys(("bike", "bicycle", "biker", "cyclist", "skater"), BIKE),
    **dict.fromkeys(("car", "van", "truck", "bus", "vehicle"), CAR),
}
"""Kinds by the values of the attributes `kind` and `class` of a percept."""
_NAMING: Final = ("kind", "class")
_WALKS_M_S, _RIDES_M_S = 2.5, 7.0
_NOISE_BY_SPEED: Final = 0.02
"""Acceleration noise grows with the square of the speed, 1/s: a turn at 10 m/s changes the velocity more."""
_UNSEEN_SLOW, _UNSEEN_FAST, _FAST_NOISE = 0.7, 1.5, 0.5
"""Over seconds errors of steps are smaller than they accumulate, but what drives fast brakes and turns: of the noise of one step."""
LONELY_M: Final = 100.0
"""The distance to the next thing where nothing shows one."""
STRANGERS: Final = 0.35
"""The share of things that could be what comes into view without being known."""
_OFF: Final = 1.0 / 16.0
"""Share of the position's variance added in each direction: vehicles expected on a lane's centre drive off it."""
_SMOOTHED_S: Final = 1.0
_LOOKED_US: Final = 200_000
_MOST_COMPARED: Final = 64


def kind_of(state: ObjectState) -> MotionKind | None:
    """The kind that a state's attributes name; None: they name none."""
    if not state.attributes:
        return None
    named = (state.attributes.get(each) for each in _NAMING)
    return next((KINDS[each] for each in named if isinstance(each, str) and each in KINDS), None)


def noise_of(state: ObjectState, usual: Individual | None = None) -> float:
    """The density of the acceleration noise, m^2/s^3; an object that stands now, and drove before, may drive again."""
    least, most = (kind_of(state) or _ANYTHING)[1:]
    square = state.vx_m_s * state.vx_m_s + state.vy_m_s * state.vy_m_s
    if usual is not None:
        square = max(square, usual.square_speed)
    return min(most, max(least, _NOISE_BY_SPEED * square))


_ANYTHING: Final = MotionKind(0.5, WALKER.least_noise, CAR.most_noise)


def size_of(state: ObjectState) -> float:
    """The size in metres: of the kind in its attributes, else of the largest kind that is usually so slow."""
    if (kind := kind_of(state)) is not None:
        return kind.size_m
    speed_m_s = state.speed_m_s
    return (WALKER if speed_m_s < _WALKS_M_S else BIKE if speed_m_s < _RIDES_M_S else CAR).size_m


def loosened(expected: ObjectState) -> ObjectState:
    """The state, as uncertain of its place across the way that it is expected on as things drive off that."""
    covariance = expected.covariance.copy()
    off = _OFF * (covariance[0, 0] + covariance[1, 1])
    covariance[0, 0] += off
    covariance[1, 1] += off
    return expected._replace(covariance=covariance)


class MotionPredictor:
    """Straight on, as uncertain as things of this kind, or this fast, become."""

    def predict(
        self,
        history: Sequence[ObjectState],
        to_us: int,
        before: ObjectPrediction | None = None,  # noqa: ARG002
        individual: Individual | None = None,
    ) -> ObjectPrediction:
        last = history[-1]
        noise = noise_of(last, individual)
        return certain(moved(last, to_us, noise * (_UNSEEN_SLOW if noise < _FAST_NOISE else _UNSEEN_FAST)))


class Spacing:
    """How far apart things are that are seen together: the median of the distances to the next one, over about a second."""

    def __init__(self) -> None:
        self._log_m: float | None = None
        self._latest_us = 0

    def on_states(self, valid_us: int, states: Sequence[ObjectState]) -> None:
        """Take what is seen at one time; fewer than two do not count."""
        if len(states) < 2 or (self._log_m is not None and valid_us - self._latest_us < _LOOKED_US):
            return
        seen_log_m = log(max(_ANYTHING.size_m / 4.0, _median_apart_m(np.array([each[1:3] for each in states]))))
        share = 1.0 if self._log_m is None else 1.0 - exp((self._latest_us - valid_us) / US_PER_S / _SMOOTHED_S)
        before = seen_log_m if self._log_m is None else self._log_m
        self._log_m, self._latest_us = before + share * (seen_log_m - before), valid_us

    @property
    def apart_m(self) -> float:
        """The usual distance to the next thing."""
        return LONELY_M if self._log_m is None else exp(self._log_m)

    def density(self, expected: ObjectState) -> float:
        """Of others that could come into view there, per square metre."""
        return STRANGERS / (2.0 * max(self.apart_m, size_of(expected))) ** 2

    def reach_m(self, seen: ObjectState, expected: ObjectState, most_m: float) -> float:
        """How far apart they may be, in the direction in which they are, to be the same."""
        (xx, xy), (yx, yy) = (seen.covariance[:2, :2] + expected.covariance[:2, :2]).tolist()
        off = _OFF * (xx + yy)
        xx, yy = xx + off, yy + off
        determinant = xx * yy - xy * yx
        evidence = self._evidence(determinant, expected)
        dx, dy = seen.x_m - expected.x_m, seen.y_m - expected.y_m
        apart = yy * dx * dx - (xy + yx) * dx * dy + xx * dy * dy
        if evidence <= 0.0:
            return 0.0
        if apart <= 0.0:
            return most_m
        return min(most_m, sqrt(2.0 * evidence * determinant * (dx * dx + dy * dy) / apart))

    def most_m(self, seen: Iterable[ObjectState], expected: Iterable[ObjectState], most_m: float) -> float:
        """An upper bound of `reach_m` for any two of them."""
        largest = max((each.covariance[0, 0] + each.covariance[1, 1] for each in seen), default=0.0)
        found = 0.0
        for each in expected:
            (xx, xy), (yx, yy) = each.covariance[:2, :2].tolist()
            off = _OFF * (xx + yy)
            xx, yy = xx + off, yy + off
            evidence = self._evidence(max(0.0, xx * yy - xy * yx), each)
            found = max(found, 2.0 * evidence * (xx + yy + largest))
        return min(most_m, sqrt(found) * 1.001)

    def _evidence(self, determinant: float, expected: ObjectState) -> float:
        """The logarithm of how much more likely the very place is than anywhere else."""
        return -log(max(1e-12, 2.0 * pi * sqrt(max(0.0, determinant)) * self.density(expected)))


def _median_apart_m(places: np.ndarray[tuple[int, int], np.dtype[np.float64]]) -> float:
    if len(places) > _MOST_COMPARED:
        from scipy.spatial import KDTree

        return float(np.median(KDTree(places).query(places, k=2)[0][:, 1]))
    apart = places[:, None, :] - places[None, :, :]
    squares = np.einsum("ijk,ijk->ij", apart, apart)
    np.fill_diagonal(squares, np.inf)
    return float(np.sqrt(sorted(squares.min(axis=1).tolist())[len(places) // 2]))
