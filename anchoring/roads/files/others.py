"""Formats of maps that are not read, and which program makes one of them that is."""

from typing import Final, NamedTuple

_DESIGNER: Final = (
    'the CommonRoad Scenario Designer (pip install commonroad-scenario-designer "click<8.2" eclipse-sumo)'
)
_TO_SUMO: Final = "crsumo, which writes a .net.xml into the directory sumo"


class OtherFormat(NamedTuple):
    """A format of others, and what to do with it."""

    name: str
    remedy: str


OF_ROOTS: Final = {
    "OpenDRIVE": OtherFormat(
        "OpenDRIVE",
        "convert it to a network of SUMO (pip install eclipse-sumo): netconvert --opendrive-files FILE -o town.net.xml",
    ),
    "commonRoad": OtherFormat(
        "CommonRoad",
        f"convert it with {_DESIGNER}: crdesigner --input-file FILE --output-file sumo/town.net.xml {_TO_SUMO}",
    ),
    "nodes": OtherFormat("SUMO nodes", "these are nodes alone: netconvert makes a network of SUMO of nodes and edges"),
    "edges": OtherFormat("SUMO edges", "these are edges alone: netconvert makes a network of SUMO of nodes and edges"),
}
"""By the root of an XML text."""
LANELETS: Final = OtherFormat(
    "Lanelet2",
    f"convert it with {_DESIGNER}: crdesigner --input-file FILE --output-file town.xml lanelet2cr, then "
    f"crdesigner --input-file town.xml --output-file sumo/town.net.xml {_TO_SUMO}",
)
"""They are relations of an OpenStreetMap text."""
