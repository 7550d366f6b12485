"""Names under which specifications speak of the links and crossings of a network.

Ids of maps are what their makers like: `-103` is the way back of an edge of SUMO, `4711.0` a part of a way of OpenStreetMap. In a
specification each is the name of an object (`dyknow.model.members`): an id that is such a name stays as it is, in another one `_`
stands for each other character, and a number keeps equal ones apart.
"""

from collections.abc import Iterable, Mapping

from dyknow.anchoring.roads.elements import DirectedLink
from dyknow.model.members import MAX_NAME, is_object_name, object_name


def way_name(way: DirectedLink) -> str:
    """How a link in one direction is called on the map: its id, with `-back` from its end to its start."""
    return way.link if way.direction > 0 else f"{way.link}-back"


def object_names(ids: Iterable[str]) -> Mapping[str, str]:
    """The name of each id; ids that are names already keep their own, in any order."""
    found: dict[str, str] = {}
    taken = set[str]()
    for id_ in sorted(set(ids), key=lambda each: (not is_object_name(each), each)):
        name = plain = object_name(id_)
        number = 1
        while name in taken:
            number += 1
            name = f"{plain[: MAX_NAME - 8]}_{number}"
        taken.add(name)
        found[id_] = name
    return found
