"""All instances as arrays: their existence, their attributes, their types."""

from collections.abc import Mapping, Sequence
from math import exp, inf, log
from typing import Any

import numpy as np

from dyknow import US_PER_S
from dyknow.anchoring.belief.arrays import Flags, Floats, Indices
from dyknow.anchoring.belief.categories import CategoricalBeliefs
from dyknow.anchoring.belief.description import InitialInstance, WorldModel
from dyknow.anchoring.belief.gaussians import GaussianBeliefs
from dyknow.anchoring.belief.observations import TYPE, EncodedLook
from dyknow.anchoring.belief.reports import (
    ATTRIBUTE_CREATED,
    ATTRIBUTE_DROPPED,
    CONFIRMED,
    TENTATIVE,
    BelievedInstance,
    GaussianBelief,
    LifeEvent,
)


class InstanceTable:
    """N instances.

    Args:
        prefix: of the names of new ones.

    Attributes:
        names: of each; never used again.
        existence: (N,) P(e_i = 1).
        confirmed: (N,) whether it has been.
        gaussian, categorical: beliefs about attributes; types are the categorical attribute `type`.
    """

    def __init__(self, model: WorldModel, prefix: str = "i") -> None:
        self._model, self._prefix = model, prefix
        self.names: list[str] = []
        self.existence, self.confirmed = np.zeros(0), np.zeros(0, dtype=np.bool_)
        self.gaussian = {each.name: GaussianBeliefs(each) for each in model.gaussian}
        self.categorical = {each.name: CategoricalBeliefs(each) for each in model.categorical}
        self.categorical[TYPE] = CategoricalBeliefs(model.types.belief)
        self._taken = {each.name for each in model.initial}
        self._count = 0
        if model.initial:
            self._begin(model.initial)

    def __len__(self) -> int:
        return len(self.names)

    def rows(self) -> dict[str, int]:
        """The place of each instance."""
        return {name: row for row, name in enumerate(self.names)}

    def beliefs(self) -> dict[str, GaussianBeliefs | CategoricalBeliefs]:
        """About every attribute, and `type`."""
        return {**self.gaussian, **self.categorical}

    def predict(self, seconds: float) -> None:
        """Equations (6) and (7) for all."""
        if self._model.lifetime_s < inf:
            self.existence = self.existence * exp(-seconds / self._model.lifetime_s)
        for beliefs in self.beliefs().values():
            beliefs.predict(seconds)

    def deletions_us(self, valid_us: int) -> Floats:
        """(N,) when existence will have fallen to the threshold of deletion, if nothing is observed."""
        if self._model.lifetime_s == inf:
            return np.full(len(self), inf)
        delete = self._model.thresholds.delete
        seconds = self._model.lifetime_s * (np.log(np.maximum(self.existence, 1e-300)) - log(delete))
        return np.asarray(valid_us + np.ceil(seconds * US_PER_S))

    def decide(self, valid_us: int) -> list[LifeEvent]:
        """Confirm instances, create and drop attributes; returns the events."""
        events = []
        fresh = ~self.confirmed & (self.existence > self._model.thresholds.confirm)
        if fresh.any():
            self.confirmed |= fresh
            events += [self.event(valid_us, CONFIRMED, row) for row in np.flatnonzero(fresh).tolist()]
        for name, beliefs in self.beliefs().items():
            if beliefs.attribute.is_optional:
                created, dropped = beliefs.decide()
                events += [self.event(valid_us, ATTRIBUTE_CREATED, row, name) for row in created.tolist()]
                events += [self.event(valid_us, ATTRIBUTE_DROPPED, row, name) for row in dropped.tolist()]
        return events

    def event(self, valid_us: int, kind: str, row: int, what: str = "", because: str = "") -> LifeEvent:
        return LifeEvent(valid_us, kind, self.names[row], float(self.existence[row]), what, because)

    def bear(self, look: EncodedLook, cols: Indices, existence: Floats) -> list[str]:
        """New tentative instances of some observations of a look; their names."""
        for name, gaussian in self.gaussian.items():
            measured = look.gaussian.get(name)
            born = [
                gaussian.born(None, None)
                if measured is None or (measured.among is not None and not measured.among[col])
                else gaussian.born(measured.values[col], measured.noise[col])
                for col in cols.tolist()
            ]
            gaussian.append(np.array([each[0] for each in born]), np.array([each[1] for each in born]))
        for name, categorical in self.categorical.items():
            likely = look.categorical.get(name)
            categorical.append(
                np.array(
                    [categorical.born(None if likely is None else likely.likelihood[col]) for col in cols.tolist()]
                )
            )
        names = [self._name() for _ in cols]
        self.names = [*self.names, *names]
        self.existence = np.concatenate((self.existence, existence))
        self.confirmed = np.concatenate((self.confirmed, np.zeros(len(names), dtype=np.bool_)))
        return names

    def keep(self, which: Flags) -> None:
        """Remove all others."""
        self.names = [name for name, kept in zip(self.names, which.tolist(), strict=True) if kept]
        self.existence, self.confirmed = self.existence[which], self.confirmed[which]
        for beliefs in self.beliefs().values():
            beliefs.keep(which)

    def view(self, row: int, relations: Mapping[tuple[str, str], float]) -> BelievedInstance:
        """One instance as a value of its own."""
        types = self.categorical[TYPE]
        return BelievedInstance(
            self.names[row],
            float(self.existence[row]),
            CONFIRMED if self.confirmed[row] else TENTATIVE,
            _by_value(types, row),
            {
                name: GaussianBelief(each.mean[row].copy(), each.covariance[row].copy())
                for name, each in self.gaussian.items()
                if each.present[row]
            },
            {
                name: _by_value(each, row)
                for name, each in self.categorical.items()
                if name != TYPE and each.present[row]
            },
            relations,
        )

    def _begin(self, initial: Sequence[InitialInstance]) -> None:
        self.names = [each.name for each in initial]
        self.existence = np.array([each.existence for each in initial])
        self.confirmed = self.existence > self._model.thresholds.confirm
        for name, gaussian in self.gaussian.items():
            known = [each.gaussian.get(name) or gaussian.born(None, None) for each in initial]
            gaussian.append(np.array([each[0] for each in known]), np.array([each[1] for each in known]))
        for name, categorical in self.categorical.items():
            shares = [each.categorical.get(name, categorical.attribute.prior) for each in initial]
            categorical.append(np.array(shares))
        self.decide(0)

    def _name(self) -> str:
        self._count += 1
        while (name := f"{self._prefix}{self._count}") in self._taken:
            self._count += 1
        return name


def _by_value(beliefs: CategoricalBeliefs, row: int) -> Mapping[str, Any]:
    return dict(zip(beliefs.attribute.values, beliefs.shares[row].tolist(), strict=True))
