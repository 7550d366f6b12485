"""Attributes of objects on roads: link, crossing, lane, speed, and relations to each other.

They are attributes of states, so that chronicles and formulas range over them (thesis 8.7.4, 8.7.5): `link` and
`crossing` are names, or `no_link` and `no_crossing`; off the roads they are both that.
"""

from typing import Final

from dyknow import Value
from dyknow.anchoring.links.states import ObjectState
from dyknow.anchoring.roads.elements import DirectedLink
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.anchoring.roads.snapping import RoadPlace

NO_LINK: Final = "no_link"
NO_CROSSING: Final = "no_crossing"
ROUTE, TRAVELLED = "route", "travelled_m"
"""Of a predicted state: the link on which it is, or to which it leads through a crossing, and how far it is on it."""
TURN, TURNED = "turn", "turned_us"
"""The last turn that was made at a crossing (`left`, ...), and the valid time when that was known."""
_MOST: Final = 1e12
_PLACES: Final = ("link", NO_LINK), ("crossing", NO_CROSSING), ("via", NO_LINK)
TURN_MADE: Final = frozenset({TURN, TURNED})
ROAD_ATTRIBUTES: Final = frozenset({
    "link", "crossing", "direction", "offset_m", "across_m", "via", "via_direction", "lane", "heading_rad", "along_m_s",
    ROUTE, TRAVELLED, TURN, TURNED,
})  # fmt: skip


def attributes_of(place: RoadPlace | None) -> dict[str, Value]:
    """The attributes of a place; `along_m_s` is the speed along the link, `via` the link before a crossing."""
    if place is None:
        return {"link": NO_LINK, "crossing": NO_CROSSING}
    via = place.via or DirectedLink(NO_LINK, 0)
    known: dict[str, Value] = {
        "link": place.link or NO_LINK, "crossing": place.crossing or NO_CROSSING, "direction": place.direction,
        "offset_m": place.offset_m, "across_m": place.across_m, "via": via.link, "via_direction": via.direction,
    }  # fmt: skip
    optional = {"lane": place.lane, "heading_rad": place.heading_rad, "along_m_s": place.speed_m_s}
    return known | {name: value for name, value in optional.items() if value is not None}


def place_of(state: ObjectState) -> RoadPlace | None:
    """The place that a state's attributes describe; None if it is off the roads, or was never put on them.

    Percepts may have attributes of these names with another meaning: impossible values are left out.
    """
    about = state.attributes
    link, crossing, via = (_name(about.get(name), nothing) for name, nothing in _PLACES)
    if link is None and crossing is None:
        return None
    lane, arriving = about.get("lane"), _direction(about.get("via_direction"))
    return RoadPlace(
        state.x_m, state.y_m, link, crossing, _direction(about.get("direction")),
        lane if isinstance(lane, int) and lane >= 0 else None,
        number_of(about.get("offset_m")) or 0.0, number_of(about.get("across_m")) or 0.0,
        number_of(about.get("heading_rad")), number_of(about.get("along_m_s")),
        DirectedLink(via, arriving) if via is not None and arriving else None,
    )  # fmt: skip


def number_of(value: Value) -> float | None:
    """A value that is a number; None: it is none."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < _MOST
    return float(value) if is_number else None


def _name(value: Value, nothing: str) -> str | None:
    """A name; None: it is none, or that of nothing."""
    return value if isinstance(value, str) and value != nothing else None


def _direction(value: Value) -> int:
    return int(value) if isinstance(value, int | float) and abs(value) == 1 else 0


def turn_made(network: RoadNetwork, before: RoadPlace | None, place: RoadPlace | None) -> str | None:
    """The turn that is complete with this place: from the link before, at once or through a crossing; else None."""
    if before is None or before.via is None or place is None or place.link is None:
        return None
    arrived, departed = before.via, DirectedLink(place.link, place.direction)
    if arrived == departed or not arrived.direction or not departed.direction or arrived.link not in network.links:
        return None
    if arrived.link == departed.link and before.crossing is None:
        return None
    return network.turns.relation(arrived, departed)


def turn_attributes(
    network: RoadNetwork, before: ObjectState | None, previous: RoadPlace | None, place: RoadPlace | None, valid_us: int
) -> dict[str, Value]:
    """The last turn of a place that follows another one, that of the state before: this one, or that of the state."""
    if before is None:
        return {}
    turn = turn_made(network, previous, place)
    if turn is not None:
        return {TURN: turn, TURNED: valid_us}
    return {name: before.attributes[name] for name in (TURN, TURNED) if name in before.attributes}


def ahead_m(network: RoadNetwork, one: RoadPlace, other: RoadPlace) -> float | None:
    """By how much the first is ahead of the second along the road, in the direction in which the second travels.

    Both are on one link, or on two that follow each other; None elsewhere, and where the direction is not known.
    """
    if one.link is None or other.link is None or not other.direction:
        return None
    if one.link == other.link:
        return (one.offset_m - other.offset_m) * other.direction
    if not one.direction:
        return None
    first, second = DirectedLink(one.link, one.direction), DirectedLink(other.link, other.direction)
    if first in network.turns.exits(second):
        return _travelled_m(network, one) + _remaining_m(network, other)
    if second in network.turns.exits(first):
        return -_travelled_m(network, other) - _remaining_m(network, one)
    return None


def _travelled_m(network: RoadNetwork, place: RoadPlace) -> float:
    link = network.links[place.link or ""]
    return place.offset_m if place.direction > 0 else link.length_m - place.offset_m


def _remaining_m(network: RoadNetwork, place: RoadPlace) -> float:
    return network.links[place.link or ""].length_m - _travelled_m(network, place)
