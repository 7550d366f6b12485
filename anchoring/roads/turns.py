"""The way from one link to another at a crossing: left, right, straight, uturn (thesis 8.7.4).

The turn from arm a to arm b is the angle by which the heading changes, left positive, so that the turn back is its
negative: a left turn one way is a right turn the other way. Straight is what changes the heading by 15 degrees at most, or by less
than 45 where every other way into and out of the two arms turns by 10 degrees more. Back on the same link, or by 165
degrees and more, is a U-turn.
"""

import math
from collections.abc import Mapping
from typing import Final

from anchoring.roads.elements import Crossing, DirectedLink, RoadLink
from anchoring.roads.geometry import wrapped

LEFT, RIGHT, STRAIGHT, UTURN = "left", "right", "straight", "uturn"
TURNS: Final = (LEFT, RIGHT, STRAIGHT, UTURN)

_SURELY_STRAIGHT_RAD: Final = math.radians(15.0)
_STRAIGHT_RAD: Final = math.radians(45.0)
_CLEARLY_RAD: Final = math.radians(10.0)
_BACK_RAD: Final = math.radians(165.0)
_CHORD_M: Final = 15.0
"""The heading of an arm is that of this much of it, outside the crossing."""


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
        """What the thesis has as the state of a Link object: for each turn the pairs (crossing, other link)."""
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
        return all(
            min(abs(_turn(headings[one], angle)), abs(_turn(angle, headings[other]))) >= bent + _CLEARLY_RAD
            for arm, angle in headings.items()
            if arm not in {one, other}
        )

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
