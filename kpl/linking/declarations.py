"""From `strmgen b = link(a, cu, e, r, m)` to link specifications.

The types of objects are the labels of their streams. Constants that are defined stand for their values in conditions; that
holds for `thresh`, too, which is then fixed. The units of links are those of `LINK_UNITS`.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, Final

from anchoring.links.specification import LinkSpecification as Specification
from anchoring.links.specification import StateUnit, filtered, unlikelihood
from anchoring.links.states import ObjectState
from anchoring.ready import ROAD_NOISE, SLACK_M
from anchoring.roads.network import RoadNetwork
from anchoring.roads.objects import OnRoad
from anchoring.roads.prediction import AlongRoads
from dyknow import Label
from dyknow.model.errors import TextError, did_you_mean
from kpl.checking.symbols import Constant, constant_of
from kpl.syntax import specification as spec
from reasoning.formulas import tree


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


def link_specifications(
    links: Mapping[Label, spec.Link], constants: Mapping[str, Constant], roads: RoadNetwork | None = None
) -> tuple[Specification, ...]:
    """What chained declarations come to.

    Raises:
        TextError: there is no such unit of links, or it needs roads; types are in a circle.
    """
    _check_circles(links)
    return tuple(_specification(label, made, constants, roads) for label, made in links.items())


def _specification(
    label: Label, made: spec.Link, constants: Mapping[str, Constant], roads: RoadNetwork | None
) -> Specification:
    establish, reestablish, maintain = (
        _with_constants(each, constants) for each in (made.establish, made.reestablish, made.maintain)
    )
    unit = _unit(made, roads)
    found = Specification(str(made.source), str(label), establish, reestablish, maintain, unit, score=unlikelihood)
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
        raise TextError.at(made.place, f"{made.unit} needs roads", repair="dyknow link FILE.kpl --roads FILE.geojson")
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


def _with_constants(node: Any, constants: Mapping[str, Constant]) -> Any:
    """A formula with the values of constants for their names."""
    if isinstance(node, tuple):
        return tuple(_with_constants(one, constants) for one in node)
    if isinstance(node, tree.Feature) and not node.objects and node.name in constants:
        value = constants[node.name]
        return value if isinstance(value, tree.Duration) else tree.Const(value, place=node.place)
    if not isinstance(node, tree.Node):
        return node
    changed = {each.name: _with_constants(getattr(node, each.name), constants) for each in fields(node) if each.init}
    return replace(node, **changed)


def links_in(declarations: Iterable[spec.Declaration]) -> dict[Label, spec.Link]:
    """The link declarations of a specification."""
    return {
        each.label: each.made
        for each in declarations
        if isinstance(each, spec.GeneratorDeclaration) and isinstance(each.made, spec.Link)
    }


def constants_in(declarations: Sequence[spec.Declaration]) -> dict[str, Constant]:
    """The constants that a specification defines."""
    defined = [each for each in declarations if isinstance(each, spec.Define) and not each.feature.objects]
    found = {each.feature.name: constant_of(each) for each in defined}
    return {name: value for name, value in found.items() if value is not None}
