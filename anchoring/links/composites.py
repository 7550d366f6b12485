"""Objects made of others: a convoy, a queue, a car with its trailer (Heintz, Rudol and Doherty, section VI).

A composite has no percept of its own: it is anchored while one of its parts is. Two parts belong together once a condition
over both has become true, until another one fails; a composite is what is connected by that. Its symbol stays with the group
that has most of its parts.

    convoy = CompositeSpecification("world", "convoy", together, stays)
    linkage = ObjectLinkage([vision_to_world, convoy])
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, Protocol

import numpy as np

from dyknow.anchoring.links.assignment import assigned, natural
from dyknow.anchoring.links.deciding.conditions import Ends, PairCondition
from dyknow.anchoring.links.deciding.context import ConditionContext
from dyknow.anchoring.links.deciding.nearness import NearObjects
from dyknow.anchoring.links.objects import EventKind, LinkObject, LinkReason, ObjectLink
from dyknow.anchoring.links.prediction import certain
from dyknow.anchoring.links.specification import ALWAYS_TRUE, LinkSpecification
from dyknow.anchoring.links.states import ObjectState
from dyknow.reasoning import Explanation, Progressing
from dyknow.reasoning.formulas.tree import Formula

PARTS: Final = "parts"
COUNT: Final = "count"
"""Attributes of a composite: the symbols of its parts, and their number."""
MOST_PAIRS: Final = 10_000
"""Of parts that are near each other; more are counted, and left out."""


@dataclass(frozen=True, slots=True)
class CompositeSpecification:
    """Objects of one type that are parts of objects of another.

    Attributes:
        source, target: the types of the parts, and of the composites.
        together: over `from` and `to`, two parts, the one whose symbol is first being `from`; true: they belong together.
            It implies a distance between them.
        stays: over the same; false: they no longer do.
        least: the number of parts that make a composite.
        streams: features of one part that are streams of their own, and no attributes.
    """

    source: str
    target: str
    together: Formula
    stays: Formula = ALWAYS_TRUE
    least: int = 2
    streams: frozenset[str] = frozenset()

    @property
    def name(self) -> str:
        """As it is printed."""
        return f"{self.source} -> {self.target}"


def check_ends(specifications: Iterable[LinkSpecification | CompositeSpecification]) -> None:
    """Composites are made of their parts alone: no link leads to them; raises ValueError."""
    every = list(specifications)
    composites = {each.target for each in every if isinstance(each, CompositeSpecification)}
    for each in every:
        if isinstance(each, LinkSpecification) and each.target in composites:
            raise ValueError(f"{each.name}: composites are made of their parts, and no link leads to them")


class CompositePorts(Protocol):
    """The interface from composites to the structures they belong to."""

    context: ConditionContext

    def create(self, valid_us: int, target: str, state: ObjectState, symbol: str | None = None) -> LinkObject:
        """A new object, with a symbol of its own."""

    def discard(self, valid_us: int, one: LinkObject, reason: LinkReason) -> None:
        """An object is gone."""

    def on_event(self, valid_us: int, kind: EventKind, link: ObjectLink, reason: LinkReason) -> None:
        """A part has come, or gone."""


class CompositeObjects:
    """All composites of one specification. Each has a link from each of its parts, by their symbols.

    Attributes:
        left_out: pairs of parts beyond `MOST_PAIRS`, which were not looked at in the latest tick.

    Raises:
        ValueError: `together` implies no distance, so that every two objects would have to be looked at.
    """

    def __init__(self, specification: CompositeSpecification, ports: CompositePorts) -> None:
        self.made, self.name, self._ports = specification, specification.name, ports
        self.specification = LinkSpecification(
            specification.source, specification.target, specification.together, specification.stays
        )
        both = replace(self.specification, target=specification.source, streams=specification.streams)
        self._together, self._stays = (
            PairCondition(each, both, context=ports.context) for each in (specification.together, specification.stays)
        )
        gate = self._together.gate
        if gate is None:
            raise ValueError(f"parts of {specification.target} are near each other: `xy_dist[from, to] < 30 and ...`")
        self._bound_m = gate.bound_m
        self.left_out = 0
        self._evaluations: dict[tuple[str, str], Progressing] = {}
        self._bonds: dict[tuple[str, str], Progressing] = {}
        self._because: dict[tuple[str, str], tuple[Explanation, ...]] = {}
        self._parts: dict[str, LinkObject] = {}

    def step(self, valid_us: int, parts: Mapping[str, LinkObject], composites: Mapping[str, LinkObject]) -> None:
        """Take the states of all parts that there are at a time; those without one at that time stay as they were."""
        self._drop_gone(valid_us, parts, composites)
        fresh = {symbol: one for symbol, one in parts.items() if one.state.valid_us == valid_us}
        failed = self._keep(valid_us, fresh)
        self._join(valid_us, fresh)
        self._regroup(valid_us, parts, composites, failed)

    def _drop_gone(self, valid_us: int, parts: Mapping[str, LinkObject], composites: Mapping[str, LinkObject]) -> None:
        """Forget the parts that are gone; a new object under the symbol of such a part is another one."""
        gone = {symbol for symbol, one in self._parts.items() if parts.get(symbol) is not one}
        self._parts = dict(parts)
        if not gone:
            return
        for table in (self._evaluations, self._bonds, self._because):
            for pair in [pair for pair in table if not gone.isdisjoint(pair)]:
                del table[pair]
        for one in composites.values():
            for symbol in sorted(one.incoming.keys() & gone & parts.keys(), key=natural):
                self.unlink(valid_us, one.incoming[symbol], LinkReason("maintain", self._stays.formula))

    def _keep(self, valid_us: int, fresh: Mapping[str, LinkObject]) -> dict[str, LinkReason]:
        """Take the states of those that belong together; why parts no longer do."""
        failed: dict[str, LinkReason] = {}
        for pair in [pair for pair in self._bonds if fresh.keys() >= set(pair)]:
            bond, (one, other) = self._bonds[pair], (fresh[symbol] for symbol in pair)
            self._stays.step(bond, valid_us, one.state, other.whereabouts, Ends(*pair))
            if bond.verdict == "false":
                reason = LinkReason("maintain", self._stays.formula, bond.explain())
                failed.update(dict.fromkeys(pair, reason))
                del self._bonds[pair], self._because[pair]
        return failed

    def _join(self, valid_us: int, fresh: Mapping[str, LinkObject]) -> None:
        """Evaluate pairs that may belong together; a pair that failed begins again at the next state."""
        near = NearObjects({each.symbol: each.whereabouts for each in fresh.values()}, self._bound_m, keeps_all=False)
        pairs = {pair for pair in self._evaluations if fresh.keys() >= set(pair)}
        for symbol, one in fresh.items():
            pairs |= {_ordered(symbol, other) for other, _ in near.of(one.state, ()) if other != symbol}
        new = sorted(pairs - self._bonds.keys())
        self.left_out = max(0, len(new) + len(self._bonds) - MOST_PAIRS)
        for pair in new[: max(0, MOST_PAIRS - len(self._bonds))]:
            one, other = (fresh[symbol] for symbol in pair)
            evaluation = self._evaluations.setdefault(pair, self._together.start())
            self._together.step(evaluation, valid_us, one.state, other.whereabouts, Ends(*pair))
            if evaluation.verdict != "undecided":
                del self._evaluations[pair]
            if evaluation.verdict == "true":
                self._bonds[pair], self._because[pair] = self._stays.start(), evaluation.explain()

    def _regroup(
        self,
        valid_us: int,
        parts: Mapping[str, LinkObject],
        composites: Mapping[str, LinkObject],
        failed: Mapping[str, LinkReason],
    ) -> None:
        """Give each group its symbol, tell which parts came and went, and let each have its state."""
        groups = [group for group in self._groups() if len(group) >= self.made.least]
        shared = {
            (symbol, str(at)): -float(len(common))
            for symbol, one in composites.items()
            for at, group in enumerate(groups)
            if (common := one.incoming.keys() & group)
        }
        chosen = {int(at): symbol for symbol, at in assigned(shared)}
        gone = LinkReason("maintain", self._stays.formula)
        for one in [one for symbol, one in composites.items() if symbol not in chosen.values()]:
            reason = next((failed[name] for name in one.incoming if name in failed), gone)
            self._ports.discard(valid_us, one, reason)
        for at, group in enumerate(groups):
            state = _mean(valid_us, [parts[name] for name in sorted(group, key=natural)])
            one = composites[chosen[at]] if at in chosen else self._ports.create(valid_us, self.made.target, state)
            kind: EventKind = "reestablished" if at in chosen else "established"
            for name in [name for name in one.incoming if name not in group]:
                self._ports.on_event(valid_us, "unlinked", one.incoming.pop(name), failed.get(name, gone))
            for name in sorted(group - one.incoming.keys(), key=natural):
                link = one.incoming[name] = ObjectLink(self, parts[name], one, valid_us)
                self._ports.on_event(valid_us, kind, link, self._reason(name))
            self._update(valid_us, one, state)

    def _update(self, valid_us: int, one: LinkObject, state: ObjectState) -> None:
        sources = [link.source for link in one.incoming.values() if link.source.state.valid_us == valid_us]
        if any(each.prediction is None for each in sources):
            one.observe(state)
        elif sources:
            one.expect(certain(state))

    def _reason(self, part: str) -> LinkReason:
        """Why it belongs to another."""
        why = next((found for pair, found in self._because.items() if part in pair), ())
        return LinkReason("establish", self._together.formula, why)

    def rename(self, before: str, after: str, composites: Iterable[LinkObject]) -> None:
        """A part has another symbol."""

        def renamed(pair: tuple[str, str]) -> tuple[str, str]:
            one, other = (after if symbol == before else symbol for symbol in pair)
            return _ordered(one, other)

        if before in self._parts:
            self._parts[after] = self._parts.pop(before)
        self._evaluations = {renamed(pair): each for pair, each in self._evaluations.items()}
        self._bonds = {renamed(pair): each for pair, each in self._bonds.items()}
        self._because = {renamed(pair): each for pair, each in self._because.items()}
        for one in composites:
            one.incoming = {after if name == before else name: link for name, link in one.incoming.items()}

    def unlink(self, valid_us: int, link: ObjectLink, reason: LinkReason) -> None:
        """A part belongs to a composite no longer."""
        incoming = link.target.incoming
        link.target.incoming = {name: each for name, each in incoming.items() if each is not link}
        self._ports.on_event(valid_us, "unlinked", link, reason)

    def _groups(self) -> list[set[str]]:
        """Parts that are connected by belonging together."""
        beside: dict[str, set[str]] = {}
        for one, other in self._bonds:
            beside.setdefault(one, set()).add(other)
            beside.setdefault(other, set()).add(one)
        groups: list[set[str]] = []
        while beside:
            waiting, group = [next(iter(beside))], set[str]()
            while waiting:
                one = waiting.pop()
                group.add(one)
                waiting += beside.pop(one, ())
            groups.append(group)
        return sorted(groups, key=lambda group: min(map(natural, group)))


def _ordered(one: str, other: str) -> tuple[str, str]:
    return (one, other) if natural(one) < natural(other) else (other, one)


def _mean(valid_us: int, parts: Sequence[LinkObject]) -> ObjectState:
    """The mean of the parts, which is as certain as the mean of their covariances."""
    states, symbols = [each.state for each in parts], [each.symbol for each in parts]
    x_m, y_m, vx_m_s, vy_m_s = np.mean([each[1:5] for each in states], axis=0).tolist()
    covariance = np.mean([each.covariance for each in states], axis=0)
    return ObjectState(valid_us, x_m, y_m, vx_m_s, vy_m_s, covariance, {PARTS: " ".join(symbols), COUNT: len(symbols)})
