"""From positions to places on the road network, with hysteresis.

A position within the radius of a crossing is in it, and stays there until 1.2 radii. Elsewhere it belongs to the link
that minimises (d / s_d)^2 + (heading mismatch / s_h)^2 + cost of switching, where d is the distance from the centre
line, and switching costs if the link is neither the previous one nor adjacent to it.
"""

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

from dyknow.anchoring.roads.elements import LEAVE, Crossing, DirectedLink, RoadLink
from dyknow.anchoring.roads.geometry import Point2, Projection, wrapped
from dyknow.anchoring.roads.network import RoadNetwork


@dataclass(frozen=True, slots=True)
class SnapSettings:
    """How positions are put on roads.

    Attributes:
        across_sd_m: s_d.
        heading_sd_rad: s_h.
        switch_cost: of a link that is not adjacent to the previous one.
        reach_m: an object farther from every link is off the roads.
        least_speed_m_s: the direction of a slower velocity counts for nothing.
        stay_m: so much farther a lane may be and yet remain the lane.
    """

    across_sd_m: float = 3.0
    heading_sd_rad: float = 0.5
    switch_cost: float = 4.0
    reach_m: float = 25.0
    least_speed_m_s: float = 1.0
    stay_m: float = 0.5


DEFAULTS: Final = SnapSettings()


class RoadPlace(NamedTuple):
    """Where on the network something is: on a link, or in a crossing.

    Attributes:
        x_m, y_m: on a link the centre of the lane; in a crossing the position as it was given.
        link, crossing: one of them is None.
        direction: of travel along the link: 1 from its start to its end, -1 back, 0 if not known.
        lane: index into the link's lanes.
        offset_m: along the link, from its start.
        across_m: where the position was, right of the link's centre line.
        heading_rad: of travel, counter-clockwise from east; None if not known.
        speed_m_s: along the link in the direction of travel, in a crossing that of the velocity; None if not known.
        via: the link that was travelled last: in a crossing the one from which it was entered.
    """

    x_m: float
    y_m: float
    link: str | None
    crossing: str | None
    direction: int
    lane: int | None
    offset_m: float
    across_m: float
    heading_rad: float | None
    speed_m_s: float | None
    via: DirectedLink | None


def snap(
    network: RoadNetwork,
    x_m: float,
    y_m: float,
    velocity_m_s: Point2 | None = None,
    previous: RoadPlace | None = None,
    settings: SnapSettings = DEFAULTS,
) -> RoadPlace | None:
    """The place of a position; None if it is off the roads, or not finite.

    `velocity_m_s` is east and north, if it is known; `previous` is the last place of the same object, for hysteresis.
    """
    if not (math.isfinite(x_m) and math.isfinite(y_m)):
        return None
    heading_rad = _heading(velocity_m_s, settings.least_speed_m_s)
    if crossing := crossing_at(network, x_m, y_m, previous):
        return _in_crossing(network, crossing, x_m, y_m, velocity_m_s, heading_rad, previous)
    costs = [
        (_cost(network, link, at, heading_rad, previous, settings), link, at)
        for link, at in network.index.links_near(x_m, y_m, settings.reach_m)
    ]
    if not costs:
        return None
    _, link, at = min(costs, key=lambda each: each[0])
    return place_on(link, at, velocity_m_s, heading_rad, previous, settings)


def crossing_at(network: RoadNetwork, x_m: float, y_m: float, previous: RoadPlace | None = None) -> Crossing | None:
    """The crossing that a position is in; the one it was in until 1.2 radii, else the one that is deepest around it."""
    near = list(network.index.crossings_near(x_m, y_m))
    for crossing, distance_m in near:
        if previous is not None and crossing.id == previous.crossing and distance_m < LEAVE * crossing.radius_m:
            return crossing
    inside = [(distance_m / one.radius_m, one) for one, distance_m in near if distance_m <= one.radius_m]
    return min(inside, key=lambda each: each[0])[1] if inside else None


def _heading(velocity_m_s: Point2 | None, least_m_s: float) -> float | None:
    if velocity_m_s is None or not least_m_s <= math.hypot(*velocity_m_s) < math.inf:
        return None
    return math.atan2(velocity_m_s[1], velocity_m_s[0])


def _in_crossing(
    network: RoadNetwork,
    crossing: Crossing,
    x_m: float,
    y_m: float,
    velocity_m_s: Point2 | None,
    heading_rad: float | None,
    previous: RoadPlace | None,
) -> RoadPlace:
    speed_m_s = None if velocity_m_s is None else math.hypot(*velocity_m_s)
    via = None if previous is None else previous.via
    if via is not None and via.link in network.links and not via.direction:
        via = DirectedLink(via.link, 1 if network.links[via.link].end == crossing.id else -1)
    known_rad = heading_rad if heading_rad is not None or previous is None else previous.heading_rad
    return RoadPlace(x_m, y_m, None, crossing.id, 0, None, 0.0, 0.0, known_rad, speed_m_s, via)


def mismatch_rad(link: RoadLink, line_rad: float, heading_rad: float) -> tuple[float, int]:
    """By how much a heading differs from the better direction of a link, and that direction."""
    each = [(abs(wrapped(heading_rad - line_rad - (math.pi if one < 0 else 0.0))), one) for one in link.directions]
    return min(each, key=lambda pair: pair[0])


def _cost(
    network: RoadNetwork,
    link: RoadLink,
    at: Projection,
    heading_rad: float | None,
    previous: RoadPlace | None,
    settings: SnapSettings,
) -> float:
    cost = (at.across_m / settings.across_sd_m) ** 2
    if heading_rad is not None:
        cost += (mismatch_rad(link, at.heading_rad, heading_rad)[0] / settings.heading_sd_rad) ** 2
    last = None if previous is None or previous.via is None else previous.via.link
    if last is not None and last != link.id and last in network.links and not network.adjacent(last, link.id):
        cost += settings.switch_cost
    return cost


def place_on(
    link: RoadLink,
    at: Projection,
    velocity_m_s: Point2 | None = None,
    heading_rad: float | None = None,
    previous: RoadPlace | None = None,
    settings: SnapSettings = DEFAULTS,
) -> RoadPlace:
    """The place on a link whose nearest point is known: its direction, its lane, the centre of the lane."""
    direction = _direction(link, at, heading_rad, previous)
    same = previous is not None and previous.link == link.id and previous.direction == direction
    lane = link.lane_near(at.across_m, direction, previous.lane if same and previous else None, settings.stay_m)
    x, y, line_rad = link.line.at(at.offset_m, link.lanes[lane].offset_m)
    speed_m_s = None
    if velocity_m_s is not None:
        speed_m_s = velocity_m_s[0] * math.cos(line_rad) + velocity_m_s[1] * math.sin(line_rad)
        speed_m_s = speed_m_s * direction if direction else abs(speed_m_s)
    return RoadPlace(
        x, y, link.id, None, direction, lane, at.offset_m, at.across_m,
        wrapped(line_rad + (math.pi if direction < 0 else 0.0)) if direction else None, speed_m_s,
        DirectedLink(link.id, direction),
    )  # fmt: skip


def _direction(link: RoadLink, at: Projection, heading_rad: float | None, previous: RoadPlace | None) -> int:
    """By the heading; without one as before, away from the crossing that was left, or by the side of the road."""
    if len(link.directions) == 1:
        return link.directions[0]
    if heading_rad is not None:
        return mismatch_rad(link, at.heading_rad, heading_rad)[1]
    if previous is not None and previous.link == link.id and previous.direction:
        return previous.direction
    if previous is not None and previous.crossing is not None and link.start != link.end:
        if previous.crossing == link.start:
            return 1
        if previous.crossing == link.end:
            return -1
    return link.lanes[link.lane_near(at.across_m, 0)].direction
