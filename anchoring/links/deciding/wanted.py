"""Objects that are described before they are seen (seed, top-down identification; find, in the words of others).

A wanted object has a symbol, a type and a description: a formula over `from`, and over `to` where a place is given. It is
evaluated for every object below, linked or not, from its first state on. The first for which it becomes true is the wanted
object; of several in one state that with the least score, then by symbol.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import NamedTuple

from anchoring.links.assignment import natural
from anchoring.links.deciding.conditions import PairCondition
from anchoring.links.objects import LinkObject, LinkReason
from anchoring.links.prediction import ObjectPrediction, certain
from anchoring.links.specification import FROM, LinkSpecification
from anchoring.links.states import ObjectState
from dyknow import Value
from reasoning import Progressing
from reasoning.formulas.tree import And, Compare, Const, Eventually, Feature, Formula


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
        self.symbol, self.type = symbol, specification.target
        self._condition = PairCondition(description, specification)
        self._score = specification.score
        self._place: ObjectPrediction | None = None if place is None else certain(place)
        self._evaluations: dict[str, Progressing] = {}

    def step(self, valid_us: int, sources: Iterable[LinkObject]) -> Sighting | None:
        """Take the states of all that may be it; what it is, once that is known."""
        sightings: list[tuple[float, tuple[int, str], LinkObject]] = []
        evaluations: dict[str, Progressing] = {}
        for one in sources:
            evaluation = self._evaluations.get(one.symbol) or self._condition.start()
            if evaluation.verdict == "undecided":
                self._condition.step(evaluation, valid_us, one.state, self._place)
            if evaluation.verdict == "true":
                score = 0.0 if self._place is None else self._score(one.state, self._place)
                sightings.append((score, natural(one.symbol), one))
            evaluations[one.symbol] = evaluation
        self._evaluations.update(evaluations)
        if not sightings:
            return None
        chosen = min(sightings, key=lambda each: each[:2])[2]
        return Sighting(chosen, LinkReason("wanted", self._condition.formula, evaluations[chosen.symbol].explain()))

    def drop(self, symbol: str) -> None:
        """An object below is gone: one that comes later under its name is another."""
        self._evaluations.pop(symbol, None)


class WantedObjects:
    """All wanted objects, by the link process that could find them.

    Attributes:
        named: symbols that were given to what was found.
    """

    def __init__(self) -> None:
        self._wanted: dict[str, list[WantedObject]] = {}
        self.named = set[str]()

    @property
    def symbols(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(each.symbol for found in self._wanted.values() for each in found))

    def add(self, wanted: WantedObject, process: str) -> None:
        """Look for an object where a process starts from; several processes may look for one symbol."""
        self._wanted.setdefault(process, []).append(wanted)

    def found(
        self, valid_us: int, process: str, sources: Callable[[], Iterable[LinkObject]]
    ) -> Iterator[tuple[str, Sighting]]:
        """The symbols of those found among `sources`, called for each; they are no longer looked for."""
        for wanted in tuple(self._wanted.get(process, ())):
            sighting = wanted.step(valid_us, sources())
            if sighting is not None:
                for others in self._wanted.values():
                    others[:] = [each for each in others if each.symbol != wanted.symbol]
                self.named.add(wanted.symbol)
                yield wanted.symbol, sighting

    def drop(self, process: str, symbol: str) -> None:
        """An object below is gone."""
        for wanted in self._wanted.get(process, ()):
            wanted.drop(symbol)


def described(values: Mapping[str, Value]) -> Formula:
    """The description that at some time all attributes have these values."""
    return Eventually(And(tuple(Compare("=", Feature(name, (FROM,)), Const(value)) for name, value in values.items())))
