"""Any text of a road network: GeoJSON, OpenStreetMap XML or SUMO XML, recognised by how it begins."""

import re
from typing import Final

from dyknow.anchoring.roads.files.geojson import survey_roads
from dyknow.anchoring.roads.files.openstreetmap import survey_openstreetmap
from dyknow.anchoring.roads.files.others import OF_ROOTS
from dyknow.anchoring.roads.files.problems import RoadSurvey
from dyknow.anchoring.roads.files.sumo import survey_sumo
from dyknow.anchoring.roads.network import RoadNetwork

GEOJSON, OPENSTREETMAP, SUMO = "GeoJSON", "OpenStreetMap", "SUMO"
_BEGINNING: Final = 2**16
_COMMENT: Final = re.compile(r"<!--.*?(-->|$)", re.DOTALL)
_ROOT: Final = re.compile(r"<([A-Za-z][\w.-]*)")


def format_of(text: str | bytes) -> str:
    """The format of a text by its root, also of one that is not read; no XML counts as GeoJSON, other XML as SUMO."""
    begin = text[:_BEGINNING] if isinstance(text, str) else text[:_BEGINNING].decode("utf-8", errors="replace")
    if not begin.lstrip("\ufeff \t\r\n").startswith("<"):
        return GEOJSON
    root = _ROOT.search(_COMMENT.sub("", begin))
    name = "" if root is None else root[1]
    if name == "osm":
        return OPENSTREETMAP
    return OF_ROOTS[name].name if name in OF_ROOTS else SUMO


def read_roads(text: str | bytes, file: str = "") -> RoadNetwork:
    """The network of a text of any of these formats.

    Raises:
        RoadsError: it has errors; each names the feature, the cause and the remedy.
    """
    return survey_any(text).required(file)


def survey_any(text: str | bytes) -> RoadSurvey:
    """The network in a text, and every problem in it."""
    readers = {GEOJSON: survey_roads, OPENSTREETMAP: survey_openstreetmap}
    return readers.get(format_of(text), survey_sumo)(text)
