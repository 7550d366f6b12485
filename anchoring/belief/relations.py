"""Beliefs about binary relations between instances: on, next to, carries.

A relation is an attribute with two values. It grows older as such, p <- 1/2 + (p - 1/2) exp(-t / tau), is created once it is
likelier than one threshold and dropped once it is less likely than another; then nothing is known of it any longer.
"""

import heapq
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import ceil, exp, inf, log

import numpy as np

from dyknow import US_PER_S
from dyknow.anchoring.belief.arrays import Floats
from dyknow.anchoring.belief.description import RelationKind
from dyknow.anchoring.belief.observations import ReportedRelation
from dyknow.anchoring.belief.reports import RELATION_CREATED, RELATION_DROPPED, LifeEvent

_LEAST, _ACTIVE, _FEW = 1e-12, 1e-3, 1_000
"""An observation that is less probably of an instance is irrelevant to its relations; where there are many, sooner."""


class _Belief:
    """That one relation holds."""

    __slots__ = ("at_us", "crossing_us", "present", "probability")

    def __init__(self, probability: float, at_us: int) -> None:
        self.probability, self.at_us, self.present, self.crossing_us = probability, at_us, False, inf


class RelationBeliefs:
    """All relations of all instances, by their names."""

    def __init__(self, kinds: Sequence[RelationKind]) -> None:
        self.kinds = {each.name: each for each in kinds}
        self._to = defaultdict[tuple[str, str], dict[str, _Belief]](dict)
        self._due: list[tuple[float, str, str, str]] = []

    def of(self, instance: str, now_us: int) -> Mapping[tuple[str, str], float]:
        """The relations that an instance has: (name, other) -> probability."""
        return {
            (name, other): self._aged(name, beliefs[instance], now_us)
            for (name, other), beliefs in self._to.items()
            if instance in beliefs and beliefs[instance].present
        }

    def every(self, now_us: int) -> Mapping[tuple[str, str, str], float]:
        """The probabilities of all created relations, by (name, instance, other)."""
        return {
            (name, instance, other): self._aged(name, belief, now_us)
            for (name, other), beliefs in self._to.items()
            for instance, belief in beliefs.items()
            if belief.present
        }

    def revise(self, name: str, instance: str, other: str, probability: float, now_us: int) -> Iterator[LifeEvent]:
        """Believe one of these with another probability."""
        belief = self._to[name, other][instance]
        belief.probability, belief.at_us = probability, now_us
        yield from self._watch(self.kinds[name], instance, other, now_us)

    def likelihood(self, reported: ReportedRelation, rows: Mapping[str, int], now_us: int) -> Floats:
        """(N,) of a report, for each instance in `rows`."""
        kind = self.kinds[reported.name]
        found = np.full(len(rows), _likelihood(kind, kind.prior, holds=reported.holds))
        for instance, belief in self._to.get((reported.name, reported.other), {}).items():
            found[rows[instance]] = _likelihood(kind, self._aged(kind.name, belief, now_us), holds=reported.holds)
        return found

    def of_new(self, reported: ReportedRelation) -> float:
        """Likelihood of a report about something that is not known yet."""
        kind = self.kinds[reported.name]
        return _likelihood(kind, kind.prior, holds=reported.holds)

    def update(self, reports: Iterable[tuple[str, float, ReportedRelation]], now_us: int) -> Iterator[LifeEvent]:
        """Take in the reports of a look: about which instance each is with what probability, given that it exists."""
        about = defaultdict[tuple[str, str, str], list[tuple[float, bool]]](list)
        active = [each for each in reports if each[0] != each[2].other]
        least = _LEAST if len(active) <= _FEW else _ACTIVE
        for instance, weight, reported in active:
            if weight >= least:
                about[reported.name, instance, reported.other].append((weight, reported.holds))
        for (name, instance, other), found in about.items():
            yield from self._update(self.kinds[name], instance, other, found, now_us)

    def _update(
        self, kind: RelationKind, instance: str, other: str, found: Sequence[tuple[float, bool]], now_us: int
    ) -> Iterator[LifeEvent]:
        belief = self._to[kind.name, other].setdefault(instance, _Belief(kind.prior, now_us))
        before = self._aged(kind.name, belief, now_us)
        belief.at_us, belief.probability = now_us, before
        for weight, holds in found:
            total = _likelihood(kind, before, holds=holds)
            if total > 0.0:
                after = before * (kind.right if holds else 1.0 - kind.right) / total
                belief.probability += weight * (after - before)
        if not belief.present and belief.probability > kind.create:
            belief.present = True
            yield _event(now_us, RELATION_CREATED, kind.name, instance, other)
        if belief.present:
            yield from self._watch(kind, instance, other, now_us)

    def predict(self, now_us: int) -> Iterator[LifeEvent]:
        """Drop the relations that are too old."""
        while self._due and self._due[0][0] <= now_us:
            at_us, name, instance, other = heapq.heappop(self._due)
            belief = self._to.get((name, other), {}).get(instance)
            if belief is not None and belief.present and belief.crossing_us == at_us:
                yield from self._drop(name, instance, other, int(at_us))

    def forget(self, instance: str, now_us: int) -> Iterator[LifeEvent]:
        """An instance was deleted, and so are relations of it and to it."""
        for (name, other), beliefs in list(self._to.items()):
            for one in list(beliefs) if other == instance else [instance]:
                if one in beliefs:
                    if beliefs[one].present:
                        yield _event(now_us, RELATION_DROPPED, name, one, other)
                    del beliefs[one]
            if not beliefs:
                del self._to[name, other]

    def _watch(self, kind: RelationKind, instance: str, other: str, now_us: int) -> Iterator[LifeEvent]:
        """Drop what is not believed; else note when age alone will have it dropped."""
        belief = self._to[kind.name, other][instance]
        if belief.probability < kind.drop:
            yield from self._drop(kind.name, instance, other, now_us)
        elif kind.drop > 0.5 and kind.ageing_s < inf:
            seconds = kind.ageing_s * log((belief.probability - 0.5) / (kind.drop - 0.5))
            belief.crossing_us = now_us + max(1, ceil(seconds * US_PER_S))
            heapq.heappush(self._due, (belief.crossing_us, kind.name, instance, other))

    def _drop(self, name: str, instance: str, other: str, at_us: int) -> Iterator[LifeEvent]:
        del self._to[name, other][instance]
        if not self._to[name, other]:
            del self._to[name, other]
        yield _event(at_us, RELATION_DROPPED, name, instance, other)

    def _aged(self, name: str, belief: _Belief, now_us: int) -> float:
        seconds = (now_us - belief.at_us) / US_PER_S
        return 0.5 + (belief.probability - 0.5) * exp(-seconds / self.kinds[name].ageing_s)


def _likelihood(kind: RelationKind, probability: float, *, holds: bool) -> float:
    reported = probability * kind.right + (1.0 - probability) * kind.wrong
    return reported if holds else 1.0 - reported


def _event(at_us: int, kind: str, name: str, instance: str, other: str) -> LifeEvent:
    return LifeEvent(at_us, kind, instance, what=f"{name} {other}")
