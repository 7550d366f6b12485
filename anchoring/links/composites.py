"""Objects made of others: a convoy, a queue, a car with its trailer (Heintz, Rudol and Doherty, section VI).

A composite has no percept of its own: it is anchored while one of its parts is. Two parts belong together once a condition
over both has become true, until another one fails; a composite is what is connected by that. Its symbol stays with the group
that has most of its parts.

    convoys = CompositeObjects(CompositeSpecification("world", "convoy", together, stays))
    events = convoys.step(valid_us, linkage.objects("world").values())
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations, count

import numpy as np

from anchoring.links.assignment import assigned, natural
from anchoring.links.deciding.conditions import PairCondition
from anchoring.links.objects import EventKind, LinkEvent, LinkObject, LinkReason
from anchoring.links.specification import ALWAYS_TRUE, LinkSpecification
from anchoring.links.states import ObjectState
from reasoning import Progressing
from reasoning.formulas.tree import Formula


@dataclass(frozen=True, slots=True)
class CompositeSpecification:
    """Parts of one type that make objects of another.

    Attributes:
        together: over `from` and `to`, two parts, the one whose symbol is first being `from`; true: they belong together.
        stays: over the same; false: they no longer do.
        least: the number of parts that make a composite.
    """

    part: str
    target: str
    together: Formula
    stays: Formula = ALWAYS_TRUE
    least: int = 2


@dataclass(slots=True)
class Composite:
    """A symbol, its parts by symbol, and the mean of their states."""

    symbol: str
    parts: dict[str, LinkObject]
    state: ObjectState

    @property
    def is_anchored(self) -> bool:
        """Whether one of the parts was linked to a percept, directly or not, when it had its latest state."""
        return any(part.anchored_us == part.state.valid_us for part in self.parts.values())


class CompositeObjects:
    """All composites of one specification.

    Attributes:
        composites: by symbol.
    """

    def __init__(self, specification: CompositeSpecification) -> None:
        self.specification = specification
        self.composites: dict[str, Composite] = {}
        pair = LinkSpecification(specification.part, specification.target, ALWAYS_TRUE, specification.together)
        self._together, self._stays = (
            PairCondition(each, pair) for each in (specification.together, specification.stays)
        )
        self._evaluations: dict[tuple[str, str], Progressing] = {}
        self._bonds: dict[tuple[str, str], Progressing] = {}
        self._numbers = count(1)

    def step(self, valid_us: int, parts: Iterable[LinkObject]) -> list[LinkEvent]:
        """Take the states of all parts that there are at a time; those without one at that time stay as they were."""
        known = {one.symbol: one for one in parts}
        for table in (self._evaluations, self._bonds):
            for pair in [pair for pair in table if not known.keys() >= set(pair)]:
                del table[pair]
        fresh = sorted(
            (one for one in known.values() if one.state.valid_us == valid_us), key=lambda one: natural(one.symbol)
        )
        for one, other in combinations(fresh, 2):
            self._decide(valid_us, one, other)
        return self._regroup(valid_us, known)

    def _decide(self, valid_us: int, one: LinkObject, other: LinkObject) -> None:
        """Whether two parts belong together after this state; what has failed begins again at the next."""
        pair = one.symbol, other.symbol
        if (bond := self._bonds.get(pair)) is not None:
            self._stays.step(bond, valid_us, one.state, other.whereabouts)
            if bond.verdict == "false":
                del self._bonds[pair]
            return
        gate = self._together.gate
        is_far = gate is not None and one.state.distance_m(other.state) >= gate.bound_m
        if is_far and pair not in self._evaluations:
            return
        evaluation = self._evaluations.setdefault(pair, self._together.start())
        self._together.step(evaluation, valid_us, one.state, other.whereabouts)
        if evaluation.verdict != "undecided":
            del self._evaluations[pair]
        if evaluation.verdict == "true":
            self._bonds[pair] = self._stays.start()

    def _regroup(self, valid_us: int, known: dict[str, LinkObject]) -> list[LinkEvent]:
        groups = [group for group in self._groups() if len(group) >= self.specification.least]
        shared = {
            (symbol, str(at)): -float(len(common))
            for symbol, composite in self.composites.items()
            for at, group in enumerate(groups)
            if (common := composite.parts.keys() & group)
        }
        chosen = {int(at): symbol for symbol, at in assigned(shared)}
        found: dict[str, Composite] = {}
        events = []
        for at, group in enumerate(groups):
            symbol = chosen.get(at) or f"{self.specification.target}{next(self._numbers)}"
            parts = {name: known[name] for name in sorted(group, key=natural)}
            found[symbol] = Composite(symbol, parts, _mean(valid_us, [part.state for part in parts.values()]))
            before = self.composites[symbol].parts.keys() if symbol in self.composites else set[str]()
            events += [self._event(valid_us, name, symbol, joined=True) for name in parts if name not in before]
            events += [self._event(valid_us, name, symbol, joined=False) for name in before if name not in parts]
        events += [
            LinkEvent(valid_us, "forgotten", "", "", symbol, self.specification.target, LinkReason("maintain"))
            for symbol in self.composites
            if symbol not in found
        ]
        self.composites = found
        return events

    def _groups(self) -> list[set[str]]:
        """Parts that are connected by belonging together."""
        groups: list[set[str]] = []
        for pair in self._bonds:
            touched = [group for group in groups if group & set(pair)]
            groups = [group for group in groups if group not in touched]
            groups.append(set(pair).union(*touched))
        return sorted(groups, key=lambda group: min(map(natural, group)))

    def _event(self, valid_us: int, part: str, symbol: str, *, joined: bool) -> LinkEvent:
        specification = self.specification
        reason = (
            LinkReason("establish", specification.together) if joined else LinkReason("maintain", specification.stays)
        )
        kind: EventKind = "established" if joined else "unlinked"
        return LinkEvent(valid_us, kind, part, specification.part, symbol, specification.target, reason)


def _mean(valid_us: int, states: list[ObjectState]) -> ObjectState:
    """The mean of the parts, which is as certain as the mean of their covariances."""
    x_m, y_m, vx_m_s, vy_m_s = np.mean([each[1:5] for each in states], axis=0).tolist()
    covariance = np.mean([each.covariance for each in states], axis=0)
    return ObjectState(valid_us, x_m, y_m, vx_m_s, vy_m_s, covariance)
