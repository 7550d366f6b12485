"""The way from one link to another at a crossing: left, right, straight, uturn (thesis 8.7.4), and the curve that is driven.

The turn from arm a to arm b is the angle by which the heading changes, left positive, so that the turn back is its
negative: where lanes lead both ways, a left turn one way is a right turn the other way. Straight is what changes the heading by 15
degrees at most, or by less than 45 where every other way into and out of the two arms, in which a lane leads, turns by 10 degrees
more. Back on the same link, or by 165 degrees and more, is a U-turn.

The curve leaves the lane of the one link where the crossing begins, and reaches that of the next where it ends, along their
headings: a cubic Bezier curve that is a quarter of a circle where the way turns by a right angle. It is shorter than the two
links to the middle of the crossing, so that a vehicle that turns is through it sooner.
"""

import math
from collections.abc import Mapping
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from dyknow.anchoring.roads.elements import Crossing, DirectedLink, RoadLink
from dyknow.anchoring.roads.geometry import Polyline, wrapped

LEFT, RIGHT, STRAIGHT, UTURN = "left", "right", "straight", "uturn"
TURNS: Final = (LEFT, RIGHT, STRAIGHT, UTURN)

_SURELY_STRAIGHT_RAD: Final = math.radians(15.0)
_STRAIGHT_RAD: Final = math.radians(45.0)
_CLEARLY_RAD: Final = math.radians(10.0)
_BACK_RAD: Final = math.radians(165.0)
_CHORD_M: Final = 15.0
"""The heading of an arm is that of this much of it, outside the crossing."""
COMFORT_M_S2: Final = 3.0
_PIECES: Final = 12
_LEAST_M: Final = 0.5
"""A curve between ends that are nearer is none."""
_Pose: TypeAlias = tuple[float, float, float]


class RoadTurns:
    """The turns at every crossing; those of a crossing are worked out when they are first wanted.

    Args:
        arms: for each crossing the ends of links there, in the direction that leads away.
    """

    def __init__(
        self,
        links: Mapping[str, RoadLink],
        crossings: Mapping[str, Crossing],
        arms: Mapping[str, tuple[DirectedLink, ...]],
    ) -> None:
        self._links, self._crossings, self._arms = links, crossings, arms
        self._headings: dict[str, dict[DirectedLink, float]] = {}
        self._exits: dict[DirectedLink, Mapping[DirectedLink, str]] = {}

    def angle_rad(self, crossing: str, arrived: DirectedLink, departed: DirectedLink) -> float:
        """By how much the heading changes, left positive, in (-pi, pi]; the same link back is pi.

        Raises:
            KeyError: one of them is not at the crossing.
        """
        headings = self._headings_at(crossing)
        return _turn(headings[arrived.back], headings[departed])

    def relation(self, arrived: DirectedLink, departed: DirectedLink) -> str | None:
        """One of `TURNS`, whether lanes lead that way or not; None if the links do not meet so."""
        crossing = self._links[arrived.link].crossing_at(arrived.direction)
        if crossing is None or departed not in self._arms[crossing]:
            return None
        return self._relation(self._headings_at(crossing), arrived.back, departed)

    def relation_of(self, one: str, crossing: str, other: str) -> str | None:
        """The turn from link to link through a crossing, whichever ends of them are there; None if there is none.

        Of a link with both ends at the crossing the first end counts.
        """
        arms = {arm.link: arm for arm in reversed(self._arms.get(crossing, ()))}
        if one not in arms or other not in arms:
            return None
        return self._relation(self._headings_at(crossing), arms[one], arms[other])

    def exits(self, arrived: DirectedLink) -> Mapping[DirectedLink, str]:
        """The links that follow at the end of a link, with the turn: U-turns only at dead ends."""
        known = self._exits.get(arrived)
        if known is None:
            known = self._exits[arrived] = self._exits_of(arrived)
        return known

    def _exits_of(self, arrived: DirectedLink) -> Mapping[DirectedLink, str]:
        crossing = self._links[arrived.link].crossing_at(arrived.direction)
        arms = (arrived.back,) if crossing is None else self._arms[crossing]
        leading = [arm for arm in arms if arm.direction in self._links[arm.link].directions]
        if crossing is None:
            return dict.fromkeys(leading, UTURN)
        headings = self._headings_at(crossing)
        ways = {arm: self._relation(headings, arrived.back, arm) for arm in leading}
        return {arm: way for arm, way in ways.items() if way != UTURN} or ways

    def attributes(self, link: str) -> dict[str, tuple[tuple[str, str], ...]]:
        """The state of a Link object in the thesis: for each turn the pairs (crossing, other link)."""
        found: dict[str, list[tuple[str, str]]] = {turn: [] for turn in TURNS}
        for direction in self._links[link].directions:
            crossing = self._links[link].crossing_at(direction)
            for arm in () if crossing is None else self._arms[crossing]:
                way = self.relation(DirectedLink(link, direction), arm)
                if crossing is not None and way is not None and arm.direction in self._links[arm.link].directions:
                    found[way].append((crossing, arm.link))
        return {turn: tuple(pairs) for turn, pairs in found.items()}

    def _relation(self, headings: Mapping[DirectedLink, float], one: DirectedLink, other: DirectedLink) -> str:
        """The turn between two arms, from their headings away from the crossing."""
        turn = _turn(headings[one], headings[other])
        bent = abs(turn)
        if one == other or bent >= _BACK_RAD:
            return UTURN
        if bent <= _SURELY_STRAIGHT_RAD or (bent < _STRAIGHT_RAD and self._is_straightest(headings, one, other, bent)):
            return STRAIGHT
        return LEFT if turn > 0.0 else RIGHT

    def _is_straightest(
        self, headings: Mapping[DirectedLink, float], one: DirectedLink, other: DirectedLink, bent: float
    ) -> bool:
        least_rad = bent + _CLEARLY_RAD
        return all(
            (abs(_turn(headings[one], angle)) >= least_rad or not self._leads(arm))
            and (abs(_turn(angle, headings[other])) >= least_rad or not self._leads(arm.back))
            for arm, angle in headings.items()
            if arm not in {one, other}
        )

    def _leads(self, way: DirectedLink) -> bool:
        """Whether there is a lane in this direction: the way back of an edge of SUMO is a link next to it."""
        return way.direction in self._links[way.link].directions

    def _headings_at(self, name: str) -> Mapping[DirectedLink, float]:
        known = self._headings.get(name)
        if known is None:
            crossing = self._crossings[name]
            known = self._headings[name] = {arm: self._away_rad(arm, crossing.radius_m) for arm in self._arms[name]}
        return known

    def _away_rad(self, arm: DirectedLink, radius_m: float) -> float:
        """The heading of an arm away from its crossing."""
        link = self._links[arm.link]
        near_m = min(radius_m, link.length_m / 3)
        far_m = min(near_m + _CHORD_M, link.length_m)
        if arm.direction > 0:
            return link.line.heading_rad(near_m, far_m)
        return link.line.heading_rad(link.length_m - near_m, link.length_m - far_m)


def _turn(one_rad: float, other_rad: float) -> float:
    """From the arm with the first heading to that with the other; an odd function of their difference."""
    apart = other_rad - one_rad
    return wrapped(apart - math.pi if apart > 0.0 else apart + math.pi)


class CrossingPath(NamedTuple):
    """The way from one lane to another.

    Attributes:
        before_m, after_m: how much of the link before it, and of the one after it, it stands for.
    """

    line: Polyline
    before_m: float
    after_m: float

    @property
    def per_m(self) -> float:
        """How much of the two links a metre of the curve stands for."""
        return (self.before_m + self.after_m) / self.line.length_m

    @property
    def comfortable_m_s(self) -> float:
        """The speed at which one is pushed aside by `COMFORT_M_S2`, as if it were an arc; endless where it is straight."""
        turned_rad = abs(wrapped(self.line.at(self.line.length_m)[2] - self.line.at(0.0)[2]))
        return math.sqrt(COMFORT_M_S2 * self.line.length_m / turned_rad) if turned_rad > 0.0 else math.inf

    def at(self, travelled_m: float) -> _Pose:
        """(x_m, y_m, heading_rad) where so much of the link after it is travelled; before it that is negative."""
        return self.line.at((travelled_m + self.before_m) / self.per_m)

    def nearest(self, x_m: float, y_m: float) -> tuple[float, float, float]:
        """The distance travelled at the nearest place of the curve, the distance to that place, and its heading."""
        found = self.line.project(x_m, y_m)
        return found.offset_m * self.per_m - self.before_m, abs(found.across_m), found.heading_rad


class CrossingPaths:
    """The curves of a network; each is made when it is first wanted."""

    def __init__(self, links: Mapping[str, RoadLink], crossings: Mapping[str, Crossing], turns: RoadTurns) -> None:
        self._links, self._crossings, self._turns = links, crossings, turns
        self._known: dict[tuple[DirectedLink, DirectedLink, int], CrossingPath | None] = {}
        self._begins: dict[DirectedLink, float] = {}

    def begins_m(self, way: DirectedLink) -> float:
        """How far before the end of a link the crossing begins that it leads into; 0 where it leads back."""
        known = self._begins.get(way)
        if known is None:
            turns = self._turns.exits(way).values()
            leads_on = any(turn != UTURN for turn in turns)
            known = self._begins[way] = self._reach_m(way, way.direction) if leads_on else 0.0
        return known

    def through(self, via: DirectedLink | None, way: DirectedLink, lane: int) -> CrossingPath | None:
        """From the link before to a lane of the next one; None where they do not follow each other, or lead back."""
        if via is None:
            return None
        key = via, way, lane
        if key not in self._known:
            self._known[key] = self._made(via, way, lane)
        return self._known[key]

    def _made(self, via: DirectedLink, way: DirectedLink, lane: int) -> CrossingPath | None:
        if self._turns.exits(via).get(way, UTURN) == UTURN:
            return None
        before, after = self._links[via.link], self._links[way.link]
        before_m, after_m = self.begins_m(via), self._reach_m(way, -way.direction)
        aside_m = after.lanes[lane].offset_m
        lane_before = before.lane_near(aside_m if via.direction == way.direction else -aside_m, via.direction)
        start = _pose(before, via.direction, before.length_m - before_m, before.lanes[lane_before].offset_m)
        end = _pose(after, way.direction, after_m, aside_m)
        if math.dist(start[:2], end[:2]) < _LEAST_M:
            return None
        return CrossingPath(_curve(start, end), before_m, after_m)

    def _reach_m(self, way: DirectedLink, direction: int) -> float:
        """How much of a link is in the crossing to which one direction leads."""
        link = self._links[way.link]
        name = link.crossing_at(direction)
        return 0.0 if name is None else min(self._crossings[name].radius_m, link.length_m / 2.0)


def _pose(link: RoadLink, direction: int, travelled_m: float, aside_m: float) -> _Pose:
    x_m, y_m, line_rad = link.line.at(travelled_m if direction > 0 else link.length_m - travelled_m, aside_m)
    return x_m, y_m, line_rad + (0.0 if direction > 0 else math.pi)


def _curve(start: _Pose, end: _Pose) -> Polyline:
    """A cubic Bezier curve whose handles are those of a circle for the angle between the headings."""
    turned_rad = wrapped(end[2] - start[2])
    reach_m = math.dist(start[:2], end[:2]) / (3.0 * math.cos(turned_rad / 4.0) ** 2)
    xs = np.array([start[0], start[0] + reach_m * math.cos(start[2]), end[0] - reach_m * math.cos(end[2]), end[0]])
    ys = np.array([start[1], start[1] + reach_m * math.sin(start[2]), end[1] - reach_m * math.sin(end[2]), end[1]])
    shares = np.linspace(0.0, 1.0, _PIECES + 1)
    weights = np.array([(1 - shares) ** 3, 3 * shares * (1 - shares) ** 2, 3 * shares**2 * (1 - shares), shares**3])
    return Polyline(list(zip((xs @ weights).tolist(), (ys @ weights).tolist(), strict=True)))
