"""Any text of a road network: GeoJSON, OpenStreetMap XML or SUMO XML, recognised by how it begins."""

from anchoring.roads.files.geojson import survey_roads
from anchoring.roads.files.openstreetmap import survey_openstreetmap
from anchoring.roads.files.problems import RoadSurvey
from anchoring.roads.files.sumo import survey_sumo

GEOJSON, OPENSTREETMAP, SUMO = "GeoJSON", "OpenStreetMap", "SUMO"
_BEGINNING = 4096


def format_of(text: str | bytes) -> str:
    """The format of a text; what is no XML is taken for GeoJSON."""
    begin = text[:_BEGINNING] if isinstance(text, str) else text[:_BEGINNING].decode("utf-8", errors="replace")
    if not begin.lstrip("\ufeff \t\r\n").startswith("<"):
        return GEOJSON
    return OPENSTREETMAP if "<osm" in begin else SUMO


def survey_any(text: str | bytes) -> RoadSurvey:
    """What a text has, and every problem in it."""
    readers = {GEOJSON: survey_roads, OPENSTREETMAP: survey_openstreetmap, SUMO: survey_sumo}
    return readers[format_of(text)](text)
