"""Road networks as GeoJSON (RFC 7946): a FeatureCollection of Points, LineStrings and Polygons.

    Point       `id`, `kind`: "crossing", `radius_m` (8)
    LineString  `id`, `from`, `to` (absent or null: the road leaves the network there), `width_m` (7), `lanes` (2),
                `speed_m_s` (13.9), `oneway` (false)
    Polygon     `id`, `kind`: "road", "crossing" or another, `of`: the link or crossing that it belongs to

`lanes` is a number of lanes, or a list of the signed offsets of their centres, positive on the right of the direction
from -> to. The collection may say `"frame": "local"`: coordinates are metres, x east and y north. Otherwise they are
longitude and latitude (WGS 84). `origin`, [longitude, latitude], is where x = y = 0 is on earth; without it this is the
median of where features begin and end, or unknown for a local frame. `"traffic": "left"` is for countries that drive on
the left.
"""

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from statistics import median
from typing import Any, Final, NamedTuple

from dyknow.anchoring.roads.elements import Crossing, Lane, RoadArea, RoadLink
from dyknow.anchoring.roads.files.assembly import Assembly
from dyknow.anchoring.roads.files.lanes import MOST_LANES, even_lanes, offset_lanes
from dyknow.anchoring.roads.files.problems import MOST_BYTES, FeatureError, Problems, RoadSurvey, Tries
from dyknow.anchoring.roads.geometry import Point2, Polyline
from dyknow.navigation.geodesy import LocalFrame

MOST_FEATURES: Final = 1_000_000
FARTHEST_M: Final = 500_000.0
"""From the origin; the plane that touches the earth there is no map of more."""
LONGEST_ID: Final = 200
WIDTH_M: Final = 7.0
RADIUS_M: Final = 8.0
SPEED_M_S: Final = 13.9
_WIDEST_M: Final = 200.0
_GEOMETRIES: Final = {"Point": 0, "LineString": 1, "Polygon": 2}


class _Feature(NamedTuple):
    """A feature whose coordinates are numbers: a line is one ring of them, and a point a ring of one."""

    number: int
    id: str
    kind: str
    rings: list[list[Point2]]
    properties: Mapping[str, Any]


def survey_roads(text: str | bytes) -> RoadSurvey:
    """The network in a GeoJSON text, and every problem in it."""
    problems = Problems()
    collection = _collection(text, problems)
    if collection is None:
        return problems.survey(None)
    is_local, left_hand = collection.get("frame") == "local", collection.get("traffic") == "left"
    features = list(_features(collection["features"], problems, is_local=is_local, left_hand=left_hand))
    frame = _frame(collection, features, problems, is_local=is_local)
    assembly = Assembly(problems)
    for feature in features:
        tries = Tries()
        made = _made(feature, None if is_local else frame, tries, left_hand=left_hand)
        if tries.wrong:
            problems.errors(feature.number, feature.id, tries.wrong)
        elif made is None:
            what = f"a Point of kind {_brief(feature.properties['kind'])} is left out"
            problems.warning(feature.number, feature.id, what, 'crossings have "kind": "crossing"')
        else:
            assembly.add(feature.number, made)
    if not assembly.links and not problems.has_errors:
        problems.warning(None, None, "there is no LineString, and so no road", "a link is a LineString with an id")
    return problems.survey(assembly.network(frame))


def _collection(text: str | bytes, problems: Problems) -> dict[str, Any] | None:
    """The object of the text, if it is a FeatureCollection."""
    if len(text) > MOST_BYTES:
        problems.error(None, None, f"it has {len(text)} bytes, at most {MOST_BYTES} are read", "cut the network")
        return None
    try:
        decoded = text.decode("utf-8-sig") if isinstance(text, bytes) else text
        found: Any = json.loads(decoded, parse_constant=float)
    except (ValueError, RecursionError) as wrong:
        problems.error(None, None, f"it is no JSON: {wrong}", "write a GeoJSON FeatureCollection")
        return None
    if not isinstance(found, dict) or found.get("type") != "FeatureCollection":
        problems.error(
            None, None, "it is no FeatureCollection", 'write {"type": "FeatureCollection", "features": [...]}'
        )
        return None
    features = found.get("features")
    if not isinstance(features, list) or len(features) > MOST_FEATURES:
        what = (
            f"at most {MOST_FEATURES} features are read" if isinstance(features, list) else "it has no list of features"
        )
        problems.error(None, None, what, 'write "features": [...]')
        return None
    for member, allowed in (("frame", ("local", "wgs84", "WGS84", None)), ("traffic", ("left", "right", None))):
        if found.get(member) not in allowed:
            problems.error(
                None, None, f'"{member}" is {_brief(found[member])}',
                f"it is {' or '.join(json.dumps(each) for each in allowed[:2])}",
            )  # fmt: skip
    return None if problems.has_errors else found


def _features(features: Sequence[Any], problems: Problems, *, is_local: bool, left_hand: bool) -> Iterator[_Feature]:
    """The features that can be read; of others all that is wrong."""
    check = _in_reach if is_local else _on_earth
    for index, feature in enumerate(features):
        tries = Tries()
        parts = tries(_parts, feature)
        if parts is None:
            problems.errors(index, None, tries.wrong)
            continue
        kind, coordinates, properties = parts
        name = tries(_id, feature, properties)
        rings = tries(_checked, coordinates, check)
        if name is None or rings is None:
            _attributes(kind, properties, tries, left_hand=left_hand)
            problems.errors(index, name, tries.wrong)
        else:
            yield _Feature(index, name, kind, rings, properties)


def _checked(rings: list[list[Any]], check: Callable[[Point2], Point2]) -> list[list[Point2]]:
    return [[check(_pair(each)) for each in ring] for ring in rings]


def _frame(
    collection: Mapping[str, Any], features: Sequence[_Feature], problems: Problems, *, is_local: bool
) -> LocalFrame | None:
    """Where x = y = 0 is on earth."""
    origin: Point2 | None = None
    if collection.get("origin") is not None:
        try:
            origin = _on_earth(_pair(collection["origin"]))
        except FeatureError as wrong:
            problems.error(None, None, f'"origin": {wrong.message}', "write [longitude, latitude] in degrees")
    elif features and not is_local:
        origin = _middle([end for each in features for end in (each.rings[0][0], each.rings[0][-1])])
    return None if origin is None else LocalFrame(origin[1], origin[0], 0.0)


def _middle(places: Sequence[Point2]) -> Point2:
    """The median longitude and latitude, which one wrong coordinate does not move; also across the date line."""
    first = places[0][0]
    longitude_deg = first + median(math.remainder(place[0] - first, 360.0) for place in places)
    return math.remainder(longitude_deg, 360.0), median(place[1] for place in places)


def _local(rings: list[list[Point2]], frame: LocalFrame | None) -> list[list[Point2]]:
    """Longitude and latitude as metres east and north; without a frame they are metres."""
    return rings if frame is None else [[_turned(place, frame) for place in ring] for ring in rings]


def _turned(place: Point2, frame: LocalFrame) -> Point2:
    north_m, east_m, down_m = frame.to_ned(place[1], place[0], 0.0)
    if not max(abs(north_m), abs(east_m), abs(down_m)) <= FARTHEST_M:
        raise FeatureError(
            f"{list(place)} is farther than {FARTHEST_M / 1000:g} km from the origin",
            "cut the network, or correct the coordinate or the origin",
        )
    return east_m, north_m


def _in_reach(pair: Point2) -> Point2:
    if max(abs(pair[0]), abs(pair[1])) > FARTHEST_M:
        raise FeatureError(f"{list(pair)} is farther than {FARTHEST_M / 1000:g} km from the origin", "write metres")
    return pair


def _parts(feature: Any) -> tuple[str, list[list[Any]], Mapping[str, Any]]:
    """Kind of geometry, coordinates as rings, properties."""
    if not isinstance(feature, dict) or feature.get("type") != "Feature":
        raise FeatureError("it is no Feature", 'write {"type": "Feature", "geometry": ..., "properties": ...}')
    geometry, properties = feature.get("geometry"), feature.get("properties")
    if not isinstance(geometry, dict) or str(geometry.get("type")) not in _GEOMETRIES:
        found = geometry.get("type") if isinstance(geometry, dict) else geometry
        raise FeatureError(f"its geometry is {_brief(found)}", "Point, LineString and Polygon are read")
    if not isinstance(properties, dict):
        raise FeatureError("it has no properties", 'write "properties": {"id": ...}')
    kind, coordinates = geometry["type"], geometry.get("coordinates")
    depth = _GEOMETRIES[kind]
    rings = [[coordinates]] if depth == 0 else [coordinates] if depth == 1 else coordinates
    if not isinstance(rings, list) or not rings or not all(isinstance(ring, list) and ring for ring in rings):
        raise FeatureError(f"the coordinates of its {kind} are {_brief(coordinates)}", "write a list of [x, y]")
    return kind, rings, properties


def _id(feature: Mapping[str, Any], properties: Mapping[str, Any]) -> str:
    name = properties.get("id", feature.get("id"))
    if isinstance(name, int) and not isinstance(name, bool) and abs(name) < 2**63:
        return str(name)
    if isinstance(name, str) and 0 < len(name) <= LONGEST_ID and name.isprintable():
        return name
    raise FeatureError(
        "it has no id" if name is None else f"its id is {_brief(name)}",
        f'write "id": a text of at most {LONGEST_ID} printable characters, or a whole number',
    )


def _made(
    feature: _Feature, frame: LocalFrame | None, tries: Tries, *, left_hand: bool
) -> Crossing | RoadLink | RoadArea | None:
    """The element that a feature declares; None for Points of other kinds, and if it has an error."""
    kind, name = feature.kind, feature.id
    attributes = _attributes(kind, feature.properties, tries, left_hand=left_hand)
    rings = tries(_local, feature.rings, frame)
    if rings is None:
        return None
    if kind == "LineString":
        line = tries(_line, rings[0])
        if line is None or attributes is None:
            return None
        start, end, width_m, lanes, speed_m_s = attributes
        return RoadLink(name, start, end, line, width_m, lanes, speed_m_s)
    if kind == "Polygon":
        tries(_closed, rings)
        return (
            None if tries.wrong or attributes is None else RoadArea(name, attributes[0], _rings(rings), attributes[1])
        )
    (x_m, y_m), = rings[0]  # fmt: skip
    return None if attributes is None else Crossing(name, x_m, y_m, *attributes)


def _attributes(kind: str, properties: Mapping[str, Any], tries: Tries, *, left_hand: bool) -> tuple[Any, ...] | None:
    """The attributes in the properties of a geometry; None for Points of other kinds, and in case of errors."""
    if kind == "Point":
        if properties.get("kind") is None:
            tries.add("a Point has a kind", 'write "kind": "crossing"')
        if properties.get("kind") != "crossing":
            return None
        found: tuple[Any, ...] = (tries(_number, properties, "radius_m", RADIUS_M, 0.1, 1000.0),)
    elif kind == "Polygon":
        found = properties.get("kind"), properties.get("of")
        if not isinstance(found[0], str) or not isinstance(found[1], str | None):
            tries.add("a Polygon has a kind", 'write "kind": "road" or "crossing"')
    else:
        width_m = tries(_number, properties, "width_m", WIDTH_M, 0.1, _WIDEST_M)
        found = (
            tries(_end, properties, "from"), tries(_end, properties, "to"), width_m,
            tries(_lanes, properties, _WIDEST_M if width_m is None else width_m, left_hand),
            tries(_number, properties, "speed_m_s", SPEED_M_S, 0.01, 200.0),
        )  # fmt: skip
    return None if tries.wrong else found


def _closed(rings: list[list[Point2]]) -> None:
    if any(len(ring) < 4 or ring[0] != ring[-1] for ring in rings):
        raise FeatureError("a ring of its Polygon is not closed", "four points or more, the last one as the first")
    import shapely

    polygon = shapely.Polygon(rings[0], rings[1:])
    if not polygon.is_valid:
        raise FeatureError(
            f"its Polygon is not valid: {shapely.is_valid_reason(polygon)}", "let no border cross another"
        )


def _rings(rings: list[list[Point2]]) -> tuple[tuple[Point2, ...], ...]:
    return tuple(map(tuple, rings))


def _line(points: list[Point2]) -> Polyline:
    try:
        return Polyline(points)
    except ValueError:
        raise FeatureError("its length is zero", "a LineString has two different points") from None


def _end(properties: Mapping[str, Any], role: str) -> str | None:
    value = properties.get(role)
    if value is None or isinstance(value, str):
        return value
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) < 2**63:
        return str(value)
    raise FeatureError(f'"{role}" is {_brief(value)}', "write the id of a crossing")


def _lanes(properties: Mapping[str, Any], width_m: float, left_hand: bool) -> tuple[Lane, ...]:
    lanes, one_way = properties.get("lanes"), properties.get("oneway", False)
    if not isinstance(one_way, bool):
        raise FeatureError(f'"oneway" is {_brief(one_way)}', "write true or false")
    if isinstance(lanes, list) and 0 < len(lanes) <= MOST_LANES:
        offsets = [_number({"lanes": each}, "lanes", 0.0, -width_m / 2, width_m / 2) for each in lanes]
        return offset_lanes(offsets, one_way=one_way, left_hand=left_hand)
    count = (1 if one_way else 2) if lanes is None else lanes
    if isinstance(count, int) and not isinstance(count, bool) and 0 < count <= MOST_LANES:
        return even_lanes(count, width_m, one_way=one_way, left_hand=left_hand)
    raise FeatureError(
        f'"lanes" is {_brief(lanes)}', f"write how many, 1 to {MOST_LANES}, or the offsets of their centres in metres"
    )


def _number(properties: Mapping[str, Any], name: str, default: float, least: float, most: float) -> float:
    value = properties.get(name)
    if value is None:
        return default
    if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= most:
        raise FeatureError(f'"{name}" is {_brief(value)}', f"write a number from {least:g} to {most:g}")
    return float(value)


def _pair(coordinates: Any) -> Point2:
    """The first two of a position; heights are left out."""
    if isinstance(coordinates, list) and 2 <= len(coordinates) <= 4:
        x, y = coordinates[0], coordinates[1]
        numbers = type(x) in {int, float} and type(y) in {int, float}
        if numbers and abs(x) < 1e12 and abs(y) < 1e12:
            return float(x), float(y)
    raise FeatureError(f"a coordinate is {_brief(coordinates)}", "write [x, y], two finite numbers")


def _on_earth(pair: Point2) -> Point2:
    if not (abs(pair[0]) <= 180.0 and abs(pair[1]) <= 90.0):
        raise FeatureError(
            f"{list(pair)} is no longitude and latitude",
            'for coordinates in metres write "frame": "local" in the collection',
        )
    return pair


def _brief(value: Any) -> str:
    """A value as the text has it, cut."""
    try:
        shown = json.dumps(value)
    except (ValueError, RecursionError):
        shown = str(type(value))
    return shown if len(shown) <= 60 else f"{shown[:57]}..."
