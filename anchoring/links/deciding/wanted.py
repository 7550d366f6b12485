"""Objects that are described before they are seen (top-down identification; find, in the words of Coradeschi and Saffiotti).

A wanted object has a symbol, a type and a description: a formula over the symbol or `from`, and over `to` where a place is
given. It is evaluated over the state that an object below has as one of that type, for each of them, linked or not, from each of
its states on. The first for which it becomes true is the wanted object; of several in one state that with the least
score, then by symbol.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Final, NamedTuple

from anchoring.links.assignment import natural
from anchoring.links.deciding.conditions import PairCondition
from anchoring.links.objects import LinkObject, LinkReason
from anchoring.links.prediction import ObjectPrediction, certain
from anchoring.links.specification import FROM, LinkSpecification
from anchoring.links.states import ObjectState
from dyknow import NO_VALUE, Value
from reasoning import Progressing
from reasoning.formulas.tree import And, Compare, Const, Feature, Formula

KNOWN_SPEED_M_S: Final = 3.0
"""The speed of an object has no value while the standard deviation of its velocity is greater."""


class Sighting(NamedTuple):
    """What was found to be a wanted object, and why."""

    source: LinkObject
    reason: LinkReason


class WantedObject:
    """One symbol that is looked for among the objects that a link process starts from.

    Args:
        place: where it is thought to be; None: anywhere.
    """

    def __init__(
        self, symbol: str, specification: LinkSpecification, description: Formula, place: ObjectState | None = None
    ) -> None:
        self.symbol = symbol
        known = replace(specification, features={"speed": _known_speed, **specification.features})
        self._condition = PairCondition(description, known, symbol)
        self._score = specification.score
        self._place: ObjectPrediction | None = None if place is None else certain(place)
        self._evaluations: dict[str, Progressing] = {}

    def step(self, valid_us: int, sources: Iterable[tuple[LinkObject, ObjectState]]) -> Sighting | None:
        """Take all that may be it, each with its state as an object of the type; what it is, once that is known."""
        sightings: list[tuple[float, tuple[int, str], LinkObject]] = []
        for one, state in sources:
            evaluation = self._evaluations.get(one.symbol)
            if evaluation is None:
                evaluation = self._evaluations[one.symbol] = self._condition.start()
            if evaluation.verdict == "undecided":
                self._condition.step(evaluation, valid_us, state, self._place)
            if evaluation.verdict == "true":
                score = 0.0 if self._place is None else self._score(state, self._place)
                sightings.append((score, natural(one.symbol), one))
        if not sightings:
            return None
        chosen = min(sightings, key=lambda each: each[:2])[2]
        explanation = self._evaluations[chosen.symbol].explain()
        return Sighting(chosen, LinkReason("wanted", self._condition.formula, explanation))

    def drop(self, symbol: str) -> None:
        """An object below is gone: one that comes later under its name is another."""
        self._evaluations.pop(symbol, None)


def described(values: Mapping[str, Value]) -> Formula:
    """The description that all attributes have these values."""
    return And(tuple(Compare("=", Feature(name, (FROM,)), Const(value)) for name, value in values.items()))


def _known_speed(state: ObjectState) -> Value:
    variance = max(float(state.covariance[2, 2]), float(state.covariance[3, 3]))
    return state.speed_m_s if variance <= KNOWN_SPEED_M_S**2 else NO_VALUE
