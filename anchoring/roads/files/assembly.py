"""From features to a network: ids are unique, links name crossings that are there and reach them."""

import math
from typing import Final

from anchoring.roads.elements import Crossing, RoadArea, RoadLink
from anchoring.roads.files.problems import Problems
from anchoring.roads.geometry import Point2
from anchoring.roads.network import RoadNetwork
from dyknow.model.errors import did_you_mean
from navigation.geodesy import LocalFrame

MOST_SUGGESTED_FROM: Final = 200
"""A name is compared with the known ones if they are no more than this."""


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
        known = list(self.crossings) if len(self.crossings) <= MOST_SUGGESTED_FROM else []
        for feature, link in self.links.values():
            for role, name, end in (("from", link.start, link.line.points[0]), ("to", link.end, link.line.points[-1])):
                if name is None:
                    continue
                if name not in self.crossings:
                    self._problems.error(
                        feature, link.id, f'"{role}" is {name!r}, and no crossing has this id',
                        f"add a Point of kind crossing with this id, or leave {role} out where the road leaves the network."
                        f"{did_you_mean(name, known)}",
                    )  # fmt: skip
                else:
                    self._reaches(feature, link, role, self.crossings[name][1], end)
        if self._problems.has_errors:
            return None
        return RoadNetwork(
            (one for _, one in self.crossings.values()),
            (one for _, one in self.links.values()),
            (one for _, one in self.areas.values()),
            frame,
        )

    def _reaches(self, feature: int, link: RoadLink, role: str, crossing: Crossing, end: Point2) -> None:
        apart_m = math.hypot(end[0] - crossing.x_m, end[1] - crossing.y_m)
        if apart_m > crossing.radius_m + link.width_m:
            self._problems.warning(
                feature, link.id, f'it ends {apart_m:.1f} m from {crossing.id!r}, its "{role}", whose radius is '
                f"{crossing.radius_m:g} m", "let it end in the crossing, or turn its points round",
            )  # fmt: skip
