"""What bounds a drawn vehicle: a fence of its autopilot, a ceiling, and what the autopilot does when its link is lost.

Each bound leaves the vehicle its own way; how it may make room is what it bounds.
"""

from math import cos, hypot, radians, sin
from random import Random

from bench.campaign import situations as ways
from bench.campaign.situations import DrawnVehicle, Way
from dyknow.agents.places import FlightLimits
from dyknow.navigation.fences import FenceArea, FenceKind
from dyknow.navigation.geodesy import LocalFrame
from dyknow.sim_uavs.dynamics.quadcopter import Vector
from dyknow.sim_uavs.dynamics.scenarios import ORIGIN
from dyknow.sim_uavs.dynamics.settings import FENCE_AREAS, FENCE_HIGHEST, FENCE_RADIUS

_FRAME = LocalFrame(*ORIGIN)
_OUR_STATION, _OTHER_STATION = 254.0, 255.0
_TRIES = 20
HOVERS_ASIDE_M = 20.0
"""One that hovers cannot get out of the way of another one within a fence of less than that around it."""
ROOM_M = 35.0
"""So much room is left on one side of a way, between areas that do not hem the vehicle in."""


def bounded(random: Random, drawn: DrawnVehicle) -> DrawnVehicle:
    """The vehicle with what bounds it."""
    way, settings = drawn.way, drawn.settings
    _draw_failsafe(random, drawn)
    if way.kind in {ways.RTL, ways.RTL_LEAVE}:
        settings.return_m = way.highest_m
    bound = random.random()
    if bound < 0.12:
        _switch_on(random, drawn, FENCE_HIGHEST)
        settings.fence_highest_m = way.highest_m + random.uniform(3.0, 25.0)
    elif bound < 0.18:
        far_m = max(place.minus(drawn.way.start).horizontal for place in way.places)
        _switch_on(random, drawn, FENCE_RADIUS)
        settings.fence_radius_m = far_m + random.uniform(5.0, 60.0)
        if way.kind == ways.HOVER and settings.fence_radius_m < HOVERS_ASIDE_M:
            return drawn._replace(is_hemmed=True)
    elif bound < 0.28:
        ceiling_m = min(FlightLimits().ceiling_m, way.highest_m + random.uniform(1.0, 15.0))
        return drawn._replace(flight_limits=FlightLimits(ceiling_m=ceiling_m))
    elif bound < 0.42:
        is_hemmed = random.random() < 0.2
        sides = _Sides(random, way, is_hemmed=is_hemmed)
        areas = [sides.polygon()] if is_hemmed or random.random() < 0.6 else []
        areas += filter(None, [sides.circle() for _ in range(random.choice((0, 1, 2) if areas else (1, 2)))])
        if areas:
            _switch_on(random, drawn, FENCE_AREAS)
        return drawn._replace(fence=tuple(areas), is_hemmed=is_hemmed)
    return drawn


def _draw_failsafe(random: Random, drawn: DrawnVehicle) -> None:
    """For some, what the autopilot does without its ground station, by the parameters of its maker."""
    settings = drawn.settings
    if random.random() >= 0.4:
        return
    settings.return_m = random.uniform(15.0, 60.0)
    if drawn.persona == "px4":
        settings.link_loss_action = random.choice((1.0, 2.0, 3.0))
        settings.link_loss_s, settings.link_loss_wait_s = random.choice((5.0, 10.0)), random.choice((0.0, 5.0))
        return
    settings.link_loss_action = random.choice((1.0, 2.0, 3.0, 4.0, 5.0))
    settings.link_loss_s = random.choice((2.0, 5.0, 5.0, 10.0))
    settings.link_loss_options = random.choice((0.0, 0.0, 2.0, 8.0))
    settings.station_id = random.choice((_OUR_STATION, _OUR_STATION, _OUR_STATION, _OTHER_STATION))


def _switch_on(random: Random, drawn: DrawnVehicle, kind: int) -> None:
    """PX4 has no kinds: a bound of 0 m is none there; what it does outside is its parameter."""
    settings = drawn.settings
    settings.fence_on, settings.fence_kinds = 1.0, float(kind)
    if drawn.persona == "px4":
        settings.fence_on = random.choice((1.0, 2.0, 3.0))
        settings.fence_highest_m = settings.fence_radius_m = 0.0


# -- areas -----------------------------------------------------------------------------------------------------


class _Sides:
    """Which side of a way has room, and which has the bound: metres along the way, and across it to the left or right.

    Args:
        is_hemmed: whether there may be no room on either side.
    """

    def __init__(self, random: Random, way: Way, *, is_hemmed: bool) -> None:
        self._random, self._way = random, way
        ahead = way.places[-1].minus(way.start)
        length_m = ahead.horizontal
        self._along = Vector(ahead.north / length_m, ahead.east / length_m, 0.0) if length_m > 1.0 else _course(random)
        sign = random.choice((1.0, -1.0))
        self._aside = Vector(-sign * self._along.east, sign * self._along.north, 0.0)
        self._room_m = random.uniform(10.0, 50.0) if is_hemmed else random.uniform(ROOM_M, 80.0)

    def polygon(self) -> FenceArea:
        """A quadrangle that has the way in it."""
        random, along, aside, start = self._random, self._along, self._aside, self._way.start
        places = [place.minus(start) for place in self._way.places]
        far = [each.north * along.north + each.east * along.east for each in places]
        wide = [each.north * aside.north + each.east * aside.east for each in places]
        ends = min(far) - random.uniform(12.0, 50.0), max(far) + random.uniform(12.0, 50.0)
        sides = min(wide) - self._room_m, max(wide) + random.uniform(10.0, 50.0)
        corners = [(ends[0], sides[0]), (ends[1], sides[0]), (ends[1], sides[1]), (ends[0], sides[1])]
        points = [start.plus(along, far_m).plus(aside, wide_m) for far_m, wide_m in corners]
        return FenceArea(FenceKind.INCLUSION, tuple(_FRAME.from_ned(*point)[:2] for point in points))

    def circle(self) -> FenceArea | None:
        """A circle to stay out of, on the bounded side; None: none was found that the way does not cross."""
        random = self._random
        for _ in range(_TRIES):
            at, radius_m = random.choice(self._way.places), random.uniform(8.0, 40.0)
            away = self._aside.plus(self._along, random.uniform(-1.0, 1.0))
            centre = at.plus(away, (radius_m + random.uniform(8.0, 40.0)) / away.horizontal)
            if _nearest_m(centre, self._way) >= radius_m + 8.0:
                return FenceArea(FenceKind.EXCLUSION, (), _FRAME.from_ned(*centre)[:2], radius_m)
        return None


def _course(random: Random) -> Vector:
    heading_rad = radians(random.uniform(0.0, 360.0))
    return Vector(cos(heading_rad), sin(heading_rad), 0.0)


def _nearest_m(point: Vector, way: Way) -> float:
    """How near the way comes to a point, seen from above."""
    found = [point.minus(way.start).horizontal]
    for begin, end in zip(way.places, way.places[1:], strict=False):
        leg, here = end.minus(begin), point.minus(begin)
        length_2 = leg.north**2 + leg.east**2
        share = (leg.north * here.north + leg.east * here.east) / length_2 if length_2 else 0.0
        share = min(1.0, max(0.0, share))
        found.append(hypot(here.north - share * leg.north, here.east - share * leg.east))
    return min(found)
