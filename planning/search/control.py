"""Global control formulas along a branch of the search: state constraints, and formulas that are progressed.

A formula is taken apart into conjuncts for each of its objects. `always A`, with A about a state or about two states in
a row, becomes a test that is made where a fluent of A has changed. Everything else is progressed by the automaton of
its skeleton; the states of automata are the remainders of a node, one object for equal remainders. A state of the
sequence is progressed through when it is complete, and with `next` when the following one is, so that what lies in the
future decides nothing (7.4.2).
"""

from collections.abc import Iterator, Mapping
from typing import Any, Final, NamedTuple, TypeAlias

from dyknow.model.sample import Value
from dyknow.planning.domains import model
from dyknow.planning.domains.model import Expression, Next, Quantified
from dyknow.planning.search.compiling import BEFORE, is_temporal
from dyknow.planning.search.grounding import TRUE, Environment, Grounder
from dyknow.reasoning.formulas import tree
from dyknow.reasoning.formulas.evaluation import EvaluationCompiler, Test
from dyknow.reasoning.formulas.skeletons import take_apart
from dyknow.reasoning.progression.automaton import Automaton, AutomatonState, automaton
from dyknow.reasoning.progression.persistence import holds_if_all_persists

Residuals: TypeAlias = tuple[AutomatonState | None, ...]
"""Remainders of the formulas that are progressed; None before the first state that is complete."""
_NONE: Final[dict[str, Any]] = {}
_LATER: Final = len(BEFORE)


class _BothStates:
    """The values of two states in a row, the earlier ones under their tag."""

    __slots__ = ("_before", "_now")

    def __init__(self, now: Mapping[str, Value], before: Mapping[str, Value]) -> None:
        self._now, self._before = now, before

    def get(self, label: str, default: Any = None) -> Any:
        if not label.startswith(BEFORE):
            return self._now.get(label, default)
        name = label[_LATER:]
        return self._before[name] if name in self._before else self._now.get(name, default)


class _Constraint(NamedTuple):
    name: str
    test: Test
    is_pair: bool


class _Progressed(NamedTuple):
    """A formula on its automaton; one without metric bounds takes each state as the next, so that steps are remembered."""

    name: str
    read: Test
    automaton: Automaton
    is_metric: bool
    is_pair: bool


class ControlFormulas:
    """The control formulas of a problem.

    Attributes:
        refusals: how often each ended a branch.
    """

    def __init__(self, grounder: Grounder) -> None:
        self._grounder = grounder
        self._constraints: list[_Constraint] = []
        self._touching: dict[str, list[int]] = {}
        self._pairs_touching: dict[str, list[int]] = {}
        self._progressed: list[_Progressed] = []
        self._only_initial: list[tuple[str, tree.Formula]] = []
        self.refusals: dict[str, int] = {}

    def add(self, name: str, formula: Expression) -> None:
        """Take in a formula; its free variables are universally quantified.

        Raises:
            Stopped: the search is to end.
            TextError: it grows beyond all limits.
        """
        tag = BEFORE if any(isinstance(node, Next) for node in tree.walk(formula)) else ""
        for part, env, is_always in self._parts(formula, {}, False):
            ground = self._grounder.ground(part, env, tag)
            if ground == TRUE:
                continue
            if is_always and not is_temporal(ground):
                self._constrain(name, ground, bool(tag))
            elif is_temporal(ground) or tag:
                self._progress(name, tree.Always(ground) if is_always else ground, bool(tag))
            else:
                self._only_initial.append((name, ground))

    def _parts(
        self, formula: Expression, env: Environment, is_always: bool
    ) -> Iterator[tuple[Expression, Environment, bool]]:
        """Conjuncts, each with its objects, and whether `always` stands before it."""
        task = self._grounder.task
        match formula:
            case tree.And(parts):
                for part in parts:
                    yield from self._parts(part, env, is_always)
            case tree.Always(operand, 0, None):
                yield from self._parts(operand, env, True)
            case Quantified("forall", variables, body) if any(map(task.types.of_variable, variables)):
                numbers = tuple(one for one in variables if task.types.of_variable(one) is None)
                inside = Quantified("forall", numbers, body) if numbers else body
                for bound in self._grounder.bindings(variables, env):
                    yield from self._parts(inside, bound, is_always)
            case _:
                yield formula, env, is_always

    def _constrain(self, name: str, ground: tree.Formula, is_pair: bool) -> None:
        number = len(self._constraints)
        self._constraints.append(_Constraint(name, self._grounder.compiler.whole_test(ground), is_pair))
        for label in self._grounder.compiler.labels(ground):
            self._touching.setdefault(label, []).append(number)
            if is_pair:
                self._pairs_touching.setdefault(label, []).append(number)

    def _progress(self, name: str, ground: tree.Formula, is_pair: bool) -> None:
        apart = take_apart(ground, {})
        is_metric = any(node.lo_us or node.hi_us is not None for node in apart.skeleton.nodes)
        read = EvaluationCompiler().assignment(apart.atoms)
        self._progressed.append(_Progressed(name, read, automaton(apart.skeleton, None), is_metric, is_pair))

    @property
    def of_pairs(self) -> dict[str, Value]:
        """Every label that a constraint on two states in a row reads: the first pair is about them all."""
        return dict.fromkeys(self._pairs_touching)

    def initial(self, state: dict[str, Value]) -> Residuals | None:
        """The remainders after the initial state; None if a formula is violated there."""
        for name, ground in self._only_initial:
            if self._grounder.compiler.whole_test(ground)(0, state, _NONE, (), _NONE) == 0:
                self._count(name)
                return None
        for one in self._constraints:
            if not one.is_pair and one.test(0, state, _NONE, (), _NONE) == 0:
                self._count(one.name)
                return None
        residuals: list[AutomatonState | None] = []
        for each in self._progressed:
            left = None if each.is_pair else each.automaton.start(each.read(0, state, _NONE, (), _NONE))
            if left is not None and left.verdict == "false":
                self._count(each.name)
                return None
            residuals.append(left)
        return tuple(residuals)

    def after(
        self,
        state: dict[str, Value],
        before: Mapping[str, Value],
        touched: Mapping[str, Any],
        residuals: Residuals,
        gap_ms: int,
    ) -> Residuals | None:
        """The remainders after one more state; None if a formula is violated.

        Args:
            state: the new values.
            before: the changed labels, with the values before.
            touched: the labels that had changed in the state before; conditions over pairs of states read them, too.
            residuals: those until then.
            gap_ms: the time between the two states.
        """
        both: Any = _BothStates(state, before)
        numbers = {number for label in before for number in self._touching.get(label, ())}
        numbers.update(number for label in touched for number in self._pairs_touching.get(label, ()))
        for number in numbers:
            one = self._constraints[number]
            if one.test(0, both if one.is_pair else state, _NONE, (), _NONE) == 0:
                self._count(one.name)
                return None
        if not residuals:
            return residuals
        found: list[AutomatonState | None] = []
        for each, left in zip(self._progressed, residuals, strict=True):
            after = self._stepped(each, left, both if each.is_pair else state, gap_ms)
            if after.verdict == "false":
                self._count(each.name)
                return None
            found.append(after)
        return tuple(found)

    def _stepped(self, each: _Progressed, left: AutomatonState | None, state: Any, gap_ms: int) -> AutomatonState:
        if left is not None and left.is_decided:
            return left
        assignment = each.read(0, state, _NONE, (), _NONE)
        if left is None:
            return each.automaton.start(assignment)
        if each.is_metric:
            return each.automaton.pass_by(left, assignment, gap_ms * 1000)
        offset = each.automaton.gap(1)
        return each.automaton.step(left, (offset or 0) + assignment)

    def accept(self, state: dict[str, Value], touched: Mapping[str, Any], residuals: Residuals) -> bool:
        """Whether every formula holds if this state persists for ever."""
        both: Any = _BothStates(state, {})
        for number in {number for label in touched for number in self._pairs_touching.get(label, ())}:
            if self._constraints[number].test(0, both, _NONE, (), _NONE) == 0:
                self._count(self._constraints[number].name)
                return False
        for each, left in zip(self._progressed, residuals, strict=True):
            values = both if each.is_pair else state
            last = self._stepped(each, left, values, 1) if each.is_pair or left is None else left
            progressor = each.automaton.progressor
            assignment = progressor.assignment(each.read(0, values, _NONE, (), _NONE))
            if not holds_if_all_persists(last.clauses, progressor, assignment):
                self._count(each.name)
                return False
        return True

    def _count(self, name: str) -> None:
        self.refusals[name] = self.refusals.get(name, 0) + 1


def closed(formula: Expression, free: tuple[model.Parameter, ...]) -> Expression:
    """The formula with its free variables universally quantified, inside an `always` that stands around it."""
    if not free:
        return formula
    if isinstance(formula, tree.Always) and formula.lo_us == 0 and formula.hi_us is None:
        return tree.Always(closed(formula.operand, free), place=formula.place)
    return Quantified("forall", free, formula, place=formula.place)
