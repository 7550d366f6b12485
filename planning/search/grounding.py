"""Expressions over named objects: formulas of `reasoning`, as small as what never changes allows.

A formula over two states in a row, with `next`, becomes one over the later state, in which a fluent of the earlier one
is called `before f[x]`. A variable over numbers is replaced by the term it is equated with (semantic attachment): no
operator and no formula is instantiated over coordinates. Distances are moduli of complex numbers.
"""

import operator
from collections.abc import Callable, Iterator, Mapping
from itertools import product
from math import hypot
from typing import Any, Final, TypeAlias

from dyknow.model.errors import TextError
from dyknow.planning.domains import model
from dyknow.planning.domains.model import Application, Expression, InGoal, Next, Quantified
from dyknow.planning.search.compiling import BEFORE, SharingCompiler
from dyknow.planning.search.tasks import PlanningTask, calculated
from dyknow.reasoning.formulas import tree
from dyknow.reasoning.formulas.tree import label_text

TRUE: Final = tree.Const(True)
FALSE: Final = tree.Const(False)
Environment: TypeAlias = Mapping[str, tree.Formula]
_COMPARE: Final[Mapping[str, Callable[[Any, Any], Any]]] = {
    "<": operator.lt,
    "<=": operator.le,
    "=": operator.eq,
    "!=": operator.ne,
    ">=": operator.ge,
    ">": operator.gt,
}
_OF_TWO: Final[Mapping[str, Callable[[Any, Any], Any]]] = {"hypot": hypot, "min": min, "max": max}
_NEGATED: Final = {"<": ">=", "<=": ">", "=": "!=", "!=": "=", ">=": "<", ">": "<="}


class Stopped(Exception):
    """The search is to end; the reason is its text."""


class _Case(Exception):
    """An argument is the value of a fluent: the atom is taken apart by its values."""

    def __init__(self, term: tree.Feature, members: tuple[str, ...]) -> None:
        self.term, self.members = term, members


class Grounder:
    """Makes formulas and terms of a task; `poll` is called often and may raise `Stopped`.

    Attributes:
        missing: features that were met and have no value initially.
    """

    def __init__(self, task: PlanningTask, poll: Callable[[], None] = lambda: None, *, remembers: bool = True) -> None:
        self.task, self.poll = task, poll
        self.goal: frozenset[tree.Formula] = frozenset()
        self.missing: dict[str, None] = {}
        self.compiler = SharingCompiler(poll, remembers=remembers)
        self._known: dict[tuple[Any, ...], tuple[Any, tree.Formula]] = {}
        self._names: dict[int, tuple[Expression, tuple[str, ...]]] = {}
        self._features: dict[tuple[str, ...], tree.Feature] = {}
        self._objects: dict[str, tree.Const] = {}
        self._cases: dict[tree.Formula, tree.Const] = {}
        self._read: Mapping[type, Callable[[Any, Environment, str], tree.Formula]] = {
            tree.Const: lambda one, _env, _tag: one,
            tree.Duration: lambda one, _env, _tag: tree.Const(one.us / 1000),
            tree.Negate: self._negative,
            tree.Arithmetic: self._arithmetic,
            tree.Compare: self._atom,
            tree.Not: self._not,
            tree.And: lambda one, env, tag: self._joined(one.parts, env, tag, TRUE),
            tree.Or: lambda one, env, tag: self._joined(one.parts, env, tag, FALSE),
            tree.Implies: self._implies,
            tree.Always: self._temporal,
            tree.Eventually: self._temporal,
            tree.Until: self._until,
            Next: lambda one, env, _tag: self.ground(one.operand, env),
            InGoal: self._in_goal,
            Quantified: self._quantified,
            Application: self._atom,
        }

    def ground(self, expression: Expression, env: Environment, tag: str = "") -> tree.Formula:
        """The expression where variables are what `env` says; fluents outside `next` are called with `tag`."""
        return self._read[expression.__class__](expression, env, tag)

    def numbers(
        self, names: list[str], env: dict[str, tree.Formula], body: Expression, tag: str = ""
    ) -> dict[str, tree.Formula] | None:
        """The environment with these variables' values by their equations; None if the goal does not define one."""
        for name in names:
            term = model.definition(body, name, self.task.derived)
            if isinstance(term, InGoal):
                value = self._value_in_goal(self.ground(term.operand, env))
                if value is None:
                    return None
                env[name] = value
            elif isinstance(term, Next):
                env[name] = self.ground(term.operand, env)
            elif term is not None:
                env[name] = self.ground(term, env, tag)
            else:
                raise TextError(f"{name} is a number that no equation binds", repair=f"xpos(box) == {name}")
        return env

    def shared(self, expression: Expression, env: Environment, tag: str = "") -> tree.Formula:
        """The same, one node for equal values of the variables in it, as for derived features."""
        return self._shared(expression, env, tag, self.ground)

    def _quantified(self, one: Quantified, env: Environment, tag: str) -> tree.Formula:
        return self._shared(one, env, tag, self._expanded)

    def _shared(
        self,
        one: Expression,
        env: Environment,
        tag: str,
        ground: Callable[[Any, Environment, str], tree.Formula],
    ) -> tree.Formula:
        if self._cases:
            return ground(one, env, tag)
        free = self._names.get(id(one))
        if free is None:
            free = self._names[id(one)] = one, tuple(sorted({each.name for each in model.calls(one) if not each.args}))
        given = [env[name] for name in free[1] if name in env]
        key = (id(one), tag, *[each.value if isinstance(each, tree.Const) else id(each) for each in given])
        known = self._known.get(key)
        if known is None:
            known = self._known[key] = given, ground(one, env, tag)
        return known[1]

    def _expanded(self, one: Quantified, env: Environment, tag: str) -> tree.Formula:
        universal = one.kind == "forall"
        body = one.body.left if universal and isinstance(one.body, tree.Implies) else one.body
        settles = FALSE if universal else TRUE
        parts: list[tree.Formula] = []
        numbers = [each.name for each in one.variables if self.task.types.of_variable(each) is None]
        for bound in self.bindings(one.variables, env):
            whole = self.numbers(numbers, bound, body, tag) if numbers else bound
            if whole is None:
                continue
            part = self.ground(one.body, whole, tag)
            if part == settles:
                return settles
            parts.append(part)
        return _connected(tree.And if universal else tree.Or, parts, TRUE if universal else FALSE)

    def term(self, expression: Expression, env: Environment) -> tree.Formula:
        """A term; raises TextError if it asks for a feature of what only a state tells."""
        try:
            return self.ground(expression, env)
        except _Case as case:
            raise TextError(
                f"the value of {case.term.label} is wanted to name an object",
                repair="name it by a parameter: at(truck) == location",
            ) from None

    def bindings(self, variables: tuple[model.Parameter, ...], env: Environment) -> Iterator[dict[str, tree.Formula]]:
        """The environment with members for those of the variables that are over objects, in all ways."""
        sorts = [(one.name, self.task.types.of_variable(one)) for one in variables]
        names = [name for name, sort in sorts if sort is not None]
        for members in product(*(self.task.types.members[sort] for _, sort in sorts if sort is not None)):
            self.poll()
            yield {**env, **{name: self.object(one) for name, one in zip(names, members, strict=True)}}

    def object(self, name: str) -> tree.Const:
        """An object as a term, one for each name."""
        found = self._objects.get(name)
        if found is None:
            found = self._objects[name] = tree.Const(name)
        return found

    def _joined(self, parts: tuple[Expression, ...], env: Environment, tag: str, neutral: tree.Const) -> tree.Formula:
        settles = FALSE if neutral is TRUE else TRUE
        found = []
        for part in parts:
            one = self.ground(part, env, tag)
            if one == settles:
                return settles
            found.append(one)
        return _connected(tree.And if neutral is TRUE else tree.Or, found, neutral)

    def _implies(self, one: tree.Implies, env: Environment, tag: str) -> tree.Formula:
        left = self.ground(one.left, env, tag)
        if left == FALSE:
            return TRUE
        right = self.ground(one.right, env, tag)
        return (
            right
            if left == TRUE
            else TRUE
            if right == TRUE
            else negated(left)
            if right == FALSE
            else (tree.Implies(left, right))
        )

    def _not(self, one: tree.Not, env: Environment, tag: str) -> tree.Formula:
        return negated(self.ground(one.operand, env, tag))

    def _temporal(self, one: tree.Always | tree.Eventually, env: Environment, tag: str) -> tree.Formula:
        inside = self.ground(one.operand, env, tag)
        return inside if inside in {TRUE, FALSE} else type(one)(inside, one.lo_us, one.hi_us)

    def _until(self, one: tree.Until, env: Environment, tag: str) -> tree.Formula:
        right = self.ground(one.right, env, tag)
        if right == FALSE:
            return FALSE
        return tree.Until(self.ground(one.left, env, tag), right, one.lo_us, one.hi_us)

    def _negative(self, one: tree.Negate, env: Environment, tag: str) -> tree.Formula:
        inside = self.ground(one.operand, env, tag)
        number = _number(inside)
        return tree.Negate(inside) if number is None else tree.Const(-number)

    def _arithmetic(self, one: tree.Arithmetic, env: Environment, tag: str) -> tree.Formula:
        return arithmetic(one.operator, self.ground(one.left, env, tag), self.ground(one.right, env, tag))

    def _atom(self, one: Expression, env: Environment, tag: str) -> tree.Formula:
        """A comparison or a feature; one about the value of a fluent is a disjunction over its values."""
        try:
            return self._compare(one, env, tag) if isinstance(one, tree.Compare) else self._call(one, env, tag)
        except _Case as case:
            if not self._is_truth(one):
                raise
            parts = []
            for member in case.members:
                self._cases[case.term] = tree.Const(member)
                try:
                    holds = self._atom(one, env, tag)
                finally:
                    del self._cases[case.term]
                if holds != FALSE:
                    parts.append(_connected(tree.And, [tree.Compare("=", case.term, tree.Const(member)), holds], TRUE))
            return _connected(tree.Or, parts, FALSE)

    def _is_truth(self, one: Expression) -> bool:
        if isinstance(one, tree.Compare):
            return True
        feature = self.task.features.get(one.name)
        return feature is not None and feature.sort == model.BOOLEAN

    def _compare(self, one: tree.Compare, env: Environment, tag: str) -> tree.Formula:
        left, right = self.ground(one.left, env, tag), self.ground(one.right, env, tag)
        if isinstance(left, tree.Const) and isinstance(right, tree.Const):
            try:
                return TRUE if _COMPARE[one.operator](left.value, right.value) else FALSE
            except TypeError:
                return FALSE
        if left == right and one.operator in {"=", "<=", ">="}:
            return TRUE
        return tree.Compare(one.operator, left, right)

    def _call(self, one: Application, env: Environment, tag: str) -> tree.Formula:
        name, args = one.name, one.args
        if not args:
            if name in env:
                return env[name]
            if name in self.task.constants:
                return tree.Const(self.task.constants[name])
            if name not in self.task.features and name not in self.task.derived:
                return tree.Const(name)
        given = tuple([self.ground(arg, env, tag) for arg in args])
        derived = self.task.derived.get(name)
        if derived is not None:
            return self._derived(derived, given, tag)
        if name not in self.task.features:
            return _function(name, given)
        return self._feature(self.task.features[name], given, tag)

    def _derived(self, derived: model.Derived, given: tuple[tree.Formula, ...], tag: str) -> tree.Formula:
        """One node for equal arguments, so that what is worked out for it is shared."""
        key = (derived.name, tag, *[one.value if isinstance(one, tree.Const) else id(one) for one in given])
        known = None if self._cases else self._known.get(key)
        if known is not None:
            return known[1]
        names = [parameter.name for parameter in derived.parameters]
        found = self.ground(derived.body, dict(zip(names, given, strict=True)), tag)
        if not self._cases:
            self._known[key] = given, found
        return found

    def _feature(self, feature: model.FeatureDeclaration, given: tuple[tree.Formula, ...], tag: str) -> tree.Formula:
        objects = tuple([self._object_in(one) for one in given])
        label = label_text(feature.name, objects)
        value = self.task.value_of(feature, label)
        if value is None:
            self.missing[label] = None
        if feature.name in self.task.fluents:
            key = (tag, feature.name, *objects)
            found = self._features.get(key)
            if found is None:
                found = self._features[key] = tree.Feature(tag + feature.name, objects)
            return self._cases.get(found, found) if self._cases else found
        return tree.Feature(feature.name, objects) if value is None else tree.Const(value)

    def _object_in(self, one: tree.Formula) -> str:
        if isinstance(one, tree.Const):
            return str(one.value)
        if isinstance(one, tree.Feature):
            feature = self.task.features[one.name.removeprefix(BEFORE)]
            raise _Case(one, self.task.types.members.get(feature.sort, ()))
        raise TextError("an object is wanted, here is a calculated value")

    def _in_goal(self, one: InGoal, env: Environment, _tag: str) -> tree.Formula:
        return TRUE if self._entails(self.ground(one.operand, env), True) else FALSE

    def _entails(self, one: tree.Formula, truth: bool) -> bool:
        """Whether the goal says that a formula is true, or false."""
        if isinstance(one, tree.Const):
            return one.value is truth
        if (one if truth else negated(one)) in self.goal:
            return True
        match one:
            case tree.Not(operand):
                return self._entails(operand, not truth)
            case tree.And(parts):
                return (all if truth else any)(self._entails(part, truth) for part in parts)
            case tree.Or(parts):
                return (any if truth else all)(self._entails(part, truth) for part in parts)
            case tree.Compare("=" | "!=" as sign, term, tree.Const(value)):
                known = self._value_in_goal(term)
                return known is not None and ((known.value == value) is ((sign == "=") is truth))
        return False

    def _value_in_goal(self, term: tree.Formula) -> tree.Const | None:
        for one in self.goal:
            match one:
                case tree.Compare("=", left, tree.Const() as value) if left == term:
                    return value
                case tree.Compare("=", tree.Const() as value, right) if right == term:
                    return value
        return None


def negated(one: tree.Formula) -> tree.Formula:
    match one:
        case tree.Const(value):
            return FALSE if value else TRUE
        case tree.Not(operand):
            return operand
        case tree.Compare(sign, left, right) if sign in {"=", "!="}:
            return tree.Compare(_NEGATED[sign], left, right)
    return tree.Not(one)


def _connected(make: type[tree.And | tree.Or], parts: list[tree.Formula], neutral: tree.Const) -> tree.Formula:
    found: list[tree.Formula] = []
    for one in parts:
        if isinstance(one, make):
            found += one.parts
        elif one != neutral:
            found.append(one)
    if len(found) < 2:
        return found[0] if found else neutral
    return make(tuple({id(one): one for one in found}.values()))


def _number(one: tree.Formula) -> float | int | None:
    if isinstance(one, tree.Const) and not isinstance(one.value, bool | str):
        return one.value
    return None


def arithmetic(sign: str, left: tree.Formula, right: tree.Formula) -> tree.Formula:
    """The calculation, done if both are numbers."""
    if isinstance(left, tree.Const) and isinstance(right, tree.Const):
        result = calculated(sign, left.value, right.value)
        if result is not None:
            return tree.Const(result)
    return tree.Arithmetic(sign, left, right)


def _function(name: str, given: tuple[tree.Formula, ...]) -> tree.Formula:
    numbers = [_number(one) for one in given]
    if name == "abs":
        return tree.Abs(given[0]) if numbers[0] is None else tree.Const(abs(numbers[0]))
    first, second = given
    if numbers[0] is not None and numbers[1] is not None:
        return tree.Const(_OF_TWO[name](numbers[0], numbers[1]))
    if name == "hypot":
        imaginary = tree.Const(1j)  # type: ignore[arg-type] # the evaluator multiplies and adds whatever numbers these are
        return tree.Abs(arithmetic("+", first, arithmetic("*", second, imaginary)))
    apart = tree.Abs(arithmetic("-", first, second))
    both = arithmetic("+", first, second)
    return arithmetic("/", arithmetic("-" if name == "min" else "+", both, apart), tree.Const(2))
