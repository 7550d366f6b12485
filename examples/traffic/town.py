"""The map of monitoring.kpl, town.geojson: a unit that puts objects on its roads, and sources with the turns at crossings."""

from pathlib import Path

from dyknow.anchoring.roads.files.formats import read_roads
from dyknow.anchoring.traffic.units import road_units

UNITS = road_units(read_roads((Path(__file__).parent / "town.geojson").read_bytes(), "town.geojson"))
