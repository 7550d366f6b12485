"""Roads and the links on them: where both lie, and what states what is on a road."""

from collections.abc import Sequence
from math import hypot
from typing import Final

from dyknow import Label, Sort
from dyknow.anchoring.links.specification import FROM, TO
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.kpl.checking.streams import ORIGIN
from dyknow.kpl.checking.symbols import LINK_UNITS
from dyknow.kpl.syntax import specification as spec
from dyknow.model.errors import TextError
from dyknow.navigation.geodesy import LocalFrame
from dyknow.reasoning.formulas.tree import Feature, Node, Object, Variable, walk

ON_ROADS: Final = "on_road"
APART_M: Final = 1.0
"""Two origins that are closer are one."""


def check_origin(place: Node, roads: RoadNetwork | None, origin: tuple[float, float] | None) -> None:
    """Roads and objects have one frame: raises TextError if x = y = 0 of the roads is somewhere else than is defined."""
    if roads is None or roads.frame is None or origin is None:
        return
    apart_m = roads.apart_m(*origin)
    if apart_m > APART_M:
        latitude_deg, longitude_deg = roads.frame.latitude_deg, roads.frame.longitude_deg
        said = f"{' and '.join(ORIGIN)} are {apart_m:.0f} m from the place where x_m and y_m of the roads are 0"
        repair = f"define {ORIGIN[0]} = {latitude_deg:.7f} and define {ORIGIN[1]} = {longitude_deg:.7f}, or neither"
        raise TextError.at(place.place, said, repair=repair)


def check_cameras(place: Node, origin: tuple[float, float] | None, cameras: LocalFrame | None) -> None:
    """Objects have the frame of the platform's cameras: raises TextError if their x = y = 0 is somewhere else."""
    if origin is None or cameras is None:
        return
    north_m, east_m, _ = cameras.to_ned(*origin, 0.0)
    if (apart_m := hypot(north_m, east_m)) > APART_M:
        said = f"x_m and y_m of the roads are 0 at {origin[0]:.7f}, {origin[1]:.7f}, {apart_m:.0f} m from those of the cameras"
        repair = f'"origin": [{cameras.longitude_deg:.7f}, {cameras.latitude_deg:.7f}] in the file of roads'
        raise TextError.at(place.place, said, repair=repair)


def says_on_road(link: spec.Link) -> bool:
    """Whether a condition asks what is on a road."""
    formulas = (link.establish, link.reestablish, link.maintain)
    found = (each for formula in formulas for each in walk(formula) if isinstance(each, Feature))
    return any(each.name == ON_ROADS and {FROM, TO} & {*map(_name, each.objects)} for each in found)


def _name(one: Object) -> str:
    return one.name if isinstance(one, Variable) else str(one)


def check_on_road(linked: Sequence[tuple[Label, object]], percepts: Sequence[Sort]) -> None:
    """Without roads nothing is on one, unless percepts say so: raises TextError for a condition that is never true.

    What units of users say is not known.
    """
    links = [made for _, made in linked if isinstance(made, spec.Link)]
    says = any(field.name == ON_ROADS for sort in percepts for field in sort.fields)
    if says or any(link.unit not in LINK_UNITS for link in links):
        return
    for made in links:
        if says_on_road(made):
            said = "on_road is never true: there are no roads, and percepts do not say it"
            raise TextError.at(made.place, said, repair='roads "town.geojson", or --roads FILE')
