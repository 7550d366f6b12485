"""The search for a plan: forward chaining with control formulas (thesis 7.4.2).

A node is settled by the state it leads to, what is under way, and the remainders of the control formulas: one that was
met before, no later and no dearer, is not looked at again. A plan has ended well when nothing is under way, all goals
hold, and every control formula holds if the last state persists for ever.
"""

import gc
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import StrEnum
from heapq import heappop, heappush
from itertools import count
from typing import Any, Final

from dyknow.model.errors import TextError
from planning.domains.model import Declarations, GoalStatement, InGoal
from planning.domains.sorts import free_variables
from planning.search.control import ControlFormulas, closed
from planning.search.grounding import FALSE, TRUE, Grounder, Stopped
from planning.search.nodes import MovingState, SearchNode
from planning.search.operators import Schema
from planning.search.plans import MissionPlan
from planning.search.successors import Successors
from planning.search.tasks import PlanningTask
from reasoning.formulas import tree
from reasoning.formulas.evaluation import Test

LIMIT_NODES: Final = 2_000_000
POLLED_EVERY: Final = 64
_NONE: Final[dict[str, Any]] = {}
_SHOWN_CAUSES: Final = 4


class Strategy(StrEnum):
    """In which order nodes are looked at, and whether the first plan ends the search."""

    DEPTH_FIRST = "depth-first"
    BRANCH_AND_BOUND = "branch-and-bound"
    BEST_FIRST = "best-first"


@dataclass(frozen=True, slots=True)
class PlanFound:
    """A plan, how many nodes were looked at, and whether no cheaper one exists."""

    plan: MissionPlan
    nodes: int
    is_cheapest: bool


@dataclass(frozen=True, slots=True)
class NoPlan:
    """Why there is no plan, and what ended branches of the search most often.

    Attributes:
        is_certain: the whole space was searched, or a goal cannot be; else the search gave up.
    """

    reason: str
    causes: tuple[str, ...]
    nodes: int
    is_certain: bool


@dataclass(slots=True)
class _Goals:
    """Goals of one attempt: their tests; the one that failed last is looked at first."""

    tests: list[tuple[str, Test]]
    failed: dict[str, int] = field(default_factory=dict)

    def hold(self, state: dict[str, Any]) -> bool:
        for at, (name, test) in enumerate(self.tests):
            if test(0, state, _NONE, (), _NONE) != 1:
                if at:
                    self.tests.insert(0, self.tests.pop(at))
                self.failed[name] = self.failed.get(name, 0) + 1
                return False
        return True


def find_plan(
    domain: Declarations,
    problem: Declarations,
    strategy: Strategy = Strategy.DEPTH_FIRST,
    stop: Callable[[], str] = lambda: "",
    progress: Callable[[int], None] = lambda _nodes: None,
    units: Collection[str] | None = None,
) -> PlanFound | NoPlan:
    """Search for a plan.

    Args:
        domain: checked, as `parse_domain` gives it.
        problem: checked against it.
        strategy: branch-and-bound and best-first give the cheapest plan, if they are given the time.
        stop: called every now and then; a reason that is not empty ends the search.
        progress: called every now and then with the number of nodes.
        units: those that act; None for all of them.

    Raises:
        TextError: a formula grows beyond all limits over the objects of the problem.
    """
    declared = domain.joined(problem)
    dropped: list[GoalStatement] = []
    nodes = 0
    while True:
        kept = [one for one in declared.goals if all(one is not each for each in dropped)]
        search = _Search(declared, kept, dropped, stop, progress, nodes, units)
        with _without_collector():
            best = search.run(strategy)
        nodes = search.nodes
        soft = [one for one in kept if one.weight is not None]
        if isinstance(best, PlanFound) or not best.is_certain or not soft:
            return best
        lightest = min(soft, key=lambda one: one.weight or 0.0)
        dropped.append(lightest)


@contextmanager
def _without_collector() -> Iterator[None]:
    """Nothing that a search makes is in a circle: looking for circles takes half of its time, and finds none."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


class _Search:
    def __init__(
        self,
        declared: Declarations,
        goals: list[GoalStatement],
        dropped: list[GoalStatement],
        stop: Callable[[], str],
        progress: Callable[[int], None],
        nodes: int,
        units: Collection[str] | None,
    ) -> None:
        self._declared, self._statements, self._units = declared, goals, units
        self._dropped, self._stop, self._progress = dropped, stop, progress
        self.nodes, self._polls = nodes, 0
        self._seen: dict[tuple[object, ...], list[tuple[int, float]]] = {}
        self._impossible = ""

    def run(self, strategy: Strategy) -> PlanFound | NoPlan:
        try:
            root = self._prepared()
            if root is None:
                return self._none(self._impossible, is_certain=True)
            search = self._best_first if strategy is Strategy.BEST_FIRST else self._depth_first
            return search(root, strategy)
        except Stopped as stopped:
            return self._none(str(stopped), is_certain=False)
        except RecursionError:
            raise TextError(
                "a formula is nested too deep over its definitions", repair="define less by one another"
            ) from None

    def _poll(self) -> None:
        self._polls += 1
        if self._polls % POLLED_EVERY == 0 and (reason := self._stop()):
            raise Stopped(reason)

    def _prepared(self) -> SearchNode | None:
        """The root; None if a goal cannot be, or the initial state violates a control formula."""
        declared = self._declared
        task = PlanningTask(declared)
        grounder = Grounder(task, self._poll)
        self._goals = _Goals([])
        self._control = ControlFormulas(grounder)
        self._schemas: list[Schema] = []
        root = SearchNode(None)
        self._state = MovingState(task.values, root, grounder.compiler.remembered)
        events = list(task.events)
        if not self._ground_goals(grounder, events):
            return None
        all_units = tuple(one for sort in declared.units for one in task.types.members[sort])
        units = tuple(one for one in all_units if self._units is None or one in self._units) or (None,)
        if all_units and units == (None,):
            self._impossible = "no unit can act"
            return None
        self._schemas = [Schema(one, grounder, frozenset(declared.units)) for one in declared.operators]
        for one in declared.controls:
            self._control.add(one.name, closed(one.formula, free_variables(one.formula, declared)))
        self._successors = Successors(
            self._schemas,
            tuple(dict.fromkeys(units)),
            self._control,
            self._state,
            tuple(sorted(events, key=lambda e: e[0])),
        )
        residuals = self._control.initial(task.values)
        if residuals is None:
            self._impossible = f"the initial state violates the control formula {next(iter(self._control.refusals))}"
            return None
        root.residuals, root.touched = residuals, self._control.of_pairs
        return root

    def _ground_goals(self, grounder: Grounder, events: list[Any]) -> bool:
        """Whether every goal can be, as far as what never changes decides it; deadlines become control formulas."""
        parts: list[tree.Formula] = []
        grounds = []
        for one in self._statements:
            formula = closed(one.formula, free_variables(one.formula, self._declared))
            ground = grounder.ground(formula, {})
            grounds.append((one, formula, ground))
            parts += ground.parts if isinstance(ground, tree.And) else (ground,)
        formulas = [one.formula for one in self._declared.controls]
        formulas += [each.formula for one in self._declared.operators for each in one.controls]
        formulas += [one.body for one in self._declared.derived]
        formulas += [each.formula for one in self._declared.operators for each in one.preconditions]
        if any(isinstance(node, InGoal) for formula in formulas for node in tree.walk(formula)):
            grounder.goal = frozenset(parts)
        for one, formula, ground in grounds:
            name = one.name or "goal"
            if ground == FALSE:
                self._impossible = f"{name} cannot be reached: no operator changes what it is about"
                return False
            inside = ground.parts if isinstance(ground, tree.And) else (ground,)
            self._goals.tests += [(name, grounder.compiler.whole_test(part)) for part in inside if part != TRUE]
            if one.deadline_ms is not None:
                self._control.add(f"deadline of {name}", tree.Always(formula, one.deadline_ms * 1000))
                events.append((one.deadline_ms, "", None))
        return True

    def _is_goal(self, node: SearchNode) -> bool:
        return (
            not node.running
            and self._goals.hold(self._state.values)
            and self._control.accept(self._state.values, node.touched, node.residuals)
        )

    def _found(self, node: SearchNode, *, is_cheapest: bool) -> PlanFound:
        weights = sum(one.weight or 0.0 for one in self._dropped)
        unreached = tuple(one.name or "goal" for one in self._dropped)
        return PlanFound(MissionPlan(node.actions(), node.cost + weights, unreached), self.nodes, is_cheapest)

    def _is_new(self, node: SearchNode) -> bool:
        """Whether no node like it was met, as early and as cheap."""
        met = self._seen.setdefault(node.key(), [])
        if any(at_ms <= node.at_ms and cost <= node.cost for at_ms, cost in met):
            return False
        met[:] = [one for one in met if one[0] < node.at_ms or one[1] < node.cost]
        met.append((node.at_ms, node.cost))
        return True

    def _count(self) -> None:
        self.nodes += 1
        self._poll()
        if self.nodes % 1024 == 0:
            self._progress(self.nodes)
        if self.nodes > LIMIT_NODES:
            raise Stopped(f"gave up after {LIMIT_NODES} nodes")

    def _depth_first(self, root: SearchNode, strategy: Strategy) -> PlanFound | NoPlan:
        best: SearchNode | None = None
        bound = float("inf")
        stack: list[Iterator[SearchNode]] = [iter((root,))]
        try:
            while stack:
                node = next(stack[-1], None)
                if node is None:
                    stack.pop()
                    continue
                self._count()
                if node.cost >= bound or not self._is_new(node):
                    continue
                if self._is_goal(node):
                    if strategy is Strategy.DEPTH_FIRST:
                        return self._found(node, is_cheapest=False)
                    best, bound = node, node.cost
                    continue
                stack.append(self._successors.of(node, prefer_waiting=self._goals.hold(self._state.values)))
        except Stopped:
            if best is None:
                raise
            return self._found(best, is_cheapest=False)
        return self._none("", is_certain=True) if best is None else self._found(best, is_cheapest=not self._dropped)

    def _best_first(self, root: SearchNode, _strategy: Strategy) -> PlanFound | NoPlan:
        order = count()
        waiting = [(0.0, 0, next(order), root)]
        while waiting:
            *_, node = heappop(waiting)
            self._state.go_to(node)
            self._count()
            if self._is_goal(node):
                return self._found(node, is_cheapest=not self._dropped)
            for child in self._successors.of(node):
                if self._is_new(child):
                    heappush(waiting, (child.cost, -child.depth, next(order), child))
        return self._none("", is_certain=True)

    def _none(self, reason: str, *, is_certain: bool) -> NoPlan:
        """Why there is no plan."""
        if is_certain and not reason:
            reason = f"the whole search space was searched, {self.nodes} nodes"
        return NoPlan(reason, tuple(self._causes()), self.nodes, is_certain)

    def _causes(self) -> Iterator[str]:
        goals = getattr(self, "_goals", None)
        if goals is not None and goals.failed:
            name, times = max(goals.failed.items(), key=lambda one: one[1])
            yield f"{name} did not hold in {times} states"
        refused = dict(self._control.refusals) if hasattr(self, "_control") else {}
        for schema in getattr(self, "_schemas", ()):
            refused |= schema.refused
        for name, times in sorted(refused.items(), key=lambda one: -one[1])[:_SHOWN_CAUSES]:
            yield f"{name} refused {times} times"
        conflicts = self._successors.conflicts if hasattr(self, "_successors") else {}
        for cause, times in sorted(conflicts.items(), key=lambda one: -one[1])[:_SHOWN_CAUSES]:
            yield f"{times} times {cause}"
