"""Conditions of a domain as formulas of `reasoning` for monitors; they can be printed and read back.

A feature that a problem gives, nothing changes and nothing senses, a goal's coordinates for one, is a constant; all others are
read from states, and so are the numbers of a condition that is flagged `monitored` and would be constant otherwise.
The flag of an operator is a fluent of its objects, `executing-attach-box[uav1, b1]`; given fewer of them it is
about any action that begins with those (thesis 7.6.2). Distances are compared by their squares, since formulas have no `hypot`.
"""

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import fields, replace
from itertools import islice
from typing import Any, Final

from dyknow.model.errors import TextError
from dyknow.model.sample import Value
from dyknow.planning.domains import model
from dyknow.planning.domains.model import Application, Declarations, Expression, Quantified
from dyknow.planning.domains.sorts import EXECUTING
from dyknow.planning.search.grounding import Environment, Grounder
from dyknow.planning.search.operators import State
from dyknow.planning.search.tasks import PlanningTask
from dyknow.reasoning.formulas import tree

_IMAGINARY: Final = tree.Const(1j)  # type: ignore[arg-type] # how the search writes the other side of a distance


def executing(operator: model.Operator, objects: tuple[str, ...]) -> tree.Feature:
    """The execution flag of an operator."""
    return tree.Feature(f"{EXECUTING}{operator.name}", objects)


class ConditionWriter:
    """Writes conditions over named objects.

    Attributes:
        sensed: names of the features that are read from states.
    """

    def __init__(self, declared: Declarations) -> None:
        task = PlanningTask(declared)
        self._types = task.types
        self._operators = {f"{EXECUTING}{one.name}": one for one in declared.operators}
        given = {one.target.name for one in declared.init}
        for one in declared.features:
            if one.name not in given:
                task.fluents.add(one.name)
        task.fluents |= {one.target.name for each in declared.recoveries for those in each.assumptions for one in those}
        task.fluents |= set(_measured(declared, task.fluents))
        self.sensed = frozenset(task.fluents)
        for name in self._operators:
            task.features[name] = model.FeatureDeclaration(name, (), model.BOOLEAN)
            task.fluents.add(name)
        self._within = {one.name: one.within for one in declared.features if one.within is not None}
        self.grounder = Grounder(task)

    def written(
        self, expression: Expression, env: Environment, numbers: Mapping[str, Value], flag: tree.Feature | None = None
    ) -> tree.Formula:
        """A condition with objects for its variables and these numbers for the others; `flag` is what EXEC stands for.

        Raises:
            TextError: it calculates with a distance in a way that formulas cannot say.
        """
        constants = {name: _constant(value) for name, value in numbers.items()}
        ground = self.grounder.ground(self._with_flags(model.substitute(expression, constants), flag), env)
        if sum(1 for _ in islice(tree.walk(ground), tree.LIMIT_NODES + 1)) > tree.LIMIT_NODES:
            raise tree.too_large()
        found: tree.Formula = _rewritten(ground, self._compared)
        return found

    def feature(self, target: Application, env: Environment) -> tree.Feature:
        """The fluent that an effect changes."""
        found = self.grounder.term(target, env)
        assert isinstance(found, tree.Feature)  # noqa: S101 - what an effect changes is a fluent
        return found

    def number(self, expression: Expression, env: Environment, numbers: Mapping[str, Value], state: State) -> Value:
        """The value of a term in a state."""
        constants = {name: _constant(value) for name, value in numbers.items()}
        term = self.grounder.term(model.substitute(expression, constants), env)
        return self.grounder.compiler.whole_term(term)(0, state, {}, (), {})

    def equals(self, term: tree.Formula, value: Value) -> tree.Formula:
        """The formula that a fluent has a value."""
        if isinstance(value, bool):
            return term if value else tree.Not(term)
        found: tree.Formula = self._compared(tree.Compare("=", term, _constant(value)))
        return found

    def _with_flags(self, expression: Expression, flag: tree.Feature | None) -> Expression:
        """Flags about objects alone; EXEC is the flag of its action."""

        def changed(node: Any) -> Any:
            if not isinstance(node, Application):
                return node
            if node.name == "EXEC" and flag is not None:
                return Application(flag.name, tuple(Application(str(one)) for one in flag.objects))
            operator = self._operators.get(node.name)
            if operator is None:
                return node
            pairs = zip(node.args, operator.parameters, strict=False)
            return replace(node, args=tuple(arg for arg, one in pairs if self._types.of_variable(one) is not None))

        return _rewritten(expression, changed)

    def _compared(self, node: Any) -> Any:
        """Comparisons of distances by their squares, of measured values within their tolerance."""
        if not isinstance(node, tree.Compare):
            return node
        if (sides := _sides(node.left)) is not None:
            return _squared(node.operator, sides, node.right)
        if (sides := _sides(node.right)) is not None:
            return _squared(_TURNED[node.operator], sides, node.left)
        if any(one == _IMAGINARY for one in tree.walk(node)):
            raise TextError(
                "a distance is compared, not calculated with, in what is monitored", repair="hypot(x, y) <= d"
            )
        named = [one.name for one in (node.left, node.right) if isinstance(one, tree.Feature)]
        within = max((self._within[name] for name in named if name in self._within), default=None)
        if within is not None and node.operator in {"=", "!="}:
            apart = tree.Abs(tree.Arithmetic("-", node.left, node.right))
            return tree.Compare("<=" if node.operator == "=" else ">", apart, tree.Const(within))
        return replace(node, left=_quoted(node.left), right=_quoted(node.right))

    def instances(self, formula: Expression) -> Iterator[tuple[Expression, dict[str, tree.Formula], bool]]:
        """Parts of a global formula: for each its objects, and whether `always` stands before it."""
        yield from self._parts(formula, {}, False)

    def _parts(
        self, formula: Expression, env: Environment, is_always: bool
    ) -> Iterator[tuple[Expression, dict[str, tree.Formula], bool]]:
        match formula:
            case tree.And(parts):
                for part in parts:
                    yield from self._parts(part, env, is_always)
            case tree.Always(operand, 0, None):
                yield from self._parts(operand, env, True)
            case Quantified("forall", variables, body) if all(self._types.of_variable(one) for one in variables):
                for bound in self.grounder.bindings(variables, env):
                    yield from self._parts(body, bound, is_always)
            case _:
                yield formula, dict(env), is_always


def _measured(declared: Declarations, fluents: Collection[str]) -> Iterator[str]:
    """The numbers of flagged conditions that speak of nothing else that is read from states: they are measured."""
    numbers = {one.name for one in declared.features if one.sort in model.NUMBERS and one.sorts}
    flagged = [
        each.formula for one in declared.operators for each in (*one.preconditions, *one.prevail) if each.monitored
    ]
    monitors = [*declared.monitors, *(each for one in declared.operators for each in one.monitors)]
    for formula in (*flagged, *(each.formula for each in monitors)):
        names = {node.name for node in tree.walk(formula) if isinstance(node, Application)}
        is_of_flags = any(name == "EXEC" or name.startswith(EXECUTING) for name in names)
        if not names.intersection(fluents) and not is_of_flags:
            yield from names & numbers


_TURNED: Final = {"<": ">", "<=": ">=", "=": "=", "!=": "!=", ">=": "<=", ">": "<"}


def _sides(term: Any) -> tuple[Any, Any] | None:
    """The two sides of a distance."""
    match term:
        case tree.Abs(tree.Arithmetic("+", one, tree.Arithmetic("*", other, right))) if right == _IMAGINARY:
            return one, other
    return None


def _squared(sign: str, sides: tuple[Any, Any], limit: Any) -> tree.Formula:
    square = tree.Arithmetic("+", *(tree.Arithmetic("*", one, one) for one in sides))
    if any(one == _IMAGINARY for one in tree.walk(limit)):
        raise TextError("two distances are compared in what is monitored", repair="hypot(x, y) <= d")
    if isinstance(limit, tree.Const) and not isinstance(limit.value, str):
        if limit.value < 0:
            return tree.Const(sign in {">", ">=", "!="})
        return tree.Compare(sign, square, tree.Const(round(limit.value * limit.value, 9)))
    compared = tree.Compare(sign, square, tree.Arithmetic("*", limit, limit))
    if sign in {">", ">=", "!="}:
        return tree.Or((tree.Compare("<", limit, tree.Const(0)), compared))
    return tree.And((tree.Compare(">=", limit, tree.Const(0)), compared))


def _quoted(term: Any) -> Any:
    """Objects and values of types as quoted strings, so that printed formulas are read back unchanged."""
    return replace(term, quoted=True) if isinstance(term, tree.Const) and isinstance(term.value, str) else term


def _constant(value: Value) -> tree.Const:
    """A constant; coordinates are rounded to a millionth, below which only rounding errors differ."""
    if isinstance(value, float):
        return tree.Const(round(value, 6) + 0.0)
    return tree.Const(value if isinstance(value, bool | int) else str(value))


def _rewritten(node: Any, change: Callable[[Any], Any]) -> Any:
    """The tree with each node changed, outside first; the results of a change are not entered again."""
    made = change(node)
    if made is not node:
        return made
    changed: dict[str, Any] = {}
    for each in fields(node):
        inside = getattr(node, each.name)
        if each.name == "place":
            continue
        if isinstance(inside, tree.Node):
            changed[each.name] = _rewritten(inside, change)
        elif isinstance(inside, tuple) and inside and isinstance(inside[0], tree.Node):
            changed[each.name] = tuple([_rewritten(one, change) for one in inside])
    return replace(node, **changed) if changed else node
