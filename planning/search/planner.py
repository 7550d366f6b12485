"""The search for a plan: forward chaining with control formulas (thesis 7.4.2).

A node is determined by its state, the actions under way, and the remainders of the control formulas: a node that was
met before, no later and no dearer, is not expanded again. A plan has ended well when nothing is under way, all goals
hold, and every control formula holds if the last state persists for ever.
"""

import gc
from collections.abc import Callable, Collection, Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import StrEnum
from heapq import heappop, heappush
from itertools import count
from typing import Any, Final, TypeAlias

from dyknow.model.errors import TextError
from dyknow.planning.domains.model import Declarations, GoalStatement, InGoal, calls
from dyknow.planning.domains.sorts import free_variables
from dyknow.planning.search.control import ControlFormulas, closed
from dyknow.planning.search.estimates import Estimator, TooManyInstances
from dyknow.planning.search.grounding import FALSE, TRUE, Grounder, Stopped
from dyknow.planning.search.nodes import MovingState, SearchNode
from dyknow.planning.search.operators import Schema
from dyknow.planning.search.plans import MissionPlan
from dyknow.planning.search.successors import Successors
from dyknow.planning.search.tasks import PlanningTask
from dyknow.reasoning.formulas import tree
from dyknow.reasoning.formulas.evaluation import Test

LIMIT_NODES: Final = 2_000_000
POLLED_EVERY: Final = 64
_NONE: Final[dict[str, Any]] = {}
_SHOWN_CAUSES: Final = 4


TURN: Final = 500
"""Dead ends after which the automatic strategy lets the heuristic search have its turn, of half as many nodes."""


STRAIGHT: Final = 8
"""Nodes on a straight way that count as one dead end."""


class Strategy(StrEnum):
    """In which order nodes are looked at, and whether the first plan ends the search.

    `AUTOMATIC` is depth-first, and from `TURN` dead ends on heuristic in turns with it: control formulas that steer well
    lead to a plan with few of them. `HEURISTIC` looks first at what seems nearest to the goal.
    """

    AUTOMATIC = "automatic"
    DEPTH_FIRST = "depth-first"
    HEURISTIC = "heuristic"
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


Steps: TypeAlias = Generator[None, None, PlanFound | NoPlan]
"""A search that stops now and then, so that another one may have its turn."""
_Seen: TypeAlias = dict[tuple[object, ...], list[tuple[int, float]]]


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
    strategy: Strategy = Strategy.AUTOMATIC,
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
        units: the units that act; None for all of them.

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
        dropped.append(min(soft, key=lambda one: (one.weight or 0.0, -search.failed(one))))


def _result(steps: Steps, nodes: int) -> PlanFound | NoPlan | None:
    """The result of a search within a number of nodes; None if it has not ended."""
    for _ in range(nodes):
        try:
            next(steps)
        except StopIteration as ended:
            found: PlanFound | NoPlan = ended.value
            return found
    return None


@contextmanager
def _without_collector() -> Iterator[None]:
    """Without the garbage collector: a search makes no circles, and looking for them takes half of its time."""
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
        self._impossible = self._impossible_goal = ""

    def run(self, strategy: Strategy) -> PlanFound | NoPlan:
        try:
            root = self._prepared()
            if root is None:
                return self._none(self._impossible, is_certain=True)
            if strategy is Strategy.AUTOMATIC:
                return self._in_turns(root)
            searches = {Strategy.BEST_FIRST: self._best_first, Strategy.HEURISTIC: self._heuristic}
            steps = searches[strategy](root) if strategy in searches else self._depth_first(root, strategy)
            return _result(steps, 4 * LIMIT_NODES) or self._none("", is_certain=False)
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
        self._grounder, self._events = grounder, (events := list(task.events))
        if not self._ground_goals(grounder, events):
            return None
        all_units = tuple(dict.fromkeys(one for sort in declared.units for one in task.types.members[sort]))
        units: tuple[str | None, ...] = tuple(
            one for one in all_units if self._units is None or one in self._units
        ) or (None,)
        if all_units and units == (None,):
            self._impossible = "no unit can act"
            return None
        self._acting = units
        events.sort(key=lambda event: event[0])
        self._schemas = [Schema(one, grounder, frozenset(declared.units)) for one in declared.operators]
        for one in declared.controls:
            self._control.add(one.name, closed(one.formula, free_variables(one.formula, declared)))
        self._successors = Successors(
            self._schemas,
            units,
            self._control,
            self._state,
            tuple(self._events),
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
        self._grounds: list[tuple[tree.Formula, bool]] = []
        self._urgent: dict[str, int] = {}
        for one in self._statements:
            formula = closed(one.formula, free_variables(one.formula, self._declared))
            ground = grounder.ground(formula, {})
            grounds.append((one, formula, ground))
            self._grounds.append((ground, one.deadline_ms is not None))
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
                self._impossible_goal = name
                self._impossible = f"{name} cannot be reached: no operator changes what it is about"
                return False
            inside = ground.parts if isinstance(ground, tree.And) else (ground,)
            self._goals.tests += [(name, grounder.compiler.whole_test(part)) for part in inside if part != TRUE]
            if one.deadline_ms is not None:
                self._control.add(f"deadline of {name}", tree.Always(formula, one.deadline_ms * 1000))
                events.append((one.deadline_ms, "", None))
                for each in calls(one.formula):
                    self._urgent[each.name] = min(one.deadline_ms, self._urgent.get(each.name, one.deadline_ms))
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

    def _is_new(self, node: SearchNode, seen: _Seen) -> bool:
        """Whether no node like it was met, as early and as cheap."""
        met = seen.setdefault(node.key(), [])
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

    def _in_turns(self, root: SearchNode) -> PlanFound | NoPlan:
        searches = [(self._depth_first(root, Strategy.DEPTH_FIRST), TURN), (self._heuristic(root), TURN // 2)]
        while True:
            for steps, turn in searches:
                if (found := _result(steps, turn)) is not None:
                    return found

    def _depth_first(self, root: SearchNode, strategy: Strategy) -> Steps:
        best: SearchNode | None = None
        bound = float("inf")
        stack: list[Iterator[SearchNode]] = [iter((root,))]
        seen: _Seen = {}
        try:
            while stack:
                node = next(stack[-1], None)
                if node is None:
                    stack.pop()
                    yield
                    continue
                self._count()
                if node.cost >= bound or not self._is_new(node, seen):
                    yield
                    continue
                if self._is_goal(node):
                    if strategy is Strategy.DEPTH_FIRST:
                        return self._found(node, is_cheapest=False)
                    best, bound = node, node.cost
                    continue
                is_there = self._goals.hold(self._state.values)
                stack.append(self._successors.of(node, prefer_waiting=is_there, urgent=self._urgent))
                if node.depth % STRAIGHT == 0:
                    yield
        except Stopped:
            if best is None:
                raise
            return self._found(best, is_cheapest=False)
        return self._none("", is_certain=True) if best is None else self._found(best, is_cheapest=not self._dropped)

    def _best_first(self, root: SearchNode) -> Steps:
        return self._ordered(root, lambda node: ((node.cost, -node.depth),), is_cheapest=not self._dropped)

    def _heuristic(self, root: SearchNode) -> Steps:
        """Expand the nodes that seem nearest to the goal first; yields for ever if there are too many instances."""
        try:
            estimator = Estimator(self._grounder, self._schemas, self._acting, self._grounds, self._events)
        except TooManyInstances:
            while True:
                yield
        self._state.go_to(root)
        if estimator.estimate(root, self._state.values) == float("inf"):
            return self._none("the goal cannot be reached, even if all that was ever so stayed so", is_certain=True)

        def order(node: SearchNode) -> tuple[tuple[float, ...], ...]:
            """Keys of two queues: of equally near nodes, in turns the one with the fewest actions, and the newest."""
            far = estimator.estimate(node, self._state.values)
            return (far, node.steps, -node.depth), (far, -node.depth)

        return (yield from self._ordered(root, order, is_cheapest=False))

    def _ordered(
        self, root: SearchNode, order: Callable[[SearchNode], tuple[tuple[float, ...], ...]], *, is_cheapest: bool
    ) -> Steps:
        """Nodes in one order or by turns in several, the smallest first; endless ones not at all."""
        numbers = count()
        seen: _Seen = {}
        queues: list[list[tuple[tuple[float, ...], int, SearchNode]]] = [[(one, -1, root)] for one in order(root)]
        done: set[int] = set()
        while queues[0]:
            for queue in queues:
                if not queue or (number := queue[0][1]) in done:
                    if queue:
                        heappop(queue)
                    continue
                done.add(number)
                node = heappop(queue)[2]
                self._state.go_to(node)
                self._count()
                if self._is_goal(node):
                    return self._found(node, is_cheapest=is_cheapest)
                for child in self._successors.of(node):
                    if self._is_new(child, seen) and (places := order(child))[0][0] < float("inf"):
                        number = next(numbers)
                        for each, place in zip(queues, places, strict=True):
                            heappush(each, (place, number, child))
                yield
        return self._none("", is_certain=True)

    def failed(self, goal: GoalStatement) -> int:
        """In how many states it was this goal that was missing: of equal ones, that is the one that is left aside."""
        goals = getattr(self, "_goals", None)
        name = goal.name or "goal"
        return 1 if name == self._impossible_goal else 0 if goals is None else goals.failed.get(name, 0)

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
        for label in list(self._grounder.missing)[:_SHOWN_CAUSES] if hasattr(self, "_grounder") else ():
            yield f"{label} has no initial value: #init {label.replace('[', '(').replace(']', ')')} := ..."
        conflicts = self._successors.conflicts if hasattr(self, "_successors") else {}
        for cause, times in sorted(conflicts.items(), key=lambda one: -one[1])[:_SHOWN_CAUSES]:
            yield f"{times} times {cause}"
