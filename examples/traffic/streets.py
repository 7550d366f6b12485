"""The map of streets.kpl: the units and sources of the streets in streets.geojson."""

from pathlib import Path

from dyknow.anchoring.roads.files.formats import read_roads
from dyknow.anchoring.traffic.units import road_units

UNITS = road_units(read_roads((Path(__file__).parent / "streets.geojson").read_bytes(), "streets.geojson"))
