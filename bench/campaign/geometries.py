"""Ways that meet, drawn by chance. All meet about the place (0, 0), some seconds after setting out."""

from collections.abc import Callable
from math import cos, radians, sin
from random import Random

from bench.campaign import situations as ways
from bench.campaign.situations import ENDS_ON_GROUND, Way, are_apart
from dyknow.sim_uavs.dynamics.quadcopter import Vector

LOWEST_M, HIGHEST_M = 12.0, 117.0
LEVEL_KINDS = (
    ways.PLAN, ways.PLAN, ways.PLAN, ways.GOTO, ways.GOTO, ways.STATION, ways.STATION, ways.STREAMED, ways.AUTO,
    ways.AUTO_LEAVE, ways.AUTO_LEAVE, ways.RTL, ways.RTL_LEAVE,
)  # fmt: skip
"""Orders that have a vehicle fly level; RTL ends on the ground."""
_THROUGH = frozenset({ways.PLAN, ways.AUTO, ways.AUTO_LEAVE})
CLIMB_KINDS = (ways.PLAN, ways.GOTO, ways.STATION, ways.AUTO_LEAVE)
LAND_KINDS = (ways.LAND, ways.LAND, ways.LAND_LEAVE)
TRIES = 200


class Meeting:
    """Draws the ways of one run: where they meet, at which height, and when."""

    def __init__(self, random: Random) -> None:
        self.random = random
        self.height_m = random.uniform(20.0, 105.0)
        self.meets_s = random.uniform(10.0, 20.0)
        self.heading_deg = random.uniform(0.0, 360.0)

    def speed_m_s(self) -> float:
        low, high = self.random.choice(((1.0, 4.0), (4.0, 9.0), (4.0, 9.0), (9.0, 15.0)))
        return self.random.uniform(low, high)

    def aside(self, spread_m: float = 4.0) -> Vector:
        return Vector(self.random.uniform(-spread_m, spread_m), self.random.uniform(-spread_m, spread_m), 0.0)

    def level_m(self) -> float:
        """A height about that of the meeting."""
        height_m = self.height_m + self.random.choice((0.0, self.random.uniform(-8.0, 8.0)))
        return min(max(height_m, LOWEST_M), HIGHEST_M)

    def level(self, turn_deg: float, speed_m_s: float | None = None, kind: str | None = None) -> Way:
        """Level, over the place of the meeting, on a course that is turned by so much from the heading."""
        random = self.random
        speed_m_s = self.speed_m_s() if speed_m_s is None else speed_m_s
        kind = random.choice(LEVEL_KINDS) if kind is None else kind
        middle = self.aside()._replace(down=-self.level_m())
        course = _course(self.heading_deg + turn_deg)
        start = middle.plus(course, -speed_m_s * (self.meets_s + random.uniform(-1.0, 1.0)))
        onward = max(10.0, speed_m_s * random.uniform(8.0, 16.0))
        if kind in _THROUGH and random.random() < 0.3:
            bent = _course(self.heading_deg + turn_deg + random.uniform(-60.0, 60.0))
            return Way(kind, (start, middle, middle.plus(bent, onward)), speed_m_s)
        return Way(kind, (start, middle.plus(course, onward)), speed_m_s)

    def hover(self, height_m: float | None = None) -> Way:
        place = self.aside()._replace(down=-(self.level_m() if height_m is None else height_m))
        return Way(ways.HOVER, (place,), 5.0)

    def land(self, from_m: float) -> Way:
        start = self.aside(3.0)._replace(down=-from_m)
        return Way(self.random.choice(LAND_KINDS), (start, start._replace(down=0.0)), 5.0)

    def climb(self, from_m: float, to_m: float) -> Way:
        """Straight up, or down, at the place of the meeting."""
        start = self.aside(3.0)._replace(down=-from_m)
        return Way(self.random.choice(CLIMB_KINDS), (start, start._replace(down=-to_m)), 5.0)

    def other(self) -> Way:
        """One more vehicle, of any kind."""
        random = self.random
        match random.randrange(6):
            case 0:
                return self.hover(random.uniform(LOWEST_M, HIGHEST_M))
            case 1:
                return self.climb(random.uniform(12.0, 40.0), random.uniform(60.0, 110.0))
            case _:
                return self.level(random.uniform(0.0, 360.0))


def _course(heading_deg: float) -> Vector:
    return Vector(cos(radians(heading_deg)), sin(radians(heading_deg)), 0.0)


def _crossing(meeting: Meeting) -> list[Way]:
    return [meeting.level(0.0), meeting.level(meeting.random.choice((1, -1)) * meeting.random.uniform(40.0, 140.0))]


def _head_on(meeting: Meeting) -> list[Way]:
    return [meeting.level(0.0), meeting.level(180.0 + meeting.random.uniform(-8.0, 8.0))]


def _overtaking(meeting: Meeting) -> list[Way]:
    slow_m_s = meeting.random.uniform(1.0, 6.0)
    return [meeting.level(0.0, slow_m_s + meeting.random.uniform(4.0, 9.0)), meeting.level(0.0, slow_m_s)]


def _converging(meeting: Meeting) -> list[Way]:
    """Three or four from directions that are spread, at one point at one time."""
    count = meeting.random.choice((3, 3, 4))
    speed_m_s = meeting.random.uniform(5.0, 12.0)
    return [
        meeting.level(
            360.0 / count * at + meeting.random.uniform(-20.0, 20.0), speed_m_s + meeting.random.uniform(-1, 1)
        )
        for at in range(count)
    ]


def _stacked(meeting: Meeting) -> list[Way]:
    """Above each other; the uppermost comes down, or the lowest climbs, and one between stays or leaves."""
    low_m = meeting.random.uniform(14.0, 30.0)
    middle_m = low_m + meeting.random.uniform(22.0, 30.0)
    high_m = middle_m + meeting.random.uniform(22.0, 30.0)
    between = meeting.hover(middle_m)
    if meeting.random.random() < 0.5:
        return [meeting.land(high_m), between]
    return [meeting.climb(low_m, high_m + 5.0), between]


def _hovering(meeting: Meeting) -> list[Way]:
    return [meeting.level(0.0), meeting.hover()]


def _landing_over(meeting: Meeting) -> list[Way]:
    low_m = meeting.random.uniform(12.0, 60.0)
    return [meeting.land(min(low_m + meeting.random.uniform(22.0, 50.0), HIGHEST_M)), meeting.hover(low_m)]


def _climbing_through(meeting: Meeting) -> list[Way]:
    """One climbs, or sinks, through the level of another that comes over the place then."""
    rises_m = meeting.meets_s * meeting.random.uniform(1.5, 3.0)
    from_m = max(LOWEST_M, meeting.height_m - rises_m)
    to_m = min(HIGHEST_M, meeting.height_m + meeting.random.uniform(22.0, 40.0))
    ends = (from_m, to_m) if meeting.random.random() < 0.7 else (to_m, from_m)
    return [meeting.climb(*ends), meeting.level(0.0)]


_GEOMETRIES: dict[str, Callable[[Meeting], list[Way]]] = {
    "crossing": _crossing,
    "head-on": _head_on,
    "overtaking": _overtaking,
    "converging": _converging,
    "stacked": _stacked,
    "hovering in the way": _hovering,
    "landing over": _landing_over,
    "climbing through": _climbing_through,
}
GEOMETRIES = tuple(_GEOMETRIES)


def drawn_ways(random: Random, geometry: str, count: int) -> list[Way]:
    """The ways of `count` vehicles, or of as many as the geometry needs, that neither begin nor end near each other."""
    for _ in range(TRIES):
        meeting = Meeting(random)
        found = _GEOMETRIES[geometry](meeting)
        if not _is_apart(found):
            continue
        for _ in range(TRIES):
            if len(found) >= count:
                return found
            more = meeting.other()
            if _is_apart([*found, more]):
                found.append(more)
        return found
    raise ValueError(f"{geometry}: no ways were found that begin and end apart")


def _is_apart(found: list[Way]) -> bool:
    standing = [way.end for way in found if way.kind == ways.HOVER]
    starts = [way.start for way in found]
    ends = [way.end for way in found if way.kind not in ENDS_ON_GROUND]
    landed = [way.end for way in found if way.kind in ENDS_ON_GROUND]
    on_ground = all(a.minus(b).horizontal >= 20.0 for at, a in enumerate(landed) for b in landed[:at])
    return are_apart(starts) and are_apart(ends) and on_ground and len(standing) <= 3
