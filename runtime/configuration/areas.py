"""Areas in GeoJSON files, for tasks that take one."""

import json
from pathlib import Path
from typing import Any

from dyknow.federation.messages.contents.areas import MAX_CORNERS
from dyknow.model.errors import WrongCall
from dyknow.proxies.files.named_files import bounded_text


def corners_of(file: str) -> tuple[str, ...]:
    """The corners of the one Polygon in a file, each `LATITUDE LONGITUDE` in degrees.

    Raises:
        WrongCall: it cannot be read, or has no Polygon, several, one with holes or with too many corners.
    """
    try:
        found = list(_polygons(json.loads(bounded_text(Path(file)))))
    except (OSError, TypeError, ValueError, RecursionError) as error:
        raise WrongCall(
            f"area: {file} cannot be read as GeoJSON ({_why(error)}); it is a file with one Polygon."
        ) from None
    if len(found) != 1:
        raise WrongCall(f"area: {file} has {len(found)} Polygons; a file with one is wanted.")
    [rings] = found
    try:
        [[*corners]] = rings
        corners = [(float(latitude), float(longitude)) for longitude, latitude, *_ in corners]
    except (TypeError, ValueError):
        raise WrongCall(
            f"area: the Polygon of {file} is not one ring of [longitude, latitude] without holes."
        ) from None
    corners = corners[:-1] if corners and corners[0] == corners[-1] else corners
    if not 3 <= len(corners) <= MAX_CORNERS:
        raise WrongCall(f"area: the Polygon of {file} has {len(corners)} corners; from 3 to {MAX_CORNERS} are wanted.")
    return tuple(f"{latitude:.7f} {longitude:.7f}" for latitude, longitude in corners)


def _why(error: Exception) -> str:
    return (
        "it is nested too deep" if isinstance(error, RecursionError) else getattr(error, "strerror", None) or str(error)
    )


def _polygons(found: Any) -> Any:
    """The coordinates of every Polygon in a GeoJSON object."""
    if not isinstance(found, dict):
        raise TypeError("an object is expected")
    match found.get("type"):
        case "FeatureCollection":
            for feature in found.get("features", ()):
                yield from _polygons(feature)
        case "Feature":
            yield from _polygons(found.get("geometry"))
        case "Polygon":
            yield found.get("coordinates")
