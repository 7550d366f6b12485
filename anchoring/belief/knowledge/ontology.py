"""Knowledge from before any observation. All of it is values."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from dyknow.anchoring.belief.arrays import Floats, Indices

REFUSE, REPAIR = "refuse", "repair"
ACTIONS: Final = (REPAIR, REFUSE)
Area = tuple[float, float, float, float]
"""West, south, east, north in metres."""


class KnownClass(NamedTuple):
    """The knowledge of one class.

    Attributes:
        is_a: the class above it; empty: none.
        is_lasting: its instances are remembered when they are gone.
        gaussian: mean (d,) and covariance (d, d) of unobserved attributes of an instance.
        categorical: (K,) likewise.
        has: attributes that all of its instances have.
    """

    name: str
    is_a: str = ""
    is_lasting: bool = False
    gaussian: Mapping[str, tuple[Floats, Floats]] = {}
    categorical: Mapping[str, Floats] = {}
    has: frozenset[str] = frozenset()


class ClassRule(NamedTuple):
    """A constraint on the instances of a class; it is cited by its name.

    Attributes:
        attribute, relation: the subject of the rule; one of the two.
        low, high: (m,) bounds of a continuous attribute.
        values: (K,) 1 for an allowed value of a discrete attribute, 0 for another.
        other: the class to which the relation leads; empty: any.
        at_most: instances to which the relation leads at one time; 0: any number.
        tolerance: the greatest probability of a violation that is left alone.
    """

    name: str
    of_class: str
    action: str
    attribute: str = ""
    relation: str = ""
    low: Floats | None = None
    high: Floats | None = None
    values: Floats | None = None
    other: str = ""
    at_most: int = 0
    tolerance: float = 0.1


class KnownInstance(NamedTuple):
    """One thing that is known from before.

    Attributes:
        categorical: also of `type`.
    """

    name: str
    gaussian: Mapping[str, tuple[Floats, Floats]]
    categorical: Mapping[str, Floats]


@dataclass(frozen=True, eq=False)
class KnowledgeBundle:
    """Knowledge that is loaded and unloaded together.

    Attributes:
        area: where it is about; None: everywhere.
        tasks: for which it is needed; empty: any.
    """

    name: str
    area: Area | None = None
    tasks: frozenset[str] = frozenset()
    classes: Mapping[str, KnownClass] = field(default_factory=dict)
    rules: tuple[ClassRule, ...] = ()
    known: tuple[KnownInstance, ...] = ()

    def may_be_with(self, other: "KnowledgeBundle") -> bool:
        """Whether the two may be loaded at one time."""
        if self.tasks and other.tasks and not self.tasks & other.tasks:
            return False
        return self.area is None or other.area is None or other.is_for(self.area, next(iter(other.tasks), ""))

    def is_for(self, area: Area | None, task: str) -> bool:
        """Whether it is needed there, for that."""
        if self.tasks and task not in self.tasks:
            return False
        if self.area is None or area is None:
            return True
        west, south, east, north = self.area
        return west <= area[2] and area[0] <= east and south <= area[3] and area[1] <= north


def members(classes: Mapping[str, KnownClass], name: str, types: tuple[str, ...]) -> Indices:
    """Places of the types that are of a class, or of one below it."""
    return np.array([place for place, each in enumerate(types) if name in lineage(classes, each)], dtype=np.intp)


def lineage(classes: Mapping[str, KnownClass], name: str) -> tuple[str, ...]:
    """A class and those above it."""
    found = [name]
    while (known := classes.get(found[-1])) is not None and known.is_a and known.is_a not in found:
        found.append(known.is_a)
    return tuple(found)


def left_nothing(rules: Iterable[ClassRule], classes: Mapping[str, KnownClass], types: Sequence[str]) -> str:
    """The rules that together leave a type no value of an attribute, in words; empty: none."""
    allowed: dict[tuple[str, str], tuple[Floats, Floats]] = {}
    names: dict[tuple[str, str], list[str]] = {}
    for rule in rules:
        if rule.values is not None:
            low, high = 1.0 - rule.values, rule.values  # one value is allowed where low <= high
        elif rule.low is not None and rule.high is not None:
            low, high = rule.low, rule.high
        else:
            continue
        for type_ in (each for each in types if rule.of_class in lineage(classes, each)):
            key = type_, rule.attribute
            before = allowed.get(key, (low, high))
            allowed[key] = both = np.maximum(before[0], low), np.minimum(before[1], high)
            names.setdefault(key, []).append(rule.name)
            fits = both[0] <= both[1]
            if not (fits.any() if rule.values is not None else fits.all()):
                return f"{' and '.join(names[key])} leave a {type_} no {rule.attribute} at all"
    return ""
