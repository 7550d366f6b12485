"""Actions whose effects and observations depend on the world, and e-states to which they are applied."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

from dyknow.planning.contingent.conditional_plans import ObservedFeature, SensingAction
from dyknow.planning.epistemic.conditions import (
    Binding,
    Fluent,
    World,
    WorldCondition,
    bound_fluent,
    is_so,
    known_bindings,
)


class KnownCondition(NamedTuple):
    """A condition that has to be known; with it the variables get their values."""

    variables: tuple[str, ...]
    condition: WorldCondition


class ActionResult(NamedTuple):
    """The effects and observations of an action in the worlds in which `condition` holds."""

    condition: WorldCondition | None
    effects: tuple[tuple[Fluent, str], ...]
    observations: tuple[tuple[Fluent, str], ...]


@dataclass(frozen=True, slots=True)
class EpistemicAction:
    """A schema, `(look-at ?y)`.

    Attributes:
        execute: the hook by which it is performed, as it is written.
    """

    name: Fluent
    preconditions: tuple[KnownCondition, ...]
    results: tuple[ActionResult, ...]
    cost: int = 1
    execute: str = field(default="", compare=False)


EState: TypeAlias = tuple[tuple[int, World], ...]
"""For each hypothesis that remains, by number, the world in which it is true."""


class ActionOutcome(NamedTuple):
    """The results of one action: an e-state for each observation, or a single one if it shows nothing."""

    action: SensingAction
    branches: tuple[tuple[ObservedFeature | None, EState], ...]


@dataclass(frozen=True, slots=True)
class EpistemicProblem:
    """Actions, the worlds of all hypotheses with their possibilities, and the goal."""

    actions: tuple[EpistemicAction, ...]
    worlds: tuple[World, ...]
    possibilities: tuple[float, ...]
    goal: KnownCondition


def outcomes(actions: tuple[EpistemicAction, ...], state: EState) -> Iterator[ActionOutcome]:
    """Every action whose preconditions are known, with its outcomes."""
    worlds = tuple(dict.fromkeys(world for _, world in state))
    for action in actions:
        seen: set[tuple[str, ...]] = set()
        for binding in _bindings(action.preconditions, worlds, {}):
            name = bound_fluent(action.name, binding)
            if name not in seen:
                seen.add(name)
                yield _outcome(action, name, binding, state)


def reaches(goal: KnownCondition, state: EState) -> dict[str, str] | None:
    """The values with which a goal is known; None where it is not."""
    worlds = tuple(dict.fromkeys(world for _, world in state))
    return next(known_bindings(goal.variables, goal.condition, worlds, {}), None)


def _bindings(conditions: tuple[KnownCondition, ...], worlds: tuple[World, ...], binding: Binding) -> Iterator[Binding]:
    if not conditions:
        yield binding
        return
    first, *others = conditions
    for found in known_bindings(first.variables, first.condition, worlds, binding):
        yield from _bindings(tuple(others), worlds, found)


def _outcome(action: EpistemicAction, name: Fluent, binding: Binding, state: EState) -> ActionOutcome:
    groups: dict[ObservedFeature | None, list[tuple[int, World]]] = {}
    for number, world in state:
        after, observed = _applied(action, world, binding)
        groups.setdefault(observed, []).append((number, after))
    shown = next((each for each in groups if each is not None), None)
    branches = tuple(
        (shown._replace(value="f") if observed is None and shown is not None else observed, tuple(part))
        for observed, part in groups.items()
    )
    return ActionOutcome(SensingAction(name[0], name[1:], action.cost), branches)


def _applied(action: EpistemicAction, world: World, binding: Binding) -> tuple[World, ObservedFeature | None]:
    """The world after an action, and the observation; conditions are those of the world before."""
    values: dict[Fluent, str] = dict(world)
    seen: list[tuple[Fluent, str]] = []
    for result in action.results:
        if result.condition is None or is_so(result.condition, world, binding):
            for fluent, value in result.effects:
                values[bound_fluent(fluent, binding)] = binding.get(value, value)
            seen += [
                (bound_fluent(fluent, binding), binding.get(value, value)) for fluent, value in result.observations
            ]
    return frozenset(each for each in values.items() if each[1] != "f"), _observed(seen)


def _observed(seen: list[tuple[Fluent, str]]) -> ObservedFeature | None:
    """All observations of an action as one."""
    if not seen:
        return None
    seen.sort()
    (feature, *arguments), _ = seen[0]
    target = " ".join(arguments)
    if len(seen) == 1:
        return ObservedFeature(feature.removesuffix("!"), target, seen[0][1])
    return ObservedFeature("seen", target, ",".join(f"{fluent[0].removesuffix('!')}:{value}" for fluent, value in seen))
