"""Road networks of the traffic simulator SUMO (`.net.xml`): edges for cars, junctions.

An edge leads one way: it becomes a link whose centre is that of its lanes, from the middle of its first junction to that
of its last. Internal edges and those of other traffic are left out. Coordinates stay those of the network, in metres.
"""

import math
from collections.abc import Sequence
from itertools import accumulate
from typing import Final
from xml.etree.ElementTree import Element

from dyknow.anchoring.roads.elements import Crossing, Lane, RoadLink
from dyknow.anchoring.roads.files.assembly import Assembly
from dyknow.anchoring.roads.files.geojson import FARTHEST_M
from dyknow.anchoring.roads.files.problems import FeatureError, Problems, RoadSurvey
from dyknow.anchoring.roads.files.xml_elements import elements
from dyknow.anchoring.roads.geometry import Point2, Polyline

LANE_M: Final = 3.2
"""The width of a lane that does not say one, as in SUMO."""
RADIUS_M: Final = (1.0, 200.0)
_CARS: Final = frozenset({"passenger", "all"})


def survey_sumo(text: str | bytes) -> RoadSurvey:
    """The network of a SUMO text."""
    problems = Problems("edge")
    assembly = Assembly(problems)
    edges: list[tuple[int, Element]] = []
    for element in elements(text, "net", problems):
        if element.tag == "edge" and element.get("function", "normal") == "normal":
            edges.append((len(edges), element))
        elif element.tag == "junction" and element.get("type") != "internal":
            _add_junction(element, assembly, problems)
    _end_at_stop_lines([element for _, element in edges], assembly)
    for index, element in edges:
        try:
            link = _link(element, assembly)
        except FeatureError as wrong:
            problems.error(index, element.get("id"), wrong.message, wrong.remedy)
        else:
            if link is not None:
                assembly.add(index, link)
    if not edges and not problems.has_errors:
        problems.error(None, None, "no edge in it is a road", "write the network with netconvert")
    return problems.survey(assembly.network(None))


def _add_junction(element: Element, assembly: Assembly, problems: Problems) -> None:
    name = element.get("id", "")
    try:
        ((x_m, y_m),) = _points(f"{element.get('x')},{element.get('y')}")
        border = _points(element.get("shape", ""))
    except (FeatureError, ValueError):
        problems.error(None, None, f"junction {name[:60]!r} lacks its place in metres", "write it with netconvert")
        return
    reach_m = max((math.hypot(x - x_m, y - y_m) for x, y in border), default=0.0)
    assembly.crossings[name] = (0, Crossing(name, x_m, y_m, min(max(reach_m, RADIUS_M[0]), RADIUS_M[1])))


def _end_at_stop_lines(edges: Sequence[Element], assembly: Assembly) -> None:
    """Let a crossing end where the lanes of its edges end, not at its corners: waiting vehicles are on their link."""
    reaches_m: dict[str, float] = {}
    for element in edges:
        try:
            forms = [_points(lane.get("shape", "")) for lane in element.iter("lane") if _for_cars(lane)]
        except FeatureError:
            continue
        for name, at in ((element.get("from"), 0), (element.get("to"), -1)):
            if name in assembly.crossings and any(forms):
                crossing = assembly.crossings[name][1]
                nearest_m = min(math.dist(form[at], (crossing.x_m, crossing.y_m)) for form in forms if form)
                reaches_m[name] = max(nearest_m, reaches_m.get(name, RADIUS_M[0]))
    for name, reach_m in reaches_m.items():
        index, crossing = assembly.crossings[name]
        assembly.crossings[name] = index, crossing._replace(radius_m=min(crossing.radius_m, reach_m))


def _points(text: str) -> list[Point2]:
    """Points as SUMO writes them: `x,y x,y`, with heights or without."""
    points: list[Point2] = []
    for each in text.split():
        try:
            x, y = map(float, each.split(",")[:2])
        except ValueError:
            x = y = math.nan
        if not math.hypot(x, y) <= FARTHEST_M:
            raise FeatureError(f"{each[:60]!r} is no point in metres", "write x,y")
        points.append((x, y))
    return points


def _link(element: Element, assembly: Assembly) -> RoadLink | None:
    """The link of an edge; None if cars may not use it."""
    lanes = sorted((lane for lane in element.iter("lane") if _for_cars(lane)), key=_index)
    if not lanes:
        return None
    widths = [_positive(lane.get("width"), LANE_M) for lane in lanes]
    forms = [_points(lane.get("shape", "")) for lane in lanes]
    total_m = sum(widths)
    places = tuple(
        Lane(total_m / 2 - right_m - width / 2, 1)
        for right_m, width in zip(accumulate(widths, initial=0.0), widths, strict=False)
    )
    start, end = element.get("from"), element.get("to")
    junctions = [assembly.crossings[name][1] if name in assembly.crossings else None for name in (start, end)]
    first, last = ([] if one is None else [(one.x_m, one.y_m)] for one in junctions)
    try:
        line = Polyline([*first, *_middle(forms, places), *last])
    except ValueError:
        raise FeatureError("the length of its lanes is zero", "write it with netconvert") from None
    speed_m_s = max(_positive(lane.get("speed"), 13.9) for lane in lanes)
    return RoadLink(element.get("id", ""), start, end, line, total_m, places, speed_m_s)


def _for_cars(lane: Element) -> bool:
    allowed, refused = lane.get("allow", "").split(), set(lane.get("disallow", "").split())
    return not refused & _CARS and (not allowed or bool(_CARS.intersection(allowed)))


def _index(lane: Element) -> float:
    """The rightmost lane has index 0."""
    return _positive(lane.get("index"), 0.0)


def _positive(text: str | None, usual: float) -> float:
    try:
        value = usual if text is None else float(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value <= 1000.0:
        raise FeatureError(f"a lane has the number {str(text)[:40]!r}", "write a number from 0 to 1000")
    return value or usual


def _middle(forms: Sequence[list[Point2]], lanes: Sequence[Lane]) -> list[Point2]:
    """The line between the lanes: half-way between the outer two, or next to the first if they have other points."""
    first, last = forms[0], forms[-1]
    if len(first) == len(last):
        return [((ax + bx) / 2, (ay + by) / 2) for (ax, ay), (bx, by) in zip(first, last, strict=True)]
    line = Polyline(first)
    return [line.at(offset_m, -lanes[0].offset_m)[:2] for offset_m in line.offsets_m]
