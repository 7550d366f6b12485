"""How far percepts match a description: completely, partially or not, with a reason for each property."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import inf
from typing import Literal, NamedTuple, TypeAlias

from dyknow.anchoring.matching.descriptions import (
    LEAST,
    Allowed,
    AllowedPlace,
    ObjectDescription,
    PropertyValue,
    shown_value,
)

MatchStatus: TypeAlias = Literal["complete", "partial", "none"]


@dataclass(frozen=True, slots=True)
class ObservedProperty:
    """An observation of one property.

    Attributes:
        confidence: of the observation, 0 to 1.
        sd_m: standard deviation of a place.
    """

    value: PropertyValue
    confidence: float = 1.0
    sd_m: float = 0.0


@dataclass(frozen=True, slots=True)
class ObservationGates:
    """Which observations count as such.

    Attributes:
        confidence: a property observed with less is unobserved.
        sd_m: a place with a larger standard deviation is unobserved; None for how far away from the described place an
            object may be.
    """

    confidence: float = 0.5
    sd_m: float | None = None


PerceptProperties: TypeAlias = Mapping[str, ObservedProperty | None]
"""By name; None, or no entry, is unobserved."""


class PropertyFinding(NamedTuple):
    """One property of a percept, compared with its description.

    Attributes:
        degree: to which it is as described; 1 where it is unobserved.
    """

    name: str
    is_observed: bool
    degree: float
    because: str


class CandidateMatch(NamedTuple):
    """How far one percept matches.

    Attributes:
        degree: the least of those of its observed properties; 0 where one contradicts.
    """

    percept: str
    status: MatchStatus
    degree: float
    findings: tuple[PropertyFinding, ...]

    @property
    def unobserved(self) -> tuple[str, ...]:
        """The properties of the description that were not observed."""
        return tuple(each.name for each in self.findings if not each.is_observed)


def match_percepts(
    description: ObjectDescription,
    percepts: Mapping[str, PerceptProperties],
    gates: ObservationGates,
    threshold: float = 1.0,
) -> tuple[CandidateMatch, ...]:
    """The matches of all percepts, by name; complete from a degree of `threshold` on, if nothing is unobserved."""
    return tuple(_match(description, name, percepts[name], gates, threshold) for name in sorted(percepts))


def with_threshold(matches: Iterable[CandidateMatch], threshold: float) -> tuple[CandidateMatch, ...]:
    """The same matches under another threshold."""
    return tuple(each._replace(status=_status(each.findings, each.degree, threshold)) for each in matches)


def _match(
    description: ObjectDescription, name: str, percept: PerceptProperties, gates: ObservationGates, threshold: float
) -> CandidateMatch:
    findings = tuple(
        _finding(each, allowed, percept.get(each), gates) for each, allowed in description.properties.items()
    )
    degree = min((each.degree for each in findings), default=1.0)
    return CandidateMatch(name, _status(findings, degree, threshold), degree, findings)


def _status(findings: Iterable[PropertyFinding], degree: float, threshold: float) -> MatchStatus:
    if degree <= 0.0:
        return "none"
    return "complete" if degree >= threshold - LEAST and all(each.is_observed for each in findings) else "partial"


def _finding(
    name: str, allowed: Allowed, observed: ObservedProperty | None, gates: ObservationGates
) -> PropertyFinding:
    if observed is None:
        return PropertyFinding(name, False, 1.0, f"{name} was not observed, and is described as {allowed}")
    value = shown_value(observed.value)
    if observed.confidence < gates.confidence:
        too_low = f"{observed.confidence:g} is below {gates.confidence:g}"
        return PropertyFinding(name, False, 1.0, f"{name} {value} counts as unobserved: its confidence {too_low}")
    gate_m = gates.sd_m if gates.sd_m is not None else allowed.within_m if isinstance(allowed, AllowedPlace) else inf
    if observed.sd_m > gate_m:
        too_wide = f"{observed.sd_m:g} m is beyond the gate of {gate_m:g} m"
        return PropertyFinding(name, False, 1.0, f"{name} {value} counts as unobserved: its deviation of {too_wide}")
    degree = allowed.degree(observed.value)
    if degree <= 0.0:
        return PropertyFinding(name, True, 0.0, f"{name} {value} contradicts the description, {allowed}")
    graded = "" if degree == 1.0 else f" to degree {degree:g}"
    return PropertyFinding(name, True, degree, f"{name} {value} is as described{graded}")
