"""Boxes as bodies that fall, bounce and slide: pure, stepped in 20 ms; the generator is an argument.

Places are metres east, north and up, of the middle of the lower side; the ground is level, at 0.
"""

from collections.abc import Callable
from math import hypot, sqrt
from typing import Final, NamedTuple, TypeAlias

from numpy.random import Generator

from dyknow.sim_uavs.dynamics.quadcopter import GRAVITY_M_S2

STEP_US: Final = 20_000
_STEP_S: Final = STEP_US / 1e6
_LONGEST_STEPS: Final = 1500
_RESTS_M_S: Final = 0.05
_BOUNCES_M_S: Final = 0.5
"""A body that meets the ground more slowly stays on it."""

Place: TypeAlias = tuple[float, float, float]


class BodyBuild(NamedTuple):
    """A kind of thing that can be lifted.

    Attributes:
        side_m: of its square.
        drag_per_m: deceleration in air, divided by the square of the airspeed.
        top_m: how high above its lower side the magnet takes hold.
        deck_m: how high above its lower side boxes stand on it.
        capacity: of boxes.
    """

    mass_kg: float
    side_m: float
    height_m: float
    drag_per_m: float
    top_m: float
    deck_m: float = 0.0
    capacity: int = 0


BOX: Final = BodyBuild(1.0, 0.8, 0.4, 0.29, 0.4)
CARRIER: Final = BodyBuild(1.5, 2.4, 0.2, 0.5, 0.8, deck_m=0.2, capacity=4)
BUILDS: Final = {"box": BOX, "carrier": CARRIER}


class Surface(NamedTuple):
    """The ground: which share of the speed is left after a bounce, friction, and how far off an impact throws an edge."""

    restitution: float = 0.3
    friction: float = 0.5
    tumble: float = 0.3


class Air(NamedTuple):
    """The wind: where it blows to, m/s."""

    east_m_s: float = 0.0
    north_m_s: float = 0.0


def fall(
    build: BodyBuild,
    place: Place,
    velocity: Place,
    rng: Generator,
    air: Air = Air(),  # noqa: B008  (immutable)
    surface: Surface = Surface(),  # noqa: B008  (immutable)
    caught: Callable[[Place], bool] = lambda _place: False,
) -> list[Place]:
    """Where a thing is that is let go: every 20 ms, from the first step until it lies still, or is `caught` on its way down."""
    (x, y, up), (vx, vy, vu) = place, velocity
    path: list[Place] = []
    while len(path) < _LONGEST_STEPS:
        if up > 0.0 or vu > 0.0:
            vx, vy, vu = _slowed(build, (vx, vy, vu), air)
        else:
            vx, vy, vu = _slid(vx, vy, surface)
        x, y, up = x + vx * _STEP_S, y + vy * _STEP_S, up + vu * _STEP_S
        if up <= 0.0 and vu < 0.0:
            up, (vx, vy, vu) = 0.0, _bounced(vx, vy, vu, surface, rng)
        path.append((x, y, up))
        if (vu < 0.0 and caught(path[-1])) or (up == 0.0 and vu == 0.0 and hypot(vx, vy) < _RESTS_M_S):
            break
    return path


def _slowed(build: BodyBuild, velocity: Place, air: Air) -> Place:
    """Gravity, and drag against the wind, which never turns the airspeed round within a step."""
    vx, vy, vu = velocity[0] - air.east_m_s, velocity[1] - air.north_m_s, velocity[2] - GRAVITY_M_S2 * _STEP_S
    keep = 1.0 / (1.0 + build.drag_per_m * sqrt(vx * vx + vy * vy + vu * vu) * _STEP_S)
    return vx * keep + air.east_m_s, vy * keep + air.north_m_s, vu * keep


def _slid(vx: float, vy: float, surface: Surface) -> Place:
    speed = hypot(vx, vy)
    left = max(0.0, speed - surface.friction * GRAVITY_M_S2 * _STEP_S)
    return (vx * left / speed, vy * left / speed, 0.0) if speed > 0.0 else (0.0, 0.0, 0.0)


def _bounced(vx: float, vy: float, vu: float, surface: Surface, rng: Generator) -> Place:
    """Up again with a share of the speed; the edge that meets the ground first throws it aside, friction slows it."""
    if -vu < _BOUNCES_M_S:
        return vx, vy, 0.0
    aside_x, aside_y = rng.normal(0.0, surface.tumble * -vu, 2).tolist()
    speed, lost = hypot(vx, vy), surface.friction * (1.0 + surface.restitution) * -vu
    keep = max(0.0, speed - lost) / speed if speed > 0.0 else 0.0
    return vx * keep + aside_x, vy * keep + aside_y, -vu * surface.restitution
