"""From `strmgen b = link(a, cu, e, r, m)` to link specifications.

The types of objects are the labels of their streams. What is defined stands for its definition in conditions; that
holds for `thresh`, too, which is then fixed. The units of links are those of `LINK_UNITS`.
"""

from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Final, NamedTuple

from anchoring.links.specification import LinkSpecification as Specification
from anchoring.links.specification import StateUnit, filtered, unlikelihood
from anchoring.links.states import ObjectState
from anchoring.ready import ROAD_NOISE, SLACK_M
from anchoring.roads.network import RoadNetwork
from anchoring.roads.objects import OnRoad
from anchoring.roads.prediction import AlongRoads
from dyknow import Label
from dyknow.model.errors import TextError, did_you_mean
from kpl.checking.definitions import Definitions
from kpl.checking.streams import origin_of
from kpl.checking.symbols import SELF, SymbolTable
from kpl.syntax import specification as spec


def same_state(state: ObjectState, _before: ObjectState | None) -> ObjectState:
    """The unit of types that differ in what they are called."""
    return state


LINK_UNITS: Final[Mapping[str, Callable[[RoadNetwork | None], StateUnit | None]]] = {
    "WorldObject": lambda _roads: filtered,
    "OnRoad": lambda roads: None if roads is None else OnRoad(roads),
    "SameState": lambda _roads: same_state,
}
"""A Kalman filter over positions; the position on the centre of a lane, which needs roads; the state as it is."""


def chained(label: Label, links: Mapping[Label, spec.Link]) -> dict[Label, spec.Link]:
    """The link declarations that are connected with that of a label, in the order given."""
    known, waiting = {label}, [label]
    while waiting:
        one = waiting.pop()
        near = [links[one].source] if one in links else []
        near += [other for other, made in links.items() if made.source == one]
        waiting += [each for each in near if each not in known]
        known.update(near)
    return {each: made for each, made in links.items() if each in known}


def percept_labels(links: Mapping[Label, spec.Link]) -> tuple[Label, ...]:
    """The streams at the beginning of the chains."""
    return tuple(dict.fromkeys(made.source for made in links.values() if made.source not in links))


class LinkageKey(NamedTuple):
    """What a linkage depends on: while it is the same, objects keep their symbols.

    Attributes:
        links: the declarations that are chained, in the order given, with definitions put into their conditions.
        origin: latitude and longitude of x = y = 0, degrees, if that is known.
    """

    links: tuple[tuple[Label, spec.Link], ...]
    roads: RoadNetwork | None
    origin: tuple[float, float] | None


def linkage_of(label: Label, made: spec.Link, symbols: SymbolTable) -> LinkageKey:
    """Of the linkage to which a declaration belongs; raises TextError as `linkage_key`."""
    held = links_in(each.declaration for each in symbols.symbols())
    return linkage_key(chained(label, {**held, label: made}), symbols)


def linkage_key(links: Mapping[Label, spec.Link], symbols: SymbolTable) -> LinkageKey:
    """Of some declarations.

    Raises:
        TextError: a condition is wrong, or types are in a circle.
    """
    definitions = Definitions(symbols)
    _check_circles(links)
    whole = tuple((each, _with_definitions(link, definitions)) for each, link in links.items())
    return LinkageKey(whole, symbols.roads(), origin_of(symbols))


def _with_definitions(made: spec.Link, definitions: Definitions) -> spec.Link:
    establish, reestablish, maintain = (
        definitions.resolved(each, SELF) for each in (made.establish, made.reestablish, made.maintain)
    )
    return replace(made, establish=establish, reestablish=reestablish, maintain=maintain)


def linkages(
    symbols: SymbolTable, wanted: Iterable[spec.Declaration], new: Container[int]
) -> Iterator[tuple[spec.Declaration, LinkageKey]]:
    """The linkages of the declarations that stay; `new` are the identities of the others.

    Raises:
        TextError: as `linkage_key` and `link_specifications`.
    """
    for each in wanted:
        if isinstance(each, spec.GeneratorDeclaration) and isinstance(each.made, spec.Link) and id(each) not in new:
            key = linkage_of(each.label, each.made, symbols)
            for _, made in key.links:
                _unit(made, key.roads)
            yield each, key


def link_specifications(key: LinkageKey) -> tuple[Specification, ...]:
    """What chained declarations come to.

    Raises:
        TextError: there is no such unit of links, or it needs roads.
    """
    return tuple(_specification(label, made, key.roads) for label, made in key.links)


def _specification(label: Label, made: spec.Link, roads: RoadNetwork | None) -> Specification:
    unit = _unit(made, roads)
    found = Specification(
        str(made.source), str(label), made.establish, made.reestablish, made.maintain, unit, score=unlikelihood
    )
    if roads is None:
        return found
    features = {"on_road": lambda state: roads.on_road(state.x_m, state.y_m, SLACK_M)}
    return replace(
        found, features=features, predictor=AlongRoads(roads, noise=ROAD_NOISE) if made.unit == "OnRoad" else None
    )


def _unit(made: spec.Link, roads: RoadNetwork | None) -> StateUnit:
    make = LINK_UNITS.get(made.unit)
    if make is None:
        hint = did_you_mean(made.unit, tuple(LINK_UNITS))
        raise TextError.at(made.place, f"{made.unit} makes no states of objects.{hint}", repair=next(iter(LINK_UNITS)))
    unit = make(roads)
    if unit is None:
        raise TextError.at(made.place, f"{made.unit} needs roads", repair='roads "town.geojson", or --roads FILE')
    return unit


def _check_circles(links: Mapping[Label, spec.Link]) -> None:
    for label in links:
        seen = {label}
        below = links[label].source
        while below in links:
            if below in seen:
                raise TextError.at(links[below].place, f"objects of {below} are linked to themselves", repair="a chain")
            seen.add(below)
            below = links[below].source


def links_in(declarations: Iterable[spec.Declaration]) -> dict[Label, spec.Link]:
    """The link declarations of a specification."""
    return {
        each.label: each.made
        for each in declarations
        if isinstance(each, spec.GeneratorDeclaration) and isinstance(each.made, spec.Link)
    }
