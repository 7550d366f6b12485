"""From features to a network: ids are unique, links name crossings that are there and reach them."""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from dyknow.anchoring.roads.elements import Crossing, RoadArea, RoadLink
from dyknow.anchoring.roads.files.problems import Problems
from dyknow.anchoring.roads.geometry import Point2
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.model.errors import did_you_mean
from dyknow.navigation.geodesy import LocalFrame

MOST_SUGGESTED_FROM: Final = 200
"""A name is compared with the known ones if they are no more than this."""


FARTHEST_FROM_JOINT_M: Final = 30.0
"""Links that name a crossing which is not declared meet, if they all end within this of the middle of their ends."""


class LinkEnd(NamedTuple):
    """An end of a link: `role` is `from` or `to`."""

    feature: int
    link: RoadLink
    role: str
    at: Point2


class Assembly:
    """Collects what a text declares, with the index of the feature that declares it."""

    def __init__(self, problems: Problems) -> None:
        self._problems = problems
        self.crossings: dict[str, tuple[int, Crossing]] = {}
        self.links: dict[str, tuple[int, RoadLink]] = {}
        self.areas: dict[str, tuple[int, RoadArea]] = {}

    def add(self, feature: int, made: Crossing | RoadLink | RoadArea) -> None:
        """One feature; an id that is taken is an error."""
        if isinstance(made, Crossing):
            self._once(feature, made.id, "crossing", self.crossings.setdefault(made.id, (feature, made))[0])
        elif isinstance(made, RoadLink):
            self._once(feature, made.id, "link", self.links.setdefault(made.id, (feature, made))[0])
        else:
            self._once(feature, made.id, "area", self.areas.setdefault(made.id, (feature, made))[0])

    def _once(self, feature: int, name: str, kind: str, first: int) -> None:
        if first != feature:
            self._problems.error(
                feature,
                name,
                f"{self._problems.noun} {first} is a {kind} with the same id",
                "give each an id of its own",
            )

    def network(self, frame: LocalFrame | None) -> RoadNetwork | None:
        """The network; None if there are errors."""
        unplaced: dict[str, list[LinkEnd]] = {}
        for feature, link in self.links.values():
            for role, name, at in (("from", link.start, link.line.points[0]), ("to", link.end, link.line.points[-1])):
                if name is not None and name in self.crossings:
                    self._reaches(feature, link, role, self.crossings[name][1], at)
                elif name is not None:
                    unplaced.setdefault(name, []).append(LinkEnd(feature, link, role, at))
        for name, ends in unplaced.items():
            self._placed(name, ends)
        if self._problems.has_errors:
            return None
        return RoadNetwork(
            (one for _, one in self.crossings.values()),
            (one for _, one in self.links.values()),
            (one for _, one in self.areas.values()),
            frame,
        )

    def _placed(self, name: str, ends: Sequence[LinkEnd]) -> None:
        """A crossing that links name and no feature declares: where they meet, or nothing where one link alone ends."""
        feature, link, role, _ = ends[0]
        wrong = f'"{role}" is {name!r}, and no crossing has this id'
        known = list(self.crossings) if len(self.crossings) <= MOST_SUGGESTED_FROM else []
        hint = did_you_mean(name, known)
        if len(ends) == 1 and any(_within(ends[0], self.crossings[each][1]) for each in known):
            self._problems.error(
                feature, link.id, wrong, f"the road ends in a crossing: name that one, or leave {role} out.{hint}"
            )
            return
        if len(ends) == 1:
            self._problems.warning(
                feature, link.id, f"{wrong}: the road leaves the network there",
                f"add a Point of kind crossing with this id if others meet it.{hint}",
            )  # fmt: skip
            known_link = self.links[link.id][1]
            left = known_link._replace(start=None) if role == "from" else known_link._replace(end=None)
            self.links[link.id] = feature, left
            return
        x_m, y_m = (sum(each.at[axis] for each in ends) / len(ends) for axis in (0, 1))
        radius_m = max(each.link.width_m for each in ends) / 2
        farthest_m = max(math.hypot(each.at[0] - x_m, each.at[1] - y_m) for each in ends)
        if farthest_m > FARTHEST_FROM_JOINT_M:
            self._problems.error(
                feature, link.id, f"{wrong}; links that name it end {farthest_m:.1f} m from their middle",
                f"add a Point of kind crossing with this id, or let them meet.{hint}",
            )  # fmt: skip
            return
        radius_m = max(radius_m, farthest_m)
        self._problems.warning(
            feature, link.id, f"{wrong}: it is taken to be where {len(ends)} links meet, with a radius of {radius_m:.1f} m",
            f"add a Point of kind crossing with this id.{hint}",
        )  # fmt: skip
        self.crossings[name] = feature, Crossing(name, x_m, y_m, radius_m)

    def _reaches(self, feature: int, link: RoadLink, role: str, crossing: Crossing, end: Point2) -> None:
        apart_m = math.hypot(end[0] - crossing.x_m, end[1] - crossing.y_m)
        if not _within(LinkEnd(feature, link, role, end), crossing):
            self._problems.warning(
                feature, link.id, f'it ends {apart_m:.1f} m from {crossing.id!r}, its "{role}", whose radius is '
                f"{crossing.radius_m:g} m", "let it end in the crossing, or turn its points round",
            )  # fmt: skip


def _within(end: LinkEnd, crossing: Crossing) -> bool:
    """Whether a link ends in or at a crossing."""
    apart_m = math.hypot(end.at[0] - crossing.x_m, end.at[1] - crossing.y_m)
    return apart_m <= crossing.radius_m + end.link.width_m
