"""Where something may be by now that travels along roads: a weighted set of route hypotheses.

A hypothesis that comes to the crossing at the end of its link splits into one for each link that follows, without U-turns
except at dead ends, and takes the curve that leads there. The weight is split by a prior over turns. Weights sum to 1;
light hypotheses are pruned, those that meet are one.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final, NamedTuple, Protocol

from dyknow.anchoring.roads.elements import DirectedLink
from dyknow.anchoring.roads.geometry import wrapped
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.anchoring.roads.turns import CrossingPath

MOST_STEPS: Final = 2000
"""Most ends of links that one call passes: a hypothesis that would go farther stops there."""
_MEETING: Final = 4
"""Between two crossings hypotheses are kept that are as light as this part of the least weight: they may meet others."""
_SAME_M: Final = 0.5
"""Hypotheses on one lane that are no farther apart are one."""


class RouteHypothesis(NamedTuple):
    """One place where it may be.

    Attributes:
        way: the link and the direction of travel.
        travelled_m: along the link from the middle of the crossing where it begins; negative where that is still ahead.
            On the curve through the crossing it runs from `-before_m` to `after_m` of the `CrossingPath`.
        lane: index into the link's lanes.
        via: the link before; None if not known.
    """

    way: DirectedLink
    travelled_m: float
    lane: int
    weight: float
    via: DirectedLink | None = None

    def offset_m(self, network: RoadNetwork) -> float:
        """Along the link from its start."""
        length_m = network.links[self.way.link].length_m
        offset_m = self.travelled_m if self.way.direction > 0 else length_m - self.travelled_m
        return min(max(offset_m, 0.0), length_m)

    def at(self, network: RoadNetwork) -> tuple[float, float, float]:
        """(x_m, y_m, heading_rad): the centre of the lane or of the way through the crossing, the direction of travel."""
        way, travelled_m, lane = self.way, self.travelled_m, self.lane
        path = self.path(network)
        if path is not None and travelled_m >= -path.before_m:
            x_m, y_m, heading_rad = path.at(travelled_m)
            return x_m, y_m, wrapped(heading_rad)
        if travelled_m < 0.0 and self.via is not None:
            before = network.links[self.via.link]
            lane = before.lane_near(network.links[way.link].lanes[lane].offset_m, self.via.direction)
            way, travelled_m = self.via, max(0.0, before.length_m + travelled_m)
        link = network.links[way.link]
        offset_m = travelled_m if way.direction > 0 else link.length_m - travelled_m
        x_m, y_m, line_rad = link.line.at(offset_m, link.lanes[lane].offset_m)
        return x_m, y_m, wrapped(line_rad + (0.0 if way.direction > 0 else math.pi))

    def path(self, network: RoadNetwork) -> CrossingPath | None:
        """The curve on which it is, or which is ahead."""
        path = network.paths.through(self.via, self.way, self.lane)
        return path if path is not None and self.travelled_m < path.after_m else None


class TurnPrior(Protocol):
    """How probable each way out of a link is."""

    def __call__(self, crossing: str | None, exits: Mapping[DirectedLink, str], /) -> Mapping[DirectedLink, float]:
        """A weight, 0 or more, for each of the links that follow, whose turns are given."""


def uniform(_crossing: str | None, exits: Mapping[DirectedLink, str]) -> Mapping[DirectedLink, float]:
    """All ways are as probable."""
    return dict.fromkeys(exits, 1.0)


@dataclass(frozen=True, slots=True)
class TurnTable:
    """How often one turns which way: at each crossing, or everywhere else.

    Attributes:
        crossings: by the name of the crossing, weights by turn: left, right, straight, uturn.
        usual: the same for the others; a turn that is not there has the weight `least`.
    """

    crossings: Mapping[str, Mapping[str, float]] = field(default_factory=lambda: MappingProxyType({}))
    usual: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    least: float = 1e-3

    def __call__(self, crossing: str | None, exits: Mapping[DirectedLink, str]) -> Mapping[DirectedLink, float]:
        """The weight of a turn, shared by all links to which it leads."""
        table = self.crossings.get(crossing or "", self.usual)
        if not table:
            return uniform(crossing, exits)
        turns = list(exits.values())
        return {one: table.get(turn, self.least) / turns.count(turn) for one, turn in exits.items()}


class Pruning(NamedTuple):
    """The hypotheses to keep: those of at least this weight, and at most this many."""

    least_weight: float = 0.02
    most: int = 32


USUAL_PRUNING: Final = Pruning()


def advance(
    network: RoadNetwork,
    hypotheses: Sequence[RouteHypothesis],
    distance_m: float,
    prior: TurnPrior = uniform,
    pruning: Pruning = USUAL_PRUNING,
) -> tuple[RouteHypothesis, ...]:
    """All hypotheses, a distance farther along their roads; the heaviest first."""
    arrived: list[RouteHypothesis] = []
    ahead = [(one, distance_m) for one in hypotheses]
    steps = 0
    while ahead:
        one, left_m = _onward(network, *ahead.pop())
        if not left_m > 0.0:
            arrived.append(one)
            continue
        steps += 1
        exits = network.turns.exits(one.way)
        if not exits or steps > MOST_STEPS:
            length_m = network.links[one.way.link].length_m
            arrived.append(one._replace(travelled_m=min(one.travelled_m + left_m, length_m)))
            continue
        split = _split(network, one, prior)
        kept = [each for each in split if each.weight >= pruning.least_weight / _MEETING] or split[:1]
        ahead += [(each, left_m) for each in kept]
    return pruned(arrived, pruning)


def _onward(network: RoadNetwork, one: RouteHypothesis, distance_m: float) -> tuple[RouteHypothesis, float]:
    """Through the crossing in which it is, and along its link to where the next begins; and the rest of the distance."""
    path = one.path(network)
    if path is not None:
        there_m = one.travelled_m + distance_m * path.per_m
        if there_m <= path.after_m:
            return one._replace(travelled_m=there_m), 0.0
        distance_m -= (path.after_m - one.travelled_m) / path.per_m
        one = one._replace(travelled_m=path.after_m)
    room_m = max(0.0, network.links[one.way.link].length_m - network.paths.begins_m(one.way) - one.travelled_m)
    return one._replace(travelled_m=one.travelled_m + min(room_m, distance_m)), distance_m - room_m


def _split(network: RoadNetwork, one: RouteHypothesis, prior: TurnPrior) -> list[RouteHypothesis]:
    """One hypothesis for each link that follows, the heaviest first."""
    link = network.links[one.way.link]
    exits, ahead_m = network.turns.exits(one.way), one.travelled_m - link.length_m
    weights = prior(link.crossing_at(one.way.direction), exits)
    total = sum(weights.values())
    if not total > 0.0:
        weights, total = dict.fromkeys(exits, 1.0), float(len(exits))
    split = [
        RouteHypothesis(way, ahead_m, lane_after(network, one.way, one.lane, way), one.weight * weight / total, one.way)
        for way, weight in weights.items()
        if weight > 0.0
    ]
    return sorted(split, key=lambda each: -each.weight)


def lane_after(network: RoadNetwork, way: DirectedLink, lane: int, following: DirectedLink) -> int:
    """The lane of the following link that is as many lanes from the right edge, as far as it has them."""
    ranked, lanes = _from_right(network, way), _from_right(network, following)
    return lanes[min(ranked.index(lane) if lane in ranked else 0, len(lanes) - 1)]


def _from_right(network: RoadNetwork, way: DirectedLink) -> list[int]:
    """The lanes of a direction, the rightmost first."""
    link = network.links[way.link]
    return sorted(link.lanes_of(way.direction), key=lambda n: -link.lanes[n].offset_m * way.direction)


def pruned(hypotheses: Iterable[RouteHypothesis], pruning: Pruning = USUAL_PRUNING) -> tuple[RouteHypothesis, ...]:
    """Hypotheses that meet merged, light ones dropped, weights summing to 1; the heaviest first, at least one."""
    merged: list[RouteHypothesis] = []
    for one in sorted(hypotheses, key=lambda each: (each.way, each.lane, each.travelled_m)):
        last = merged[-1] if merged else None
        if last is not None and _meet(last, one):
            heavier = last if last.weight >= one.weight else one
            merged[-1] = heavier._replace(weight=last.weight + one.weight)
        else:
            merged.append(one)
    merged.sort(key=lambda each: -each.weight)
    total = sum(each.weight for each in merged)
    kept = [each for each in merged[: pruning.most] if each.weight >= pruning.least_weight * total] or merged[:1]
    total = sum(each.weight for each in kept)
    return tuple(each._replace(weight=each.weight / total) for each in kept)


def _meet(one: RouteHypothesis, other: RouteHypothesis) -> bool:
    """Whether two hypotheses are one; before the middle of a crossing those from different links are not."""
    near = abs(one.travelled_m - other.travelled_m) <= _SAME_M and (one.way, one.lane) == (other.way, other.lane)
    return near and (one.via == other.via or min(one.travelled_m, other.travelled_m) >= 0.0)
