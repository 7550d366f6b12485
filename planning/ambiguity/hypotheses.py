"""Hypotheses that an ambiguous anchoring situation leaves, and the problem of deciding between them.

"Have another look", section 4.1. In case 1 the object may be visible from each place that was not searched yet, or from
none. In cases 2 and 4 each partially matching percept may be the object or not, depending on its unobserved properties
and the places from which they are visible.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice, product
from typing import Final, NamedTuple, TypeAlias

from dyknow.anchoring.matching.candidates import CandidateMatch, ObservationGates, PerceptProperties
from dyknow.anchoring.matching.descriptions import (
    AllowedValues,
    ObjectDescription,
    PropertyValue,
    same_value,
    shown_value,
)
from dyknow.anchoring.matching.situations import AnchoringSituation
from dyknow.planning.contingent.conditional_plans import NONE
from dyknow.planning.contingent.sensing_problems import (
    MOST_HYPOTHESES,
    PossibleLook,
    RecoveryHypothesis,
    SensingProblem,
    sensing_problem,
)

MATCHING: Final = "as-described"
OTHER: Final = "other"
ABSENT: Final = "f"
"""The outcome of a look for a property that is not visible from there, or that an object does not have."""


@dataclass(frozen=True, slots=True)
class LookingKnowledge:
    """The observer's knowledge of the area and of properties.

    Attributes:
        ways: to which places one can move from each.
        viewpoints: for each property the places where it may be visible; all places where there is no entry. A
            property with no places cannot be looked at, and decides nothing.
        domains: for each property its possible values; a property without entry may have any.
        searched: places from which the object was not seen.
        is_present: the object is one of those that are seen, in a search at one of the places.
    """

    ways: Mapping[str, Sequence[str]]
    start: str
    viewpoints: Mapping[str, Sequence[str]] = field(default_factory=dict)
    domains: Mapping[str, Sequence[PropertyValue]] = field(default_factory=dict)
    searched: frozenset[str] = frozenset()
    is_present: bool = False


class Possibilities(NamedTuple):
    """Degrees of possibility of the less possible hypotheses; that of exactly one match is 1.

    Attributes:
        none: no percept is the object, or it is at no place.
        also: of one that matches completely: that another one matches, too.
        both: that two partially matching percepts match.
    """

    none: float = 0.5
    also: float = 0.5
    both: float = 0.3


USUAL: Final = Possibilities()


class BuiltProblem(NamedTuple):
    """The problem that a situation leaves; `left_out` counts hypotheses beyond `MOST_HYPOTHESES`, the least possible ones."""

    problem: SensingProblem
    left_out: int = 0


_State: TypeAlias = tuple[tuple[str, str, str], ...]
"""Of one percept: for each unobserved property what is visible, and from where; none where nothing of it is."""


def search_problem(symbol: str, knowledge: LookingKnowledge, possibilities: Possibilities = USUAL) -> BuiltProblem:
    """Case 1: where is the object? Of places that were not searched."""
    every = dict.fromkeys((knowledge.start, *knowledge.ways, *(to for each in knowledge.ways.values() for to in each)))
    places = [place for place in every if place not in knowledge.searched]
    found = [RecoveryHypothesis(1.0, place, {symbol: frozenset([place])}) for place in places]
    if not knowledge.is_present or not found:
        found.append(RecoveryHypothesis(possibilities.none if found else 1.0, NONE, {}))
    kept = [*found[: MOST_HYPOTHESES - 1], found[-1]] if len(found) > MOST_HYPOTHESES else found
    problem = sensing_problem("search", knowledge.ways, knowledge.start, kept, symbol)
    return BuiltProblem(problem, len(found) - len(kept))


def identification_problem(
    symbol: str,
    description: ObjectDescription,
    situation: AnchoringSituation,
    knowledge: LookingKnowledge,
    possibilities: Possibilities = USUAL,
    *,
    is_cautious: bool = False,
) -> BuiltProblem:
    """Cases 2 and 4: which percept is the object?"""
    partial = [each.match for each in situation.anchors if each.match.status == "partial"]
    complete = next((each.percept for each in situation.anchors if each.match.status == "complete"), None)
    matching = {each.percept: list(_states(description, each, knowledge, is_match=True)) for each in partial}
    differing = {each.percept: list(_states(description, each, knowledge, is_match=False)) for each in partial}
    worlds = _Worlds(matching, differing)
    names = [each.percept for each in partial]
    tiers: list[tuple[float, str, tuple[str, ...]]] = []
    if complete is not None:
        tiers.append((1.0, complete, ()))
        tiers.extend((possibilities.also, NONE, (name,)) for name in names)
    else:
        tiers.extend((1.0, name, (name,)) for name in names)
        if not knowledge.is_present:
            tiers.append((possibilities.none, NONE, ()))
        if is_cautious:
            pairs = [(one, other) for number, other in enumerate(names) for one in names[:number]]
            tiers.extend((possibilities.both, NONE, pair) for pair in pairs)
    tiers.sort(key=lambda each: -each[0])
    every = ((possibility, answer, world) for possibility, answer, matches in tiers for world in worlds.where(matches))
    kept = list(islice(every, MOST_HYPOTHESES))
    left_out = sum(worlds.count(matches) for _, _, matches in tiers) - len(kept)
    hypotheses = [RecoveryHypothesis(possibility, answer, _visible(world)) for possibility, answer, world in kept]
    looks = _looks([world for _, _, world in kept])
    whole = sensing_problem("identify", knowledge.ways, knowledge.start, (), symbol)
    problem = SensingProblem("identify", whole.ways, knowledge.start, tuple(hypotheses), looks, symbol)
    return BuiltProblem(problem, left_out)


def shown_by_look(
    description: ObjectDescription,
    names: Sequence[str],
    seen: PerceptProperties,
    gates: ObservationGates,
    knowledge: LookingKnowledge,
) -> str:
    """The outcome of a look that observes these properties, as plans name it; `names`: the properties to look for."""
    shown = []
    for name in names:
        found = seen.get(name)
        if found is None or found.confidence < gates.confidence:
            continue
        described, others = _values(description, name, knowledge)
        is_described = description.properties[name].degree(found.value) > 0.0
        general = MATCHING if is_described else OTHER
        value = general if general in (described if is_described else others) else _shown(found.value)
        if value != ABSENT:
            shown.append(value if len(names) == 1 else f"{name}:{value}")
    return ",".join(shown) or ABSENT


class _Worlds:
    """Assignments of states to percepts."""

    def __init__(self, matching: Mapping[str, list[_State]], differing: Mapping[str, list[_State]]) -> None:
        self._matching, self._differing = matching, differing

    def where(self, matches: Iterable[str]) -> Iterator[dict[str, _State]]:
        """Those in which some percepts match, and no others do."""
        names = list(self._matching)
        for states in product(*self._choices(matches)):
            yield dict(zip(names, states, strict=True))

    def count(self, matches: Iterable[str]) -> int:
        number = 1
        for states in self._choices(matches):
            number *= len(states)
        return number

    def _choices(self, matches: Iterable[str]) -> list[list[_State]]:
        matched = set(matches)
        return [self._matching[each] if each in matched else self._differing[each] for each in self._matching]


def _states(
    description: ObjectDescription, match: CandidateMatch, knowledge: LookingKnowledge, *, is_match: bool
) -> Iterator[_State]:
    """The possible values of a percept's unobserved properties: all as described, or at least one of them not."""
    choices = []
    for name in match.unobserved:
        places = knowledge.viewpoints.get(name, tuple(knowledge.ways))
        if not places:
            continue
        described, others = _values(description, name, knowledge)
        shown = [(value, True) for value in described]
        if not is_match:
            shown += [(value, False) for value in others]
        choices.append(
            [
                ((name, value, place), is_described)
                for value, is_described in shown
                for place in (places if value != ABSENT else ("",))
            ]
        )
    for chosen in product(*choices):
        if is_match or not all(is_described for _, is_described in chosen):
            yield tuple(part for part, _ in chosen if part[1] != ABSENT)
    if not choices and not is_match:
        yield ()


def _values(
    description: ObjectDescription, name: str, knowledge: LookingKnowledge
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The outcomes of a look for a property that is as described, and of one that is not."""
    allowed = description.properties[name]
    domain = knowledge.domains.get(name)
    if isinstance(allowed, AllowedValues):
        values = [value for value, _ in allowed.degrees]
        if domain is None and all(isinstance(value, bool) for value in values):
            domain = (True, False)
        others = None if domain is None else [d for d in domain if not any(same_value(d, value) for value in values)]
        described = tuple(map(_shown, values)) if len(values) == 1 or domain is not None else (MATCHING,)
        return described, (OTHER,) if others is None else tuple(map(_shown, others))
    return (MATCHING,), (OTHER,)


def _shown(value: PropertyValue) -> str:
    if isinstance(value, bool):
        return "t" if value else ABSENT
    return "-".join(shown_value(value).split())


def _visible(world: Mapping[str, _State]) -> dict[str, frozenset[str]]:
    return {target: frozenset(place for _, _, place in state) for target, state in world.items() if state}


def _looks(worlds: Sequence[Mapping[str, _State]]) -> tuple[PossibleLook, ...]:
    """The looks that show something under one hypothesis at least; of several properties what is seen of all at once."""
    every = (1 << len(worlds)) - 1
    features: dict[str, set[str]] = {}
    shown: dict[tuple[str, str], dict[str, int]] = {}
    for world in worlds:
        for target, state in world.items():
            features.setdefault(target, set()).update(name for name, _, _ in state)
    for number, world in enumerate(worlds):
        for target, state in world.items():
            seen: dict[str, list[str]] = {}
            for name, value, place in state:
                seen.setdefault(place, []).append(value if len(features[target]) == 1 else f"{name}:{value}")
            for place, values in seen.items():
                masks = shown.setdefault((place, target), {})
                masks[",".join(values)] = masks.get(",".join(values), 0) | 1 << number
    looks = []
    for (place, target), masks in sorted(shown.items()):
        feature = next(iter(features[target])) if len(features[target]) == 1 else "seen"
        nothing = every & ~sum(masks.values())
        looks.append(PossibleLook(place, target, feature, (*sorted(masks.items()), (ABSENT, nothing))))
    return tuple(looks)
