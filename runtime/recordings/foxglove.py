"""Foxglove's messages, as JSON: positions, poses, a scene and a log, so that a recording opens in its panels as it is.

Instants are microseconds of federation time, positions WGS-84, the scene a frame `map`: metres east, north and up of
where the first platform was first seen.
"""

import json
import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, Final

Json = dict[str, Any]
FRAME: Final = "map"
LOCATION, POSE, LOG, SCENE = "foxglove.LocationFix", "foxglove.PoseInFrame", "foxglove.Log", "foxglove.SceneUpdate"
INFO, WARNING, ERROR = 2, 3, 4
"""Levels of `foxglove.Log`."""
UNKNOWN_COVARIANCE, DIAGONAL_COVARIANCE = 0, 2
_LIFETIME_US = 2_000_000
_GREEN, _RED = (0.1, 0.6, 0.3, 1.0), (0.84, 0.15, 0.16, 1.0)
_NUMBER, _TEXT, _BOOL, _INTEGER = ({"type": name} for name in ("number", "string", "boolean", "integer"))


def _object(**fields: Any) -> Json:
    return {"type": "object", "properties": fields}


def _list(of: Json) -> Json:
    return {"type": "array", "items": of}


_TIME = _object(sec=_INTEGER, nsec=_INTEGER)
_VECTOR = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER)
_POSE = _object(position=_VECTOR, orientation=_object(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER))
_COLOUR = _object(r=_NUMBER, g=_NUMBER, b=_NUMBER, a=_NUMBER)
_ARROW = _object(
    pose=_POSE, shaft_length=_NUMBER, shaft_diameter=_NUMBER, head_length=_NUMBER, head_diameter=_NUMBER, color=_COLOUR
)
_LINE = _object(
    type=_INTEGER, pose=_POSE, thickness=_NUMBER, scale_invariant=_BOOL, points=_list(_VECTOR), color=_COLOUR,
    colors=_list(_COLOUR), indices=_list(_INTEGER),
)  # fmt: skip
_WORDS = _object(pose=_POSE, billboard=_BOOL, font_size=_NUMBER, scale_invariant=_BOOL, color=_COLOUR, text=_TEXT)
_ENTITY = _object(
    timestamp=_TIME, frame_id=_TEXT, id=_TEXT, lifetime=_TIME, frame_locked=_BOOL,
    metadata=_list(_object(key=_TEXT, value=_TEXT)), arrows=_list(_ARROW), lines=_list(_LINE), texts=_list(_WORDS),
    **{name: _list({"type": "object"}) for name in ("cubes", "spheres", "cylinders", "triangles", "models")},
)  # fmt: skip
_SCHEMAS: Mapping[str, Json] = {
    LOCATION: _object(
        timestamp=_TIME, frame_id=_TEXT, latitude=_NUMBER, longitude=_NUMBER, altitude=_NUMBER,
        position_covariance=_list(_NUMBER), position_covariance_type=_INTEGER,
    ),
    POSE: _object(timestamp=_TIME, frame_id=_TEXT, pose=_POSE),
    LOG: _object(timestamp=_TIME, level=_INTEGER, message=_TEXT, name=_TEXT, file=_TEXT, line=_INTEGER),
    SCENE: _object(deletions=_list(_object(timestamp=_TIME, type=_INTEGER, id=_TEXT)), entities=_list(_ENTITY)),
}  # fmt: skip


@cache
def schema_of(name: str) -> bytes:
    """The JSON schema of a message, by the name under which Foxglove knows it; of another name: any object."""
    return json.dumps({"title": name, **_SCHEMAS.get(name, {"type": "object"})}).encode()


def stamp(at_us: int) -> Json:
    """An instant, or a length of time."""
    return {"sec": at_us // 1_000_000, "nsec": at_us % 1_000_000 * 1000}


def location_fix(
    valid_us: int, latitude_deg: float, longitude_deg: float, altitude_m: float, variances_m2: Sequence[float] = ()
) -> Json:
    """Where a platform was; `variances_m2` east, north and up, if they are known."""
    rows = [0.0] * 9
    for at, variance_m2 in enumerate(variances_m2):
        rows[4 * at] = variance_m2
    return {
        "timestamp": stamp(valid_us),
        "frame_id": FRAME,
        "latitude": latitude_deg,
        "longitude": longitude_deg,
        "altitude": altitude_m,
        "position_covariance": rows,
        "position_covariance_type": DIAGONAL_COVARIANCE if variances_m2 else UNKNOWN_COVARIANCE,
    }


def pose(east_m: float, north_m: float, up_m: float, heading_rad: float = 0.0) -> Json:
    """A place in the frame of the scene, level, turned so far from north to east."""
    yaw = math.pi / 2 - heading_rad
    return {
        "position": {"x": east_m, "y": north_m, "z": up_m},
        "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)},
    }


def pose_in_frame(valid_us: int, place: Json) -> Json:
    """Where a platform was, in the frame of the scene."""
    return {"timestamp": stamp(valid_us), "frame_id": FRAME, "pose": place}


def log_entry(at_us: int, level: int, message: str, name: str) -> Json:
    """A line of the log; `name` says what it is about."""
    return {"timestamp": stamp(at_us), "level": level, "message": message, "name": name, "file": "", "line": 0}


def scene(*entities: Json, deleted: Sequence[Json] = ()) -> Json:
    """A scene update: new entities, and deleted ones."""
    return {"deletions": [*deleted], "entities": [*entities]}


def deletion(at_us: int, name: str) -> Json:
    """The entity of that name goes."""
    return {"timestamp": stamp(at_us), "type": 0, "id": name}


def platform_entity(valid_us: int, unit: str, place: Json) -> Json:
    """A platform: an arrow as it is headed, and its name."""
    arrow = {
        "pose": place, "shaft_length": 6.0, "shaft_diameter": 1.5, "head_length": 4.0, "head_diameter": 4.0,
        "color": _colour(_GREEN),
    }  # fmt: skip
    position = {**place["position"], "z": place["position"]["z"] + 4.0}
    words = {
        "pose": {**place, "position": position}, "billboard": True, "font_size": 14.0, "scale_invariant": True,
        "color": _colour(_GREEN), "text": unit,
    }  # fmt: skip
    return _entity(valid_us, f"platform {unit}", arrows=[arrow], texts=[words], lifetime=stamp(_LIFETIME_US))


def alarm_entity(valid_us: int, name: str, places: Sequence[Json]) -> Json:
    """An open alarm: a line between those that it is about."""
    line = {
        "type": 0, "pose": pose(0.0, 0.0, 0.0, math.pi / 2), "thickness": 3.0, "scale_invariant": True,
        "points": [place["position"] for place in places], "color": _colour(_RED), "colors": [], "indices": [],
    }  # fmt: skip
    return _entity(valid_us, name, lines=[line])


def _entity(valid_us: int, name: str, **parts: Any) -> Json:
    kinds = ("arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")
    return {
        "timestamp": stamp(valid_us),
        "frame_id": FRAME,
        "id": name,
        "lifetime": stamp(0),
        "frame_locked": False,
        "metadata": [],
        **{kind: [] for kind in kinds},
        **parts,
    }


def _colour(rgba: Sequence[float]) -> Json:
    return dict(zip("rgba", rgba, strict=True))
