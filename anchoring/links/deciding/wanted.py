"""Objects that are described before they are seen (top-down identification; find, in the words of Coradeschi and Saffiotti).

A wanted object has a symbol, a type and a description: a formula over the symbol or `from`, and over `to` where a place is
given. It is evaluated over the state that an object below has as one of that type, for each of them, linked or not, from each of
its states on. The first for which it becomes true is the wanted object; of several in one state that with the least
score, then by symbol.

A state in which the description cannot hold from then on changes nothing while none before it is still being decided: such
states, which nearly all are, are read and no more.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Final, NamedTuple

from dyknow import NO_VALUE, Value
from dyknow.anchoring.links.assignment import natural
from dyknow.anchoring.links.deciding.conditions import PairCondition
from dyknow.anchoring.links.objects import LinkObject, LinkReason
from dyknow.anchoring.links.prediction import ObjectPrediction, certain
from dyknow.anchoring.links.specification import FROM, LinkSpecification
from dyknow.anchoring.links.states import ObjectState
from dyknow.reasoning import Progressing
from dyknow.reasoning.formulas.evaluation import TRUE, EvaluationCompiler
from dyknow.reasoning.formulas.tree import (
    Always,
    And,
    Compare,
    Const,
    Eventually,
    Feature,
    Formula,
    Or,
    Until,
    children,
    is_temporal,
)

_ENDLESS_US: Final = 2**62
KNOWN_SPEED_M_S: Final = 3.0
"""The speed of an object has no value while the standard deviation of its velocity is greater."""


class Sighting(NamedTuple):
    """The object that was found to be a wanted one, and why."""

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
        begins, self._lasts_us = _beginning(description)
        self._may_begin = EvaluationCompiler().test(begins)
        self._score = specification.score
        self._place: ObjectPrediction | None = None if place is None else certain(place)
        self._evaluations: dict[str, Progressing] = {}
        self._until_us: dict[str, int] = {}

    def step(self, valid_us: int, sources: Iterable[tuple[LinkObject, ObjectState]]) -> Sighting | None:
        """Take all candidates, each with its state as an object of the type; returns the wanted one, once known."""
        sightings: list[tuple[float, tuple[int, str], LinkObject]] = []
        for one, state in sources:
            values = self._condition.values(state, self._place)
            if self._may_begin(valid_us, values, {}, (), {}) == TRUE:
                self._until_us[one.symbol] = valid_us + self._lasts_us
            elif one.symbol not in self._until_us:
                continue
            evaluation = self._evaluations.get(one.symbol)
            if evaluation is None:
                evaluation = self._evaluations[one.symbol] = self._condition.start()
            if evaluation.verdict == "undecided":
                evaluation.progress(valid_us, values)
            if valid_us >= self._until_us[one.symbol]:
                del self._until_us[one.symbol]
            if evaluation.verdict == "true":
                score = 0.0 if self._place is None else self._score(state, self._place)
                sightings.append((score, natural(one.symbol), one))
        if not sightings:
            return None
        chosen = min(sightings, key=lambda each: each[:2])[2]
        explanation = self._evaluations[chosen.symbol].explain()
        return Sighting(chosen, LinkReason("wanted", self._condition.formula, explanation))

    def drop(self, symbol: str) -> None:
        """An object below is gone: a new one under its name is another."""
        self._evaluations.pop(symbol, None)
        self._until_us.pop(symbol, None)

    def rename(self, before: str, after: str) -> None:
        """An object below has another symbol."""
        if before in self._evaluations:
            self._evaluations[after] = self._evaluations.pop(before)
        if before in self._until_us:
            self._until_us[after] = self._until_us.pop(before)


def described(values: Mapping[str, Value]) -> Formula:
    """The description that all attributes have these values."""
    return And(tuple(Compare("=", Feature(name, (FROM,)), Const(value)) for name, value in values.items()))


def _beginning(description: Formula) -> tuple[Formula, int]:
    """The condition on the first state for a description `eventually ...`, and the longest time until it is decided."""
    if not isinstance(description, Eventually) or (description.lo_us, description.hi_us) != (0, None):
        return Const(value=True), _ENDLESS_US
    return _at_once(description.operand), _horizon_us(description.operand)


def _at_once(formula: Formula) -> Formula:
    """A condition on the present state without which a formula is not true in it."""
    if not is_temporal(formula):
        return formula
    match formula:
        case Always(operand, 0):
            return _at_once(operand)
        case And(parts):
            return And(tuple(map(_at_once, parts)))
        case Or(parts):
            return Or(tuple(map(_at_once, parts)))
    return Const(value=True)


def _horizon_us(formula: Formula) -> int:
    """How much later than a state the last one is that decides whether it is true in it."""
    below_us = max(map(_horizon_us, children(formula)), default=0)
    if isinstance(formula, Until | Always | Eventually):
        hi_us = formula.hi_us
        return min(_ENDLESS_US, below_us + hi_us) if isinstance(hi_us, int) else _ENDLESS_US
    return below_us


def _known_speed(state: ObjectState) -> Value:
    variance = max(float(state.covariance[2, 2]), float(state.covariance[3, 3]))
    return state.speed_m_s if variance <= KNOWN_SPEED_M_S**2 else NO_VALUE
