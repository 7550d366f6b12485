"""How far a state is from the goal: the cost of a relaxed plan, in which all that was ever so stays so.

Conditions are taken apart into a graph of conjunctions and disjunctions over atoms. From a state costs spread through
it: a fact in the state costs nothing, an action one more than the sum of its conditions, its effects as much as it (the
additive heuristic of Bonet and Geffner). An atom that compares what is calculated counts as brought about by whatever
changes it.
"""

from collections.abc import Callable, Iterable, Iterator
from heapq import heappop, heappush
from math import inf
from typing import Any, Final, NamedTuple

from dyknow.model.sample import Value
from dyknow.planning.search.grounding import Grounder
from dyknow.planning.search.nodes import SearchNode
from dyknow.planning.search.operators import OperatorInstance, Schema, Write
from dyknow.reasoning.formulas import tree
from dyknow.reasoning.formulas.evaluation import Test

LIMIT_INSTANCES: Final = 10_000
"""Most instances of operators that are looked at: with more there is no estimate."""
URGENT: Final = 4.0
"""How many times a goal with a deadline counts."""
_NONE: Final[dict[str, Any]] = {}
_UNKNOWN: Final = object()


class TooManyInstances(Exception):
    """The operators have more instances than an estimate can look at."""


class _Leaf(NamedTuple):
    """An atom of the graph: its number, its test, its truth as a digit, and which values make it true, if one label does."""

    number: int
    test: Test
    wanted: int
    holds_for: Callable[[Value], bool] | None


class Estimator:
    """Estimates for one problem.

    Raises:
        TooManyInstances: when it is made.
        Stopped: when it is made, if the search is to end.
    """

    def __init__(
        self,
        grounder: Grounder,
        schemas: Iterable[Schema],
        units: tuple[str | None, ...],
        goals: Iterable[tuple[tree.Formula, bool]],
        events: Iterable[tuple[int, str, Value]],
    ) -> None:
        self._grounder = grounder
        self._parents: list[list[int]] = []
        self._needs: list[int] = []
        self._extra: list[int] = []
        self._effects: dict[int, list[tuple[str, Any]]] = {}
        self._leaves: list[_Leaf] = []
        self._leaves_of: dict[str, list[_Leaf]] = {}
        self._known: dict[tuple[int, bool], tuple[tree.Formula, int]] = {}
        self._true = self._made(0)
        self._events = [(label, value) for _, label, value in events]
        count = 0
        for schema in schemas:
            for instance in _instances(schema, units):
                count += 1
                if count > LIMIT_INSTANCES:
                    raise TooManyInstances
                self._add(instance)
        self._goals = [(self._node(goal, True), is_urgent) for goal, is_urgent in goals]

    def _made(self, needs: int, extra: int = 0) -> int:
        self._parents.append([])
        self._needs.append(needs)
        self._extra.append(extra)
        return len(self._parents) - 1

    def _add(self, instance: OperatorInstance) -> None:
        action = self._joined([self._node(one, True) for one in instance.conditions], extra=1)
        for one in instance.effects:
            if one.condition is None:
                self._effects.setdefault(action, []).append((one.label, _value(one)))
            else:
                conditional = self._joined([action, self._node(one.condition, True)])
                self._effects.setdefault(conditional, []).append((one.label, _value(one)))

    def _joined(self, parts: list[int], extra: int = 0) -> int:
        """A node that costs what all of these do, and `extra`."""
        inside = dict.fromkeys(parts or [self._true])
        number = self._made(len(inside), extra)
        for one in inside:
            self._parents[one].append(number)
        return number

    def _node(self, formula: tree.Formula, truth: bool) -> int:
        """The node of a formula, or of its negation."""
        known = self._known.get((id(formula), truth))
        if known is None:
            self._grounder.poll()
            known = self._known[id(formula), truth] = formula, self._of(formula, truth)
        return known[1]

    def _of(self, formula: tree.Formula, truth: bool) -> int:
        match formula:
            case tree.Const(value):
                return self._true if value is truth else self._made(1)
            case tree.Not(operand):
                return self._node(operand, not truth)
            case tree.Implies(left, right):
                ends = [self._node(left, not truth), self._node(right, truth)]
                return self._either(ends) if truth else self._joined(ends)
            case tree.And(parts) | tree.Or(parts):
                inside = [self._node(one, truth) for one in parts]
                return self._joined(inside) if isinstance(formula, tree.And) is truth else self._either(inside)
        return self._leaf(formula, truth)

    def _either(self, parts: list[int]) -> int:
        """A node with the cost of the cheapest of these; the first one to come settles it."""
        number = self._made(1)
        for one in dict.fromkeys(parts):
            self._parents[one].append(number)
        return number

    def _leaf(self, formula: tree.Formula, truth: bool) -> int:
        compiler = self._grounder.compiler
        labels = compiler.labels(formula)
        test = compiler.whole_test(formula)
        is_of_one = isinstance(formula, tree.Feature) or (
            isinstance(formula, tree.Compare)
            and isinstance(formula.left, tree.Feature)
            and isinstance(formula.right, tree.Const)
        )
        wanted = int(truth)
        holds_for: Callable[[Value], bool] | None = None
        if is_of_one:
            (label,) = labels

            def holds_for(value: Value) -> bool:
                return test(0, {label: value}, _NONE, (), _NONE) == wanted

        found = _Leaf(self._made(1), test, wanted, holds_for)
        self._leaves.append(found)
        for one in labels:
            self._leaves_of.setdefault(one, []).append(found)
        return found.number

    def estimate(self, node: SearchNode, values: dict[str, Value]) -> float:
        """Actions to the goal, about; infinite if it cannot be reached from a node whose state has these values."""
        needs, sums = list(self._needs), list(self._extra)
        costs = [inf] * len(needs)
        waiting: list[tuple[int, int]] = [(0, self._true)]
        waiting += [(0, one.number) for one in self._leaves if one.test(0, values, _NONE, (), _NONE) == one.wanted]
        for label, value in (*((one.label, one.value) for one in node.pending), *self._events[node.events :]):
            self._changed(label, value, 0, costs, waiting)
        open_goals = {number for number, _ in self._goals}
        while waiting:
            cost, number = heappop(waiting)
            if costs[number] <= cost:
                continue
            costs[number] = cost
            open_goals.discard(number)
            if not open_goals:
                break
            for label, value in self._effects.get(number, ()):
                self._changed(label, value, cost, costs, waiting)
            for parent in self._parents[number]:
                needs[parent] -= 1
                sums[parent] += cost
                if needs[parent] == 0:
                    heappush(waiting, (sums[parent], parent))
        return sum(costs[number] * (URGENT if is_urgent else 1.0) for number, is_urgent in self._goals)

    def _changed(self, label: str, value: Any, cost: int, costs: list[float], waiting: list[tuple[int, int]]) -> None:
        for leaf in self._leaves_of.get(label, ()):
            if costs[leaf.number] > cost and (value is _UNKNOWN or leaf.holds_for is None or leaf.holds_for(value)):
                heappush(waiting, (cost, leaf.number))


def _value(one: Write) -> Any:
    """The written value, if it is known beforehand."""
    return one.written.value if isinstance(one.written, tree.Const) else _UNKNOWN


def _instances(schema: Schema, units: tuple[str | None, ...]) -> Iterator[OperatorInstance]:
    for unit in units:
        yield from schema.possible(unit)
