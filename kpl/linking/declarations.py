"""From `strmgen b = link(a, cu, e, r, m) with ...` and `strmgen c = composite(b, t, s)` to link specifications.

The types of objects are the labels of their streams; several links with one label lead into one type. Definitions are
expanded in conditions; so is that of `thresh`, which is then fixed. The units of links are those of `LINK_UNITS`, and
those of users.
"""

from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final, NamedTuple, TypeAlias

from dyknow import Label, Sort
from dyknow.anchoring.belief.weighing import AssociationWeights
from dyknow.anchoring.links.composites import CompositeSpecification
from dyknow.anchoring.links.deciding.gating import gate_of
from dyknow.anchoring.links.motion import MotionPredictor
from dyknow.anchoring.links.prediction import HabitualMotion, Predictor
from dyknow.anchoring.links.specification import FROM, TO, USUAL, Lasting, StateUnit, distance, filtered, unlikelihood
from dyknow.anchoring.links.specification import LinkSpecification as Specification
from dyknow.anchoring.links.states import ObjectState
from dyknow.anchoring.links.structures import GENERAL, AnySpecification
from dyknow.anchoring.percepts.records import is_geographic, lacks_of
from dyknow.anchoring.ready import ALONG_ROADS, ANYWHERE, CANDIDATES, ROAD_NOISE, SLACK_M
from dyknow.anchoring.roads.hypotheses import Pruning
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.anchoring.roads.objects import OnRoad
from dyknow.anchoring.roads.prediction import AlongRoads
from dyknow.kpl.checking.definitions import Definitions
from dyknow.kpl.checking.link_conditions import streams_of_ends
from dyknow.kpl.checking.streams import Streams, origin_of
from dyknow.kpl.checking.symbols import GENERATOR, SELF, SymbolTable
from dyknow.kpl.linking.roads import ON_ROADS, check_cameras, check_origin
from dyknow.kpl.syntax import specification as spec
from dyknow.kpl.syntax.link_options import LinkOptions, print_options
from dyknow.model.errors import TextError, did_you_mean
from dyknow.reasoning.formulas.tree import Formula, instantiate

Linked: TypeAlias = spec.Link | spec.Composite
LinkDeclarations: TypeAlias = Sequence[tuple[Label, Linked]]
UserUnit: TypeAlias = Callable[[Label, spec.Link], StateUnit | None]
"""The unit of a user that a link names; None: there is none of that name."""


def same_state(state: ObjectState, _before: ObjectState | None) -> ObjectState:
    """The unit of links between types that differ in name only."""
    return state


LINK_UNITS: Final[Mapping[str, Callable[[RoadNetwork | None], StateUnit | None]]] = {
    "WorldObject": lambda _roads: filtered,
    "OnRoad": lambda roads: None if roads is None else OnRoad(roads),
    "SameState": lambda _roads: same_state,
}
"""A Kalman filter over positions; the position on the centre of a lane, which needs roads; the state as it is."""
_SCORES: Final = {"likelihood": unlikelihood, "distance": distance}


def chained(label: Label, links: LinkDeclarations) -> tuple[tuple[Label, Linked], ...]:
    """The declarations that are connected with a label, in the order given."""
    known, waiting = {label}, [label]
    while waiting:
        one = waiting.pop()
        near = {made.source for made_label, made in links if made_label == one}
        near |= {made_label for made_label, made in links if made.source == one}
        waiting += near - known
        known |= near
    return tuple((each, made) for each, made in links if each in known)


def percept_labels(links: LinkDeclarations) -> tuple[Label, ...]:
    """The streams at the beginning of the chains."""
    made_labels = {label for label, _ in links}
    return tuple(dict.fromkeys(made.source for _, made in links if made.source not in made_labels))


class LinkageKey(NamedTuple):
    """The inputs of a linkage: while they are equal, objects keep their symbols.

    Attributes:
        links: the declarations that are chained, in the order given, with definitions put into their conditions.
        origin: latitude and longitude of x = y = 0, degrees, if that is known.
        beliefs: by whose world models candidates are weighed, by name.
        streams: of each declaration, the features of one end in its conditions that are streams, and no attributes.
    """

    links: tuple[tuple[Label, Linked], ...]
    roads: RoadNetwork | None
    origin: tuple[float, float] | None
    beliefs: tuple[tuple[str, spec.Belief], ...] = ()
    streams: tuple[frozenset[str], ...] = ()


def linkage_of(label: Label, made: Linked, symbols: SymbolTable) -> LinkageKey:
    """Of the linkage to which a declaration belongs; raises TextError as `linkage_key`."""
    held = links_in(each.declaration for each in symbols.symbols())
    return linkage_key(chained(label, held if (label, made) in held else (*held, (label, made))), symbols)


def linkage_key(links: LinkDeclarations, symbols: SymbolTable) -> LinkageKey:
    """Of some declarations.

    Raises:
        TextError: a condition is wrong, types are in a circle, or roads lie somewhere else than objects.
    """
    definitions = Definitions(symbols)
    _check_types(links)
    whole = tuple((each, _with_definitions(made, definitions)) for each, made in links)
    roads, origin = symbols.roads(), origin_of(symbols)
    for _, made in links[:1]:
        check_origin(made, roads, origin)
        check_cameras(made, origin, symbols.known.frame)
    known = Streams(symbols)
    streams = tuple(frozenset(streams_of_ends(made, label, known)) for label, made in whole)
    return LinkageKey(whole, roads, origin, tuple(_beliefs(links, symbols)), streams)


def _beliefs(links: LinkDeclarations, symbols: SymbolTable) -> Iterator[tuple[str, spec.Belief]]:
    for name, place in {made.options.weigh: made.place for _, made in links if isinstance(made, spec.Link)}.items():
        if name:
            declared = symbols.named(GENERATOR, Label(name))
            made = None if declared is None else spec.making_of(declared)
            if not isinstance(made, spec.Belief):
                said = f"{name} is no stream of beliefs, by which candidates could be weighed"
                raise TextError.at(place, said, repair=f'strmgen {name} = believe("world.toml", percepts as camera)')
            yield name, made


def _with_definitions(made: Linked, definitions: Definitions) -> Linked:
    def whole(condition: Formula) -> Formula:
        """With definitions put in, over objects called `from` and `to`, as gates are derived for."""
        return instantiate(instantiate(definitions.resolved(condition, SELF), FROM, FROM), TO, TO)

    if isinstance(made, spec.Composite):
        return replace(made, together=whole(made.together), stays=whole(made.stays))
    establish, reestablish, maintain = map(whole, (made.establish, made.reestablish, made.maintain))
    return replace(made, establish=establish, reestablish=reestablish, maintain=maintain)


def linkages(
    symbols: SymbolTable, wanted: Iterable[spec.Declaration], new: Container[int]
) -> Iterator[tuple[spec.Declaration, LinkageKey]]:
    """The linkages of the declarations that stay; `new` are the identities of the others.

    Raises:
        TextError: as `linkage_key`, or the roads that a link needs are gone.
    """
    for each in wanted:
        if isinstance(each, spec.GeneratorDeclaration) and isinstance(each.made, Linked) and id(each) not in new:
            key = linkage_of(each.label, each.made, symbols)
            for _, made in key.links:
                if isinstance(made, spec.Link):
                    _check_roads(made, key.roads)
            yield each, key


def link_specifications(
    key: LinkageKey, unit_of: UserUnit = lambda _label, _made: None
) -> tuple[AnySpecification, ...]:
    """The link specifications of chained declarations.

    Raises:
        TextError: there is no such unit of links, or something needs roads.
    """
    return tuple(
        _composite(label, made, streams)
        if isinstance(made, spec.Composite)
        else _specification(label, made, key, unit_of, streams)
        for (label, made), streams in zip(key.links, key.streams, strict=True)
    )


def _composite(label: Label, made: spec.Composite, streams: frozenset[str]) -> CompositeSpecification:
    found = CompositeSpecification(str(made.source), str(label), made.together, made.stays, made.least, streams)
    if gate_of(made.together, USUAL.most_m) is None:
        said = f"parts of {label} may be anywhere: the first condition implies no distance between them"
        raise TextError.at(made.place, said, repair="always[0, 2s] (xy_dist[from, to] < 30 and ...)")
    return found


def _specification(
    label: Label, made: spec.Link, key: LinkageKey, unit_of: UserUnit, streams: frozenset[str]
) -> Specification:
    roads, options = key.roads, made.options
    unit = _unit(label, made, roads, unit_of)
    return _weighed(
        options.weigh,
        key,
        Specification(
            str(made.source),
            str(label),
            made.establish,
            made.reestablish,
            made.maintain,
            unit,
            _predictor(made, roads),
            forget_us=options.forget,
            lasting=_lasting(made, roads),
            is_adaptive=made.is_ready,
            score=_SCORES[options.score],
            exclusive=options.exclusive,
            correlated=options.errors == "correlated",
            is_recursive=unit is filtered or getattr(unit, "is_recursive", False),
            candidates=CANDIDATES if _is_ready_world(made) and options.candidates == 1 else options.candidates,
            features={} if roads is None else {ON_ROADS: lambda state: roads.on_road(state.x_m, state.y_m, SLACK_M)},
            streams=streams,
        ),
    )


def _is_ready_world(made: spec.Link) -> bool:
    """Whether percepts become objects as is ready for them."""
    return made.is_ready and made.unit == "WorldObject"


def _lasting(made: spec.Link, roads: RoadNetwork | None) -> Lasting | None:
    """How long objects are kept: as is ready, unless the link says how long."""
    if not made.is_ready or made.options.forget != LinkOptions().forget:
        return None
    return ANYWHERE if roads is None else ALONG_ROADS


def _weighed(name: str, key: LinkageKey, found: Specification) -> Specification:
    """With scores and weights by the world model of a stream of beliefs."""
    belief = dict(key.beliefs).get(name)
    if belief is None or belief.world is None:
        return found
    weights = AssociationWeights(belief.world.model, belief.observed[0].sensor)
    return replace(found, score=weights.score, weigh=weights.weigh)


def _predictor(made: spec.Link, roads: RoadNetwork | None) -> Predictor | None:
    """The predictor of objects that are not seen; None: the general model."""
    options: LinkOptions = made.options
    if _is_ready_world(made) and not options.predict:
        return MotionPredictor()
    predict = options.predict or ("individual" if made.unit == "OnRoad" else "velocity")
    if roads is not None and (predict == "roads" or (predict == "individual" and made.unit == "OnRoad")):
        pruning, has_habits = Pruning(most=options.max_hyps), predict == "individual"
        return AlongRoads(roads, pruning=pruning, noise=ROAD_NOISE, has_habits=has_habits)
    return HabitualMotion(GENERAL) if predict == "individual" else GENERAL if options.predict else None


def _unit(label: Label, made: spec.Link, roads: RoadNetwork | None, unit_of: UserUnit) -> StateUnit:
    _check_roads(made, roads)
    make = LINK_UNITS.get(made.unit)
    unit = unit_of(label, made) if make is None else make(roads)
    if unit is None:
        hint = did_you_mean(made.unit, tuple(LINK_UNITS))
        raise TextError.at(made.place, f"{made.unit} makes no states of objects.{hint}", repair=next(iter(LINK_UNITS)))
    return unit


def _check_roads(made: spec.Link, roads: RoadNetwork | None) -> None:
    needs = [each for each in (made.unit, f"predict {made.options.predict}") if each in {"OnRoad", "predict roads"}]
    if needs and roads is None:
        raise TextError.at(made.place, f"{needs[0]} needs roads", repair='roads "town.geojson", or --roads FILE')


def _check_types(links: LinkDeclarations) -> None:
    below: dict[Label, set[Label]] = {}
    for label, made in links:
        if made.source in below.setdefault(label, set()):
            said = f"objects of {made.source} are linked to {label} twice"
            raise TextError.at(made.place, said, repair="one link of the two, or another name")
        below[label].add(made.source)
    for label, made in links:
        reached, waiting = set[Label](), [made.source]
        while waiting:
            one = waiting.pop()
            if one not in reached:
                reached.add(one)
                waiting += below.get(one, ())
        if label in reached:
            raise TextError.at(made.place, f"objects of {label} are linked to themselves", repair="a chain")
    composites = {label for label, made in links if isinstance(made, spec.Composite)}
    for label, made in links:
        if isinstance(made, spec.Link) and label in composites:
            said = f"{label} are composites, made of their parts: no link leads to them"
            raise TextError.at(made.place, said, repair="another name, or a link of the parts")


def check_percepts(made: Linked, label: Label, sort: Sort, origin: tuple[float, float] | None) -> None:
    """Refuse a stream at the beginning of a chain that makes no percepts; raises TextError."""
    if lacking := lacks_of(sort):
        said = f"{label} are of sort {sort.name}, which has no {', '.join(lacking)}: it makes no percepts"
        repair = f"sort {sort.name}(symbol in text, x_m in m, y_m in m)"
    elif origin is None and is_geographic(sort):
        said = f"{label} are placed in degrees, and it is not known where x_m and y_m of objects are 0"
        repair = 'roads "town.geojson", or define ORIGIN_LATITUDE_DEG = 58.4 and define ORIGIN_LONGITUDE_DEG = 15.6'
    else:
        return
    raise TextError.at(made.place, said, repair=repair)


def most_branches(label: Label, key: LinkageKey) -> int:
    """How many futures of an object that is not seen a stream of linked objects has; of several links the most."""
    found = (made.options.branches for each, made in key.links if each == label and isinstance(made, spec.Link))
    return max(found, default=0)


def declared_links(links: LinkDeclarations) -> dict[str, str]:
    """The unit and the options of each, as they are typed, by the name of the link."""
    return {
        f"{made.source} -> {label}": f"{made.unit}{print_options(made.options)}"
        for label, made in links
        if isinstance(made, spec.Link)
    }


def links_in(declarations: Iterable[spec.Declaration]) -> tuple[tuple[Label, Linked], ...]:
    """The declarations of links and of composites in a specification."""
    return tuple(
        (each.label, each.made)
        for each in declarations
        if isinstance(each, spec.GeneratorDeclaration) and isinstance(each.made, Linked)
    )
