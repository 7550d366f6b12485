"""Road networks from OpenStreetMap XML: the ways on which cars drive, cut where they meet.

A link is a way, or the part of one between two nodes at which ways meet: then its id is that of the way, a point and a
number. Crossings have the ids of nodes; where two ends continue each other the radius is small. Width, lanes and speed
are tags or usual for the class of the road.
"""

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple
from xml.etree.ElementTree import Element

from dyknow.anchoring.roads.elements import Crossing, RoadLink
from dyknow.anchoring.roads.files.assembly import Assembly
from dyknow.anchoring.roads.files.geojson import FARTHEST_M
from dyknow.anchoring.roads.files.lanes import MOST_LANES, even_lanes
from dyknow.anchoring.roads.files.others import LANELETS
from dyknow.anchoring.roads.files.problems import Problems, RoadSurvey
from dyknow.anchoring.roads.files.xml_elements import elements
from dyknow.anchoring.roads.geometry import Point2, Polyline
from dyknow.navigation.geodesy import LocalFrame

SPEEDS_KM_H: Final = {
    "motorway": 120, "motorway_link": 80, "trunk": 100, "trunk_link": 70, "primary": 70, "primary_link": 50,
    "secondary": 70, "secondary_link": 50, "tertiary": 50, "tertiary_link": 50, "unclassified": 50, "residential": 40,
    "living_street": 10, "service": 20, "road": 50,
}  # fmt: skip
"""Classes of roads on which cars drive, with the speed where no tag says one."""
LANE_M: Final = 3.5
JOINT_M: Final = 0.5
"""Radius of a node at which a road merely continues."""
_CLOSED: Final = frozenset({"no", "private"})
_SPEED: Final = re.compile(r"(\d{1,3}(?:\.\d+)?)\s*(km/h|kmh|mph)?")
_KM_H_PER_MPH: Final = 1.609344


class _Way(NamedTuple):
    number: int
    id: str
    nodes: tuple[str, ...]
    tags: Mapping[str, str]


def survey_openstreetmap(text: str | bytes) -> RoadSurvey:
    """The network of an OSM XML text; the frame has its origin in the middle of the roads."""
    problems = Problems("way")
    nodes: dict[str, tuple[float, float]] = {}
    ways: list[_Way] = []
    lanelets = 0
    for element in elements(text, "osm", problems):
        if element.tag == "node":
            _add_node(element, nodes, problems)
        elif element.tag == "relation":
            lanelets += _tags(element).get("type") == "lanelet"
        elif element.tag == "way" and _is_road(tags := _tags(element)):
            references = tuple(part.get("ref", "") for part in element.iter("nd"))
            ways.append(_Way(len(ways), element.get("id", ""), references, tags))
    kept = [_known(way, nodes, problems) for way in ways]
    ways = [way for way in kept if len(way.nodes) > 1]
    used = {name for way in ways for name in way.nodes}
    if lanelets:
        tell = problems.warning if used else problems.error
        tell(None, None, f"lanelets in it ({LANELETS.name}) are not read: {lanelets}", LANELETS.remedy)
    elif not used:
        remedy = "export an area with roads, and its nodes"
        problems.error(None, None, "no way in it is a road for cars with two nodes", remedy)
    if not used:
        return problems.survey(None)
    latitudes, longitudes = zip(*(nodes[name] for name in used), strict=True)
    frame = LocalFrame((min(latitudes) + max(latitudes)) / 2, (min(longitudes) + max(longitudes)) / 2, 0.0)
    places = {name: frame.to_ned(*nodes[name], 0.0)[1::-1] for name in used}
    if max(math.hypot(*place) for place in places.values()) > FARTHEST_M:
        problems.error(
            None, None, f"its roads are farther than {FARTHEST_M / 1000:g} km from their middle", "cut the network"
        )
    assembly = Assembly(problems)
    _fill(assembly, ways, places, problems)
    return problems.survey(assembly.network(frame))


def _add_node(element: Element, nodes: dict[str, tuple[float, float]], problems: Problems) -> None:
    name = element.get("id", "")
    try:
        latitude_deg, longitude_deg = float(element.get("lat", "")), float(element.get("lon", ""))
    except ValueError:
        latitude_deg = longitude_deg = math.nan
    if abs(latitude_deg) <= 90.0 and abs(longitude_deg) <= 180.0:
        nodes[name] = latitude_deg, longitude_deg
    else:
        problems.error(None, None, f"node {name[:60]!r} has no latitude and longitude in degrees", "export it again")


def _tags(element: Element) -> dict[str, str]:
    return {tag.get("k", ""): tag.get("v", "") for tag in element.iter("tag")}


def _is_road(tags: Mapping[str, str]) -> bool:
    access = tags.get("motor_vehicle", tags.get("access", "yes"))
    return tags.get("highway") in SPEEDS_KM_H and access not in _CLOSED and tags.get("area") != "yes"


def _known(way: _Way, nodes: Mapping[str, tuple[float, float]], problems: Problems) -> _Way:
    """The way without nodes that the text does not have, as at the border of an extract."""
    known = tuple(name for name in way.nodes if name in nodes)
    if len(known) < len(way.nodes):
        lost = len(way.nodes) - len(known)
        problems.warning(way.number, way.id, f"{lost} of its nodes are not in the text", "export whole ways")
    return way._replace(nodes=known)


def _fill(assembly: Assembly, ways: Sequence[_Way], places: Mapping[str, Point2], problems: Problems) -> None:
    ends: Counter[str] = Counter()
    for way in ways:
        ends.update((way.nodes[0], way.nodes[-1]))
        ends.update(dict.fromkeys(way.nodes[1:-1], 2))
    passing = Counter(name for way in ways for name in set(way.nodes))
    meeting = {name for name, count in passing.items() if count > 1}
    widest: dict[str, float] = {}
    for way in ways:
        cuts = meeting | {way.nodes[0], way.nodes[-1], *_twice(way.nodes)}
        parts = list(_parts(way.nodes, cuts))
        for n, part in enumerate(parts):
            name = way.id if len(parts) == 1 else f"{way.id}.{n}"
            try:
                line = Polyline([places[node] for node in part])
            except ValueError:
                problems.warning(way.number, name, "its length is zero", "it is left out")
                continue
            link = _link(name, way, part, line)
            assembly.add(way.number, link)
            for node in (part[0], part[-1]):
                widest[node] = max(widest.get(node, 0.0), link.width_m)
    for node, width_m in widest.items():
        radius_m = width_m / 2 + 1.0 if ends[node] > 2 else JOINT_M
        assembly.crossings[node] = (0, Crossing(node, *places[node], radius_m))


def _twice(nodes: Sequence[str]) -> Iterator[str]:
    """Nodes at which a way meets itself."""
    return (name for name, count in Counter(nodes).items() if count > 1)


def _parts(nodes: Sequence[str], cuts: set[str]) -> Iterator[Sequence[str]]:
    begin = 0
    for at in range(1, len(nodes)):
        if nodes[at] in cuts:
            yield nodes[begin : at + 1]
            begin = at


def _link(name: str, way: _Way, nodes: Sequence[str], line: Polyline) -> RoadLink:
    tags, start, end = way.tags, nodes[0], nodes[-1]
    kind = tags["highway"]
    one_way = tags.get("oneway", "yes" if tags.get("junction") == "roundabout" or kind.startswith("motorway") else "no")
    if one_way in {"-1", "reverse"}:
        line, start, end = Polyline(line.points[::-1]), end, start
    is_one_way = one_way in {"yes", "true", "1", "-1", "reverse"}
    lanes = _number(tags.get("lanes", "")) or (1 if is_one_way else 2)
    count = max(1, min(MOST_LANES, int(lanes)))
    width_m = _number(tags.get("width", "")) or LANE_M * count
    width_m = min(200.0, max(2.0, width_m))
    speed_m_s = _speed_km_h(tags.get("maxspeed", ""), SPEEDS_KM_H[kind]) / 3.6
    return RoadLink(name, start, end, line, width_m, even_lanes(count, width_m, one_way=is_one_way), speed_m_s)


def _number(text: str) -> float | None:
    found = re.match(r"\d{1,4}(\.\d{1,4})?", text)
    return float(found[0]) if found else None


def _speed_km_h(text: str, usual: float) -> float:
    found = _SPEED.fullmatch(text.strip())
    speed = 0.0 if found is None else float(found[1]) * (_KM_H_PER_MPH if found[2] == "mph" else 1.0)
    return speed or usual
