"""Where a dropped box comes to rest: mean and covariance, from height, speed, wind and ground (thesis 7.12). Pure."""

from collections.abc import Mapping
from math import hypot, isfinite, sqrt
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dyknow.model.errors import WrongCall

Floats = NDArray[np.float64]
GRAVITY_M_S2: Final = 9.80665
_STEP_S: Final = 0.02
_HIGHEST_M: Final = 1000.0
_FASTEST_M_S: Final = 100.0
_WIDEST: Final = 1000.0


class Drop(NamedTuple):
    """The known data of a drop: the place east and north of an origin, metres, and the height of the lower side above
    ground.

    Attributes:
        vx_m_s, vy_m_s: of the carrier, over ground.
        wind_x_m_s, wind_y_m_s: where it blows to.
        wind_sd_m_s: of each, as far as it is known.
        place_sd_m: of each coordinate; a box on a line swings.
        speed_sd_m_s: of each component.
        when_sd_s: of the instant.
    """

    x_m: float
    y_m: float
    height_m: float
    vx_m_s: float = 0.0
    vy_m_s: float = 0.0
    wind_x_m_s: float = 0.0
    wind_y_m_s: float = 0.0
    wind_sd_m_s: float = 2.0
    place_sd_m: float = 0.7
    speed_sd_m_s: float = 0.5
    when_sd_s: float = 0.2


class GroundKind(NamedTuple):
    """How a box stops on it: friction, and the standard deviation of how far it slides, per m/s with which it comes down."""

    friction: float
    scatter_s: float


GROUNDS: Final[Mapping[str, GroundKind]] = {
    "grass": GroundKind(0.5, 0.15),
    "asphalt": GroundKind(0.35, 0.3),
    "gravel": GroundKind(0.7, 0.12),
}


class BoxKind(NamedTuple):
    """How a box falls: deceleration in air over the square of the airspeed, and its relative standard deviation."""

    drag_per_m: float = 0.3
    drag_sd: float = 0.3


class LandingPrior(NamedTuple):
    """A normal distribution.

    Attributes:
        mean: (2,), metres east and north.
        covariance: (2, 2).
    """

    mean: Floats
    covariance: Floats


def landing(drop: Drop, ground: str = "grass", box: BoxKind | None = None) -> LandingPrior:
    """The distribution of its final place: the uncertainties of the drop are carried through the fall, one at a time.

    Raises:
        WrongCall: a number is none, or impossible; there is no such ground.
    """
    speeds, deviations = drop[3:7], drop[7:]
    is_one = all(map(isfinite, drop)) and 0.0 <= drop.height_m <= _HIGHEST_M
    if not is_one or max(map(abs, speeds)) > _FASTEST_M_S or not 0.0 <= min(deviations) <= max(deviations) <= _WIDEST:
        raise WrongCall(
            f"{drop} is no drop; the height must be 0 to {_HIGHEST_M:.0f} m, "
            f"speeds up to {_FASTEST_M_S:.0f} m/s, and deviations 0 to {_WIDEST:.0f}"
        )
    if ground not in GROUNDS:
        raise WrongCall(f"there is no ground {ground!r}; there are {', '.join(sorted(GROUNDS))}")
    kind, falls = GROUNDS[ground], box or BoxKind()
    unsure = {
        "vx_m_s": drop.speed_sd_m_s,
        "vy_m_s": drop.speed_sd_m_s,
        "wind_x_m_s": drop.wind_sd_m_s,
        "wind_y_m_s": drop.wind_sd_m_s,
    }
    middle, speed_m_s = _rest(drop, kind, falls.drag_per_m)
    spread = [
        (_rest(drop._replace(**{name: getattr(drop, name) + sign * sd}), kind, falls.drag_per_m)[0] - middle)
        / sqrt(2.0)
        for name, sd in unsure.items()
        for sign in (1.0, -1.0)
    ]
    spread.append(_rest(drop, kind, falls.drag_per_m * (1.0 + falls.drag_sd))[0] - middle)
    spread.append(np.array([drop.vx_m_s, drop.vy_m_s]) * drop.when_sd_s)
    round_m = hypot(drop.place_sd_m, kind.scatter_s * speed_m_s)
    covariance = sum((np.outer(each, each) for each in spread), round_m**2 * np.eye(2))
    return LandingPrior(middle, covariance)


def _rest(drop: Drop, ground: GroundKind, drag_per_m: float) -> tuple[Floats, float]:
    """Where it stops, (2,), and with what speed it met the ground."""
    x, y, up = drop.x_m, drop.y_m, drop.height_m
    vx, vy, vu = drop.vx_m_s - drop.wind_x_m_s, drop.vy_m_s - drop.wind_y_m_s, 0.0
    while up > 0.0:
        vu -= GRAVITY_M_S2 * _STEP_S
        keep = 1.0 / (1.0 + drag_per_m * (vx * vx + vy * vy + vu * vu) ** 0.5 * _STEP_S)
        vx, vy, vu = vx * keep, vy * keep, vu * keep
        step_s = min(_STEP_S, up / -vu)
        x, y = x + (vx + drop.wind_x_m_s) * step_s, y + (vy + drop.wind_y_m_s) * step_s
        up = up + vu * step_s if step_s == _STEP_S else 0.0
    vx, vy = vx + drop.wind_x_m_s, vy + drop.wind_y_m_s
    speed = hypot(vx, vy)
    left = max(0.0, speed - ground.friction * -vu)
    slides_m = left * left / (2.0 * ground.friction * GRAVITY_M_S2)
    share = slides_m / speed if speed > 0.0 else 0.0
    return np.array([x + share * vx, y + share * vy]), hypot(speed, vu)
