"""Worlds and conditions on them; a condition is known if it holds in the worlds of all remaining hypotheses."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TypeAlias

Fluent: TypeAlias = tuple[str, ...]
"""A feature and its arguments; a text that begins with ? is a variable."""
World: TypeAlias = frozenset[tuple[Fluent, str]]
"""The value of every fluent that is not `f`."""
Binding: TypeAlias = Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Holds:
    """A fluent has a value, `(mark ?y = t)`."""

    fluent: Fluent
    value: str


@dataclass(frozen=True, slots=True)
class AllOf:
    """Every part holds."""

    parts: "tuple[WorldCondition, ...]"


@dataclass(frozen=True, slots=True)
class AnyOf:
    """At least one part holds."""

    parts: "tuple[WorldCondition, ...]"


@dataclass(frozen=True, slots=True)
class NotSo:
    """The part does not hold."""

    part: "WorldCondition"


WorldCondition: TypeAlias = Holds | AllOf | AnyOf | NotSo


def is_variable(word: str) -> bool:
    """Whether a word begins with ?."""
    return word.startswith("?")


def variables_of(condition: WorldCondition) -> frozenset[str]:
    """The variables that a condition speaks of."""
    match condition:
        case Holds(fluent, value):
            return frozenset(filter(is_variable, (*fluent, value)))
        case NotSo(part):
            return variables_of(part)
        case AllOf(parts) | AnyOf(parts):
            return frozenset().union(*map(variables_of, parts))


def bound_fluent(fluent: Fluent, binding: Binding) -> Fluent:
    """The fluent with its variables replaced."""
    return tuple(binding.get(word, word) for word in fluent)


def is_so(condition: WorldCondition, world: World, binding: Binding) -> bool:
    """Whether a condition holds in a world."""
    match condition:
        case Holds(fluent, value):
            wanted, fluent = binding.get(value, value), bound_fluent(fluent, binding)
            if wanted == "f":
                return all(known != fluent for known, _ in world)
            return (fluent, wanted) in world
        case AllOf(parts):
            return all(is_so(part, world, binding) for part in parts)
        case AnyOf(parts):
            return any(is_so(part, world, binding) for part in parts)
        case NotSo(part):
            return not is_so(part, world, binding)


def is_known(condition: WorldCondition, worlds: "tuple[World, ...]", binding: Binding) -> bool:
    """Whether it holds in all worlds: it is necessary."""
    return all(is_so(condition, world, binding) for world in worlds)


def known_bindings(
    variables: tuple[str, ...], condition: WorldCondition, worlds: "tuple[World, ...]", binding: Binding
) -> Iterator[dict[str, str]]:
    """The values of variables with which a condition is known, in the order of their names.

    A variable gets its values from the fluents that the condition names; a bound variable keeps its value.
    """
    free = [each for each in variables if each not in binding]
    if not free:
        if is_known(condition, worlds, binding):
            yield dict(binding)
        return
    for value in sorted(_candidates(free[0], condition, worlds[0], binding)):
        yield from known_bindings(variables, condition, worlds, {**binding, free[0]: value})


def _candidates(variable: str, condition: WorldCondition, world: World, binding: Binding) -> set[str]:
    match condition:
        case Holds(fluent, value):
            pattern = (*bound_fluent(fluent, binding), binding.get(value, value))
            found = {
                word
                for known, has in world
                if len(known) == len(fluent)
                and all(is_variable(one) or one == other for one, other in zip(pattern, (*known, has), strict=True))
                for name, word in zip(pattern, (*known, has), strict=True)
                if name == variable
            }
            is_value = value == variable and all(known != pattern[:-1] for known, _ in world)
            return found | ({"f"} if is_value and not any(map(is_variable, pattern[:-1])) else set())
        case AllOf(parts) | AnyOf(parts):
            return set().union(*(_candidates(variable, part, world, binding) for part in parts))
        case NotSo():
            return set()
