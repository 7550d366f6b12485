"""The five cases of an anchoring situation: the results of Find and Reacquire, and the recovery.

"Have another look", section 3. The cases differ in how many percepts match completely and partially, and by whether
the description is definite.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, TypeAlias

from dyknow.anchoring.matching.candidates import (
    CandidateMatch,
    ObservationGates,
    ObservedProperty,
    PerceptProperties,
    match_percepts,
    with_threshold,
)
from dyknow.anchoring.matching.descriptions import ObjectDescription
from dyknow.anchoring.matching.discrimination import Discriminating, discriminating_property

AnchoringCase: TypeAlias = Literal[1, 2, 3, 4, 5]
AnchoringResult: TypeAlias = Literal["fail", "temporary", "anchor"]
RecoveryKind: TypeAlias = Literal["search", "recover", "recover_cautious", "description_insufficient"]
Functionality: TypeAlias = Literal["find", "reacquire"]


@dataclass(frozen=True, slots=True)
class MatchingOptions:
    """How a situation is looked at.

    Attributes:
        functionality: Reacquire is always definite.
        is_cautious: partial matches have to be ruled out, though one is complete.
        is_only_one: prior knowledge that no other object is similar to the wanted one: a definite description with one
            partial match means that.
        threshold: the degree from which a match is complete; it is raised where several are and one is best.
    """

    functionality: Functionality = "find"
    is_cautious: bool = False
    is_only_one: bool = False
    threshold: float = 1.0
    gates: ObservationGates = field(default_factory=ObservationGates)


class ObjectAnchor(NamedTuple):
    """A symbol's connection to a percept; a temporary one lets a plan refer to the percept until it is decided.

    Attributes:
        properties: those of the percept that were observed, to know it again.
    """

    percept: str
    match: CandidateMatch
    properties: Mapping[str, ObservedProperty]
    is_temporary: bool


@dataclass(frozen=True, slots=True)
class AnchoringSituation:
    """A classified situation.

    Attributes:
        recovery: the action to take; None: none is needed.
        threshold: the degree from which matches are complete here.
        ask: in case 5 of a definite description, the property that would tell the percepts apart.
        notes: decisions by prior knowledge or convention.
    """

    case: AnchoringCase
    result: AnchoringResult
    recovery: RecoveryKind | None
    matches: tuple[CandidateMatch, ...]
    anchors: tuple[ObjectAnchor, ...]
    threshold: float
    ask: Discriminating | None = None
    notes: tuple[str, ...] = ()

    def reasons(self) -> tuple[str, ...]:
        """Sentences: the decisions, then one for each percept and property; those of possible percepts come first."""
        ordered = sorted(self.matches, key=lambda match: match.status == "none")
        return (
            *self.notes,
            *(f"{match.percept}: {finding.because}" for match in ordered for finding in match.findings),
        )


def classify(
    description: ObjectDescription, percepts: Mapping[str, PerceptProperties], options: MatchingOptions
) -> AnchoringSituation:
    """The situation in which a description meets percepts."""
    matches = match_percepts(description, percepts, options.gates, options.threshold)
    matches, threshold, notes = _raised(matches, options.threshold)
    is_definite = description.is_definite or options.functionality == "reacquire"
    if is_definite and not description.is_definite:
        notes.append("Reacquire is always definite: it means the object that was anchored before")
    complete = [each for each in matches if each.status == "complete"]
    partial = [each for each in matches if each.status == "partial"]

    def situation(
        case: AnchoringCase,
        recovery: RecoveryKind | None = None,
        anchored: Sequence[CandidateMatch] = (),
        ask: Discriminating | None = None,
    ) -> AnchoringSituation:
        is_temporary = recovery is not None
        result: AnchoringResult = "fail" if not anchored else "temporary" if is_temporary else "anchor"
        anchors = tuple(_anchor(each, percepts, is_temporary=is_temporary) for each in anchored)
        return AnchoringSituation(case, result, recovery, matches, anchors, threshold, ask, tuple(notes))

    if not complete and not partial:
        notes.append("no percept matches: the object may be elsewhere")
        return situation(1, "search")
    if not complete and len(partial) == 1 and is_definite and options.is_only_one:
        notes.append(f"{partial[0].percept} is taken although it matches partially: no other object is similar")
        return situation(3, None, partial)
    if not complete:
        return situation(2, "recover", partial)
    best = min(complete, key=lambda each: (-each.degree, each.percept))
    if len(complete) == 1 and not partial:
        return situation(3, None, [best])
    if len(complete) == 1:
        if is_definite and options.is_cautious:
            return situation(4, "recover_cautious", [*complete, *partial])
        return situation(4, None, [best])
    if not is_definite:
        return situation(5, None, [best])
    names = [each.percept for each in complete]
    ask = discriminating_property({name: percepts[name] for name in names}, options.gates)
    notes.append(f"the description is insufficient: {len(names)} percepts match it completely, {_listed(names)}")
    notes.append(ask.sentence())
    return situation(5, "description_insufficient", ask=ask)


def _raised(
    matches: tuple[CandidateMatch, ...], threshold: float
) -> tuple[tuple[CandidateMatch, ...], float, list[str]]:
    """The matches with the threshold raised to the degree of the best complete one, if it is the only one of that degree."""
    degrees = sorted((each.degree for each in matches if each.status == "complete"), reverse=True)
    if len(degrees) < 2 or degrees[0] == degrees[1]:
        return matches, threshold, []
    note = f"the threshold is raised from {threshold:g} to {degrees[0]:g}: {len(degrees)} percepts were complete, one is best"
    return with_threshold(matches, degrees[0]), degrees[0], [note]


def _anchor(match: CandidateMatch, percepts: Mapping[str, PerceptProperties], *, is_temporary: bool) -> ObjectAnchor:
    properties = {name: value for name, value in percepts[match.percept].items() if value is not None}
    return ObjectAnchor(match.percept, match, properties, is_temporary)


def _listed(names: Sequence[str]) -> str:
    shown = ", ".join(names[:8])
    return f"{shown} and {len(names) - 8} more" if len(names) > 8 else shown
