"""Operators bound lazily: an instance is made when its preconditions hold, not before (thesis 7.4.1).

The order in which parameters are bound is worked out once for each operator: first the unit, then what a precondition
equates with a known feature, then members of types, fewest first. A condition is tested as soon as it can be. Numbers are
never enumerated: a parameter over them stands for the term that a precondition equates it with.
"""

from collections.abc import Callable, Container, Iterator
from dataclasses import dataclass
from math import isfinite
from typing import Any, Final, NamedTuple, TypeAlias

from dyknow.model.errors import TextError
from dyknow.model.sample import Value
from dyknow.planning.domains import model
from dyknow.planning.domains.model import Application, Expression
from dyknow.planning.search.grounding import FALSE, TRUE, Grounder
from dyknow.reasoning.formulas import tree
from dyknow.reasoning.formulas.evaluation import Test

State: TypeAlias = dict[str, Value]
_NONE: Final[dict[str, Any]] = {}
DEFAULT_DURATION_MS: Final = 1000
"""Of an operator without timing."""


class Write(NamedTuple):
    """One effect of an instance: when, what, and the value, from the state at the start; `when` None: always.

    `written` and `condition` are the formulas that `value` and `when` evaluate.
    """

    from_end: bool
    offset_ms: int
    label: str
    value: Callable[..., Value]
    when: Test | None
    written: tree.Formula
    condition: tree.Formula | None


@dataclass(slots=True)
class OperatorInstance:
    """An operator with objects for its parameters.

    Attributes:
        shown: as plans show it, `attach-box(uav1, b1)`.
        conditions: its preconditions and prevail conditions.
        values: of its parameters over numbers, by name.
        labels: the labels that a formula reads.
    """

    operator: model.Operator
    objects: tuple[str, ...]
    shown: str
    unit: str
    conditions: tuple[tree.Formula, ...]
    effects: tuple[Write, ...]
    prevail: tuple[Test, ...]
    cost: Callable[..., Value]
    duration: Callable[..., Value]
    shortest: Callable[..., Value] | None
    longest: Callable[..., Value] | None
    values: tuple[tuple[str, Callable[..., Value]], ...]
    labels: Callable[[tree.Formula], frozenset[str]]
    _reads: frozenset[str] | None = None

    @property
    def reads(self) -> frozenset[str]:
        """Labels that its preconditions and prevail conditions read."""
        if self._reads is None:
            self._reads = frozenset[str]().union(*map(self.labels, self.conditions))
        return self._reads

    def duration_ms(self, state: State) -> int | None:
        """How long it takes from this state; None if that is no time, or outside its time constraint."""
        found = self.duration(0, state, _NONE, (), _NONE)
        if isinstance(found, bool) or not isinstance(found, int | float) or not isfinite(found) or found < 0:
            return None
        for bound, sign in ((self.shortest, 1), (self.longest, -1)):
            if bound is not None:
                limit = bound(0, state, _NONE, (), _NONE)
                if not isinstance(limit, int | float) or (found - limit) * sign < -1e-6:
                    return None
        return max(1, round(found))

    def cost_in(self, state: State) -> float:
        found = self.cost(0, state, _NONE, (), _NONE)
        return float(found) if isinstance(found, int | float) and 0 <= found < 1e300 else float("inf")


class _Part(NamedTuple):
    """A conjunct: its formula, the positions of the object parameters in it, and the control it belongs to, if any."""

    formula: Expression
    positions: tuple[int, ...]
    control: str


class _Pick(NamedTuple):
    """One step of binding: a parameter, where its values come from, and the parts that can be tested then."""

    position: int
    members: tuple[str, ...]
    term: Expression | None
    tests: tuple[int, ...]


class Schema:
    """An operator made ready for search."""

    def __init__(self, operator: model.Operator, grounder: Grounder, units: frozenset[str]) -> None:
        self.operator, self._grounder = operator, grounder
        task = grounder.task
        sorts = [(one.name, task.types.of_variable(one)) for one in operator.parameters]
        self.names = [name for name, sort in sorts if sort is not None]
        self._sorts = [sort for _, sort in sorts if sort is not None]
        numbers = [name for name, sort in sorts if sort is None]
        self._numbers = self._terms(numbers)
        self._put_in: dict[int, tuple[Expression, Expression]] = {}
        self.unit = next((at for at, sort in enumerate(self._sorts) if units & set(task.types.above(sort))), None)
        self.refused: dict[str, int] = {}
        self._parts = list(self._split())
        self._picks, self._first = self._order()
        self._cost = tree.Const(1) if operator.cost is None else operator.cost
        self._duration = _expected(operator)
        self._grounds: dict[tuple[int, tuple[str, ...]], tree.Formula] = {}
        self._tests: dict[tuple[int, tuple[str, ...]], Test | bool] = {}
        self._instances: dict[tuple[str, ...], OperatorInstance] = {}
        self._terms_known: dict[tuple[int, tuple[str, ...]], Any] = {}

    def _terms(self, numbers: list[str]) -> dict[str, Expression]:
        """The terms that parameters over numbers stand for."""
        whole = tree.And(tuple(one.formula for one in self.operator.preconditions))
        found: dict[str, Expression] = {}
        for name in numbers:
            term = model.definition(whole, name, self._grounder.task.derived)
            if term is None or isinstance(term, model.Next | model.InGoal):
                raise TextError(f"{self.operator.name}: no precondition binds {name}", repair=f"xpos(box) == {name}")
            found[name] = term
        for _ in numbers:
            found = {name: model.substitute(term, found) for name, term in found.items()}
        return found

    def _split(self) -> Iterator[_Part]:
        conditions = [(each.formula, "") for each in (*self.operator.preconditions, *self.operator.prevail)]
        conditions += [(each.formula, each.name or "control") for each in self.operator.controls]
        for formula, control in conditions:
            for part in model.conjuncts(model.substitute(formula, self._numbers)):
                named = {one.name for one in model.calls(part) if not one.args}
                positions = tuple(at for at, name in enumerate(self.names) if name in named)
                yield _Part(part, positions, control and f"{self.operator.name}: {control}")

    def _order(self) -> tuple[list[_Pick], tuple[int, ...]]:
        bound: set[int] = set()
        used: set[int] = set()

        def ready() -> tuple[int, ...]:
            found = tuple(
                at for at, part in enumerate(self._parts) if at not in used and bound.issuperset(part.positions)
            )
            used.update(found)
            return tuple(sorted(found, key=lambda at: bool(self._parts[at].control)))

        if self.unit is not None:
            bound.add(self.unit)
        first, picks = ready(), []
        types = self._grounder.task.types
        while len(bound) < len(self.names):
            position, term = self._selective(bound)
            bound.add(position)
            picks.append(_Pick(position, types.members[self._sorts[position]], term, ready()))
        return picks, first

    def _selective(self, bound: set[int]) -> tuple[int, Expression | None]:
        """The parameter to bind next: one with a single value if there is one, else of the smallest type."""
        free = [at for at in range(len(self.names)) if at not in bound]
        for at in free:
            for part in self._parts:
                term = None if part.control else _equal(part.formula, self.names[at], self._grounder.task.features)
                inside = set() if term is None else {one.name for one in model.calls(term)} & set(self.names)
                if term is not None and inside <= {self.names[each] for each in bound}:
                    return at, term
        members = self._grounder.task.types.members
        return min(free, key=lambda at: len(members[self._sorts[at]])), None

    def instances(self, unit: str | None, state: State) -> Iterator[OperatorInstance]:
        """The instances of a unit whose preconditions and control formulas hold in this state."""
        objects: list[str] = [""] * len(self.names)
        if self.unit is not None:
            if unit is None or not self._grounder.task.types.has(self._sorts[self.unit], unit):
                return
            objects[self.unit] = unit
        if self._hold(self._first, objects, state):
            yield from self._pick(0, objects, state)

    def possible(self, unit: str | None) -> Iterator[OperatorInstance]:
        """The instances of a unit whose preconditions can hold in some state, as far as what never changes decides it."""
        objects: list[str] = [""] * len(self.names)
        if self.unit is not None:
            if unit is None or not self._grounder.task.types.has(self._sorts[self.unit], unit):
                return
            objects[self.unit] = unit
        if self._can_hold(self._first, objects):
            yield from self._possible(0, objects)

    def _possible(self, step: int, objects: list[str]) -> Iterator[OperatorInstance]:
        if step == len(self._picks):
            yield self.instance(tuple(objects))
            return
        position, _, _, tests = self._picks[step]
        for member in self._grounder.task.types.members[self._sorts[position]]:
            self._grounder.poll()
            objects[position] = member
            if self._can_hold(tests, objects):
                yield from self._possible(step + 1, objects)

    def _can_hold(self, tests: tuple[int, ...], objects: list[str]) -> bool:
        return all(
            self._ground(at, tuple([objects[position] for position in self._parts[at].positions])) != FALSE
            for at in tests
        )

    def _pick(self, step: int, objects: list[str], state: State) -> Iterator[OperatorInstance]:
        if step == len(self._picks):
            yield self.instance(tuple(objects))
            return
        position, members, term, tests = self._picks[step]
        if term is not None:
            value = self._term(step, term, objects)(0, state, _NONE, (), _NONE)
            members = (value,) if self._grounder.task.types.has(self._sorts[position], value) else ()
        for member in members:
            self._grounder.poll()
            objects[position] = member
            if self._hold(tests, objects, state):
                yield from self._pick(step + 1, objects, state)

    def _hold(self, tests: tuple[int, ...], objects: list[str], state: State) -> bool:
        known = self._tests
        for at in tests:
            part = self._parts[at]
            key = (at, tuple([objects[position] for position in part.positions]))
            test = known.get(key)
            if test is None:
                found = self._ground(*key)
                test = known[key] = (
                    True if found == TRUE else False if found == FALSE else self._grounder.compiler.whole_test(found)
                )
            if test is True:
                continue
            if test is False or test(0, state, _NONE, (), _NONE) != 1:
                if part.control:
                    self.refused[part.control] = self.refused.get(part.control, 0) + 1
                return False
        return True

    def _ground(self, at: int, objects: tuple[str, ...]) -> tree.Formula:
        """A part over the objects of its parameters."""
        found = self._grounds.get((at, objects))
        if found is None:
            part = self._parts[at]
            env = {self.names[at]: self._grounder.object(one) for at, one in zip(part.positions, objects, strict=True)}
            found = self._grounds[at, objects] = self._grounder.ground(part.formula, env)
        return found

    def _term(self, step: int, term: Expression, objects: list[str]) -> Any:
        key = (step, tuple(objects))
        found = self._terms_known.get(key)
        if found is None:
            env = {name: self._grounder.object(one) for name, one in zip(self.names, objects, strict=True)}
            found = self._terms_known[key] = self._grounder.compiler.whole_term(self._grounder.term(term, env))
        return found

    def instance(self, objects: tuple[str, ...]) -> OperatorInstance:
        """The operator with these objects, whether its preconditions hold or not."""
        found = self._instances.get(objects)
        if found is None:
            found = self._instances[objects] = self._made(objects)
        return found

    def _made(self, objects: tuple[str, ...]) -> OperatorInstance:
        operator, grounder = self.operator, self._grounder
        env: dict[str, tree.Formula] = {
            name: self._grounder.object(one) for name, one in zip(self.names, objects, strict=True)
        }

        def term(expression: Expression) -> Callable[..., Value]:
            return grounder.compiler.whole_term(grounder.term(self._put(expression), env))

        effects = tuple(self._effects(env))
        conditions = tuple(
            [
                self._ground(at, tuple([objects[position] for position in part.positions]))
                for at, part in enumerate(self._parts)
                if not part.control
            ]
        )
        prevail = [grounder.ground(self._put(one.formula), env) for one in operator.prevail]
        timing = operator.timeconstraint
        return OperatorInstance(
            operator,
            objects,
            f"{operator.name}({', '.join(objects)})",
            objects[self.unit] if self.unit is not None else objects[0] if objects else "",
            conditions,
            effects,
            tuple(grounder.compiler.whole_test(one) for one in prevail),
            term(self._cost),
            term(self._duration),
            None if timing is None or timing.shortest is None else term(timing.shortest),
            None if timing is None or timing.longest is None else term(timing.longest),
            tuple((name, term(Application(name))) for name in self._numbers),
            grounder.compiler.labels,
        )

    def _effects(self, env: dict[str, tree.Formula]) -> Iterator[Write]:
        grounder = self._grounder
        for one in self.operator.effects:
            for bound in grounder.bindings(one.variables, env):
                condition = TRUE if one.condition is None else grounder.shared(self._put(one.condition), bound)
                if condition == FALSE:
                    continue
                target = grounder.term(self._put(one.target), bound)
                written = grounder.term(self._put(one.value), bound)
                assert isinstance(target, tree.Feature)  # noqa: S101 - what an effect changes is a fluent
                yield Write(
                    one.anchor == "end",
                    one.offset_ms,
                    target.label,
                    grounder.compiler.whole_term(written),
                    None if condition == TRUE else grounder.compiler.whole_test(condition),
                    written,
                    None if condition == TRUE else condition,
                )

    def _put(self, expression: Expression) -> Expression:
        """The expression with the terms that its parameters over numbers stand for."""
        known = self._put_in.get(id(expression))
        if known is None:
            known = self._put_in[id(expression)] = expression, model.substitute(expression, self._numbers)
        return known[1]


def _equal(formula: Expression, name: str, features: Container[str]) -> Application | None:
    """The feature that a condition equates a variable with."""
    if isinstance(formula, tree.Compare) and formula.operator == "=":
        sides: list[Expression] = [formula.left, formula.right]
        for one, other in (sides, reversed(sides)):
            if one == Application(name) and isinstance(other, Application) and other.args and other.name in features:
                return other
    return None


def _expected(operator: model.Operator) -> Expression:
    """The duration to plan with: the one given, else the middle of the constraint."""
    timing = operator.timeconstraint
    if operator.duration is not None:
        return operator.duration
    if timing is None or timing.longest is None:
        return tree.Const(DEFAULT_DURATION_MS) if timing is None or timing.shortest is None else timing.shortest
    if timing.shortest is None:
        return timing.longest
    return tree.Arithmetic("/", tree.Arithmetic("+", timing.shortest, timing.longest), tree.Const(2))
