"""Prior knowledge in bundles: loaded and unloaded as needed, and learnt back."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from typing import Final

import numpy as np

from dyknow.anchoring.belief.arrays import Flags, Floats
from dyknow.anchoring.belief.knowledge.ontology import (
    Area,
    ClassRule,
    KnowledgeBundle,
    KnownClass,
    KnownInstance,
    left_nothing,
    lineage,
)
from dyknow.model.errors import WrongCall

MOST_LEARNT: Final = 1000
"""Instances that are remembered; of more those that were learnt last."""


class PriorKnowledge:
    """Knowledge of some types. A type that bundles describe is possible while one of these is loaded.

    Args:
        types: of the environment model.
        bundles: all there are; none is loaded yet.

    Raises:
        WrongCall: two bundles contradict each other.
    """

    def __init__(self, types: Sequence[str], bundles: Iterable[KnowledgeBundle]) -> None:
        self.types = tuple(types)
        self.bundles = {each.name: each for each in bundles}
        self.loaded: dict[str, KnowledgeBundle] = {}
        self.learnt: dict[str, KnownInstance] = {}
        self._classes: Mapping[str, KnownClass] = {}
        self._check()

    @property
    def classes(self) -> Mapping[str, KnownClass]:
        """Of the bundles that are loaded."""
        return self._classes

    @property
    def rules(self) -> list[ClassRule]:
        return [rule for each in self.loaded.values() for rule in each.rules]

    @property
    def known(self) -> list[KnownInstance]:
        """Known from before, or learnt; of one name what was learnt last."""
        found = {known.name: known for each in self.loaded.values() for known in each.known}
        return list({**found, **self.learnt}.values())

    def select(self, area: Area | None, task: str) -> tuple[list[str], list[str]]:
        """Load what is needed there and for that, unload the rest; names of bundles that were loaded and unloaded."""
        wanted = {name: each for name, each in self.bundles.items() if each.is_for(area, task)}
        loaded = [name for name in wanted if name not in self.loaded]
        unloaded = [name for name in self.loaded if name not in wanted]
        self.loaded = wanted
        self._classes = {name: known for each in wanted.values() for name, known in each.classes.items()}
        return loaded, unloaded

    def possible(self) -> Flags:
        """(T,) types that are in a loaded bundle, or in none at all."""
        described = {name for each in self.bundles.values() for name in each.classes}
        return np.array([name not in described or name in self._classes for name in self.types])

    def is_lasting(self, type_: str) -> bool:
        """Whether instances of a type are remembered when they are gone."""
        return any(known.is_lasting for name in lineage(self._classes, type_) if (known := self._classes.get(name)))

    def has(self, type_: str) -> frozenset[str]:
        """Attributes that all things of a type have."""
        return frozenset().union(
            *(known.has for name in lineage(self._classes, type_) if (known := self._classes.get(name)))
        )

    def of_class(self, type_: str) -> KnownClass:
        """The knowledge of a type: of all its classes, where a lower one overrides a higher one."""
        gaussian: dict[str, tuple[Floats, Floats]] = {}
        categorical: dict[str, Floats] = {}
        for name in reversed(lineage(self._classes, type_)):
            if known := self._classes.get(name):
                gaussian |= known.gaussian
                categorical |= known.categorical
        return KnownClass(type_, gaussian=gaussian, categorical=categorical)

    def learn(self, known: KnownInstance) -> None:
        """Remember an instance; attributes that are not learnt again stay."""
        before = next((each for each in self.known if each.name == known.name), None)
        if before is not None:
            known = KnownInstance(
                known.name, {**before.gaussian, **known.gaussian}, {**before.categorical, **known.categorical}
            )
        self.learnt.pop(known.name, None)
        self.learnt[known.name] = known
        while len(self.learnt) > MOST_LEARNT:
            del self.learnt[next(iter(self.learnt))]

    def _check(self) -> None:
        classes: dict[str, str] = {}
        known: dict[str, str] = {}
        for bundle in self.bundles.values():
            for names, what in ((bundle.classes, "class"), ([each.name for each in bundle.known], "known instance")):
                before = classes if what == "class" else known
                for name in names:
                    if name in before:
                        raise WrongCall(
                            f"the {what} {name} is in {before[name]} and in {bundle.name}; "
                            "leave it in one of them, in a bundle that both tasks load"
                        )
                    before[name] = bundle.name
        for one, other in combinations(self.bundles.values(), 2):
            both = left_nothing((*one.rules, *other.rules), {**one.classes, **other.classes}, self.types)
            if both and one.may_be_with(other):
                raise WrongCall(f"rules of {one.name} and {other.name}: {both}; let them agree, or be of other tasks")
