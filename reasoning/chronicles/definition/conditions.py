"""Constraints on variables, made ready for evaluation (thesis 8.3.5, Constraint).

A condition is a function of an environment, symbols by variable (`?car1`); a variable without value (None) is in no
domain and equal to nothing.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

from dyknow.model.errors import ChronicleError
from dyknow.reasoning.chronicles.definition import model
from dyknow.reasoning.chronicles.definition.domains import symbol_set

LIMIT_DEPTH: Final = 100
"""So deep may constraints be nested, or use each other."""

LIMIT_PARTS: Final = 10_000
"""Most parts of a constraint, with all that it uses."""

Environment: TypeAlias = Mapping[str, str | None]
Test: TypeAlias = Callable[[Environment], bool]
Binding: TypeAlias = Mapping[str, model.Parameter]
"""The parameters that a text's variables stand for in the whole, by `?name`."""


@dataclass(frozen=True, slots=True)
class Condition:
    """`test` over the environment; `variables` are those it looks at, `said` its text."""

    variables: frozenset[str]
    test: Test
    said: str


def resolved(parameter: model.Parameter, prefix: str, binding: Binding) -> model.Parameter:
    """A parameter in the names of the whole: the one it is bound to, else its name behind the prefix."""
    if isinstance(parameter, str) or not parameter.name:
        return parameter
    return binding.get(str(parameter), replace(parameter, name=prefix + parameter.name))


class Conditions:
    """Makes the conditions of one file; `declared` names of domains and constraints are looked up in it."""

    def __init__(self, file: model.ChronicleFile) -> None:
        self._domains, self._named = file.domains, file.named_constraints
        self._parts = 0

    def condition(self, constraint: model.Constraint, prefix: str = "", binding: Binding | None = None) -> Condition:
        """The condition that a constraint states.

        Raises:
            ChronicleError: it names a domain or constraint that is not declared, or is nested too deep, or has too many parts.
        """
        variables: set[str] = set()
        self._parts = 0
        test = self._test(constraint, prefix, binding or {}, variables, 0)
        return Condition(frozenset(variables), test, str(constraint))

    def _test(
        self, constraint: model.Constraint, prefix: str, binding: Binding, variables: set[str], depth: int
    ) -> Test:
        if depth > LIMIT_DEPTH:
            raise ChronicleError(f"a constraint is nested, or used by itself, more than {LIMIT_DEPTH} deep")
        self._parts += 1
        if self._parts > LIMIT_PARTS:
            raise ChronicleError(f"a constraint has more than {LIMIT_PARTS} parts, with all that it uses")

        def inner(one: model.Constraint) -> Test:
            return self._test(one, prefix, binding, variables, depth + 1)

        if isinstance(constraint, model.MemberOf):
            return self._member(constraint, prefix, binding, variables)
        if isinstance(constraint, model.Equal):
            return _equal(constraint, prefix, binding, variables)
        if isinstance(constraint, model.Negation):
            operand = inner(constraint.operand)
            return lambda found: not operand(found)
        if isinstance(constraint, model.Conjunction | model.Disjunction):
            tests = tuple(inner(one) for one in constraint.operands)
            all_of = isinstance(constraint, model.Conjunction)
            return lambda found: all(one(found) for one in tests) if all_of else any(one(found) for one in tests)
        if isinstance(constraint, model.Implication | model.Iff):
            left, right = inner(constraint.left), inner(constraint.right)
            if isinstance(constraint, model.Implication):
                return lambda found: not left(found) or right(found)
            return lambda found: left(found) is right(found)
        if isinstance(constraint, model.Choice):
            condition, then, otherwise = map(inner, (constraint.condition, constraint.then, constraint.otherwise))
            return lambda found: then(found) if condition(found) else otherwise(found)
        named = self._named.get(constraint.name)
        if named is None:
            raise ChronicleError(f"{constraint}: no constraint is called {constraint.name}")
        if len(named.parameters) != len(constraint.arguments):
            raise ChronicleError(f"{constraint}: {constraint.name} has {len(named.parameters)} parameters")
        bound = {
            str(mine): resolved(theirs, prefix, binding)
            for mine, theirs in zip(named.parameters, constraint.arguments, strict=True)
        }
        tests = tuple(self._test(one, prefix, bound, variables, depth + 1) for one in named.constraints)
        return lambda found: all(one(found) for one in tests)

    def _member(self, member: model.MemberOf, prefix: str, binding: Binding, variables: set[str]) -> Test:
        symbols, inside = symbol_set(member.domain, self._domains), member.inside
        one = resolved(member.variable, prefix, binding)
        if isinstance(one, str):
            holds = (one in symbols) is inside
            return lambda _found: holds
        name = str(one)
        variables.add(name)

        def test(found: Environment) -> bool:
            symbol = found[name]
            return symbol is not None and (symbol in symbols) is inside

        return test


def _equal(equal: model.Equal, prefix: str, binding: Binding, variables: set[str]) -> Test:
    left, right = resolved(equal.variable, prefix, binding), resolved(equal.parameter, prefix, binding)
    same = equal.same
    for one in (left, right):
        if isinstance(one, model.ChronicleVariable):
            if not one.name:
                raise ChronicleError(f"{equal}: a mere {one} has no value to compare; give it a name")
            variables.add(str(one))

    def value(parameter: model.Parameter, found: Environment) -> str | None:
        return parameter if isinstance(parameter, str) else found[str(parameter)]

    def test(found: Environment) -> bool:
        first, second = value(left, found), value(right, found)
        return first is not None and second is not None and (first == second) is same

    return test
