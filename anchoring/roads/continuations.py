"""Where a road continues from one link in the next: a map cuts it wherever its name, its limit or its lanes change.

At the end of a link the road continues in the only link that follows, if nothing else leads into that and it does not turn back. It continues past
entrances and exits as well: in the link with as many lanes, or else the straightest, as long as all other links there have one way
and lie along the road, within 45 degrees. Where a road is crossed, or a street of two ways begins, is a crossing: no road continues there.
"""

from collections.abc import Iterator, Mapping
from functools import cached_property
from math import radians
from typing import Final

from dyknow.anchoring.roads.elements import DirectedLink, RoadLink
from dyknow.anchoring.roads.turns import UTURN, RoadTurns

_ALONG_RAD: Final = radians(45.0)
_ACROSS_RAD: Final = radians(135.0)
REACH_M: Final = 200.0
"""Links of a road that are farther apart are not related."""


class RoadContinuations:
    """The links of a network that are one road, by their names in specifications; each is worked out when it is first wanted."""

    def __init__(
        self,
        links: Mapping[str, RoadLink],
        arms: Mapping[str, tuple[DirectedLink, ...]],
        turns: RoadTurns,
        names: Mapping[str, str],
    ) -> None:
        self._links, self._arms, self._turns, self._names = links, arms, turns, names
        self._after: dict[DirectedLink, DirectedLink | None] = {}
        self._around: dict[str, frozenset[str]] = {}
        self._through: dict[tuple[str, str], str | None] = {}

    @cached_property
    def _ids(self) -> Mapping[str, str]:
        return {self._names[id_]: id_ for id_ in (*self._links, *self._arms)}

    def is_one(self, one: str, other: str) -> bool:
        """Whether two links are parts of one road, at most 200 m apart; the two carriageways of a road are not."""
        if one == other:
            return True
        known = self._around.get(one)
        if known is None:
            if one not in self._ids:
                return False
            known = self._around[one] = frozenset(self._names[each] for each in self._near(self._ids[one]))
        return other in known

    def through(self, link: str, crossing: str) -> str | None:
        """The only link that a vehicle can come to from a link, through a crossing where a road continues; None if there is none."""
        key = link, crossing
        if key not in self._through:
            if link not in self._ids or crossing not in self._ids:
                return None
            self._through[key] = self._followed(self._ids[link], self._ids[crossing])
        return self._through[key]

    def after(self, way: DirectedLink) -> DirectedLink | None:
        """The link in which the road continues after a link in one direction; None where it ends or is crossed."""
        if way not in self._after:
            self._after[way] = self._continuation(way)
        return self._after[way]

    def _followed(self, link: str, crossing: str) -> str | None:
        for way in self._ways(link):
            if self._links[link].crossing_at(way.direction) == crossing:
                follow = self._follow(crossing, way)
                if len(follow) == 1 and any(self.after(each) == follow[0] for each in self._entries(crossing)):
                    return self._names[follow[0].link]
        return None

    def _near(self, link: str) -> Iterator[str]:
        """The links of the road before and after a link, in each of its directions."""
        for way in self._ways(link):
            for step in (self.after, self._before):
                apart_m, at, found = 0.0, step(way), {link}
                while at is not None and apart_m < REACH_M and at.link not in found:
                    yield at.link
                    found.add(at.link)
                    apart_m += self._links[at.link].length_m
                    at = step(at)

    def _before(self, way: DirectedLink) -> DirectedLink | None:
        crossing = self._links[way.link].crossing_at(-way.direction)
        entries = () if crossing is None else self._entries(crossing)
        return next((each for each in entries if self.after(each) == way), None)

    def _continuation(self, way: DirectedLink) -> DirectedLink | None:
        crossing = self._links[way.link].crossing_at(way.direction)
        if crossing is None or not (follow := self._follow(crossing, way)):
            return None
        entries = self._entries(crossing)
        to = min(follow, key=lambda each: self._unlike(crossing, way, each))
        into = [each for each in entries if to in self._follow(crossing, each)]
        if way != min(into, key=lambda each: self._unlike(crossing, each, to)):
            return None
        is_only = abs(self._turns.angle_rad(crossing, way, to)) < _ACROSS_RAD and [way] == [
            each for each in entries if self._turns.relation(each, to) != UTURN
        ]
        is_only = is_only and len(self._exits(way)) == 1
        return to if is_only or self._has_slips_only(crossing, way, to) else None

    def _ways(self, link: str) -> list[DirectedLink]:
        return [DirectedLink(link, each) for each in self._links[link].directions] if link in self._links else []

    def _entries(self, crossing: str) -> list[DirectedLink]:
        return [arm.back for arm in self._arms[crossing] if -arm.direction in self._links[arm.link].directions]

    def _exits(self, way: DirectedLink) -> list[DirectedLink]:
        return [each for each, turn in self._turns.exits(way).items() if turn != UTURN]

    def _follow(self, crossing: str, way: DirectedLink) -> list[DirectedLink]:
        """The links that lie ahead of one, or the only one that follows."""
        exits = self._exits(way)
        ahead = [each for each in exits if abs(self._turns.angle_rad(crossing, way, each)) <= _ALONG_RAD]
        return ahead or (exits if len(exits) == 1 else [])

    def _unlike(self, crossing: str, way: DirectedLink, to: DirectedLink) -> tuple[int, float]:
        lanes = [len(self._links[each.link].lanes_of(each.direction)) for each in (way, to)]
        return abs(lanes[0] - lanes[1]), abs(self._turns.angle_rad(crossing, way, to))

    def _has_slips_only(self, crossing: str, way: DirectedLink, to: DirectedLink) -> bool:
        """Whether all others at a crossing have one way along the road, and no two of them are the ways of one street."""
        if abs(self._turns.angle_rad(crossing, way, to)) > _ALONG_RAD:
            return False
        arrive: list[DirectedLink] = []
        depart: list[DirectedLink] = []
        for arm in self._arms[crossing]:
            if arm in {way.back, to}:
                continue
            directions = self._links[arm.link].directions
            if len(directions) != 1:
                return False
            is_exit = arm.direction in directions
            pair = (way, arm) if is_exit else (arm.back, to)
            if _ALONG_RAD < abs(self._turns.angle_rad(crossing, *pair)) < _ACROSS_RAD:
                return False
            if self._turns.relation(*pair) != UTURN:
                (depart if is_exit else arrive).append(arm if is_exit else arm.back)
        return not any(self._turns.relation(one, other) == UTURN for one in arrive for other in depart)
