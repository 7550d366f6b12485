"""Which further property would tell percepts apart that all match a description."""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass

from dyknow.anchoring.matching.candidates import ObservationGates, PerceptProperties
from dyknow.anchoring.matching.descriptions import shown_value

_MOST_SHOWN = 8


@dataclass(frozen=True, slots=True)
class Discriminating:
    """The property that is best asked for; `name` is empty where nothing that was observed differs.

    Attributes:
        values: the percepts with each observed value.
    """

    name: str
    values: Mapping[str, tuple[str, ...]]

    def sentence(self) -> str:
        """The question to the requester."""
        if not self.name:
            return "nothing that was observed differs between them: point at one, or describe what is not observed yet"
        shown = [
            f"{value} ({', '.join(names[:3])}{', ...' * (len(names) > 3)})" for value, names in self.values.items()
        ]
        more = f" and {len(shown) - _MOST_SHOWN} more values" if len(shown) > _MOST_SHOWN else ""
        return f"which {self.name} does it have: {', '.join(shown[:_MOST_SHOWN])}{more}?"


def discriminating_property(percepts: Mapping[str, PerceptProperties], gates: ObservationGates) -> Discriminating:
    """The property that leaves the fewest percepts at worst, whatever the answer is; then the first by name.

    A property of the description is as good as any other: of a set of allowed values the percepts may have several. A percept
    whose property is unobserved remains possible under every answer.
    """
    groups = _observed_values(percepts, gates)
    best: tuple[int, str] | None = None
    for name, found in sorted(groups.items()):
        sizes = [len(each) for each in found.values()]
        left = max(sizes) + len(percepts) - sum(sizes)
        if len(sizes) > 1 and (best is None or left < best[0]):
            best = left, name
    if best is None:
        return Discriminating("", {})
    return Discriminating(best[1], {value: tuple(found) for value, found in sorted(groups[best[1]].items())})


def _observed_values(
    percepts: Mapping[str, PerceptProperties], gates: ObservationGates
) -> Mapping[str, Mapping[str, list[str]]]:
    """For each property, the percepts with each observed value."""
    groups: defaultdict[str, defaultdict[str, list[str]]] = defaultdict(lambda: defaultdict(list))
    for percept in sorted(percepts):
        for name, observed in percepts[percept].items():
            if observed is not None and observed.confidence >= gates.confidence:
                groups[name][shown_value(observed.value)].append(percept)
    return groups
