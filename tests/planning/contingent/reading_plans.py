"""Printed plans read back and carried out in a world in which one hypothesis holds."""

import re
from collections.abc import Mapping
from typing import Any


def read(text: str) -> list[Any]:
    """A printed plan as nested lists."""
    stack: list[list[Any]] = [[]]
    for word in re.findall(r"[()]|[^\s()]+", text):
        if word == "(":
            stack.append([])
        elif word == ")":
            stack[-2].append(stack.pop())
        else:
            stack[-1].append(word)
    assert len(stack) == 1
    (plan,) = stack[0]
    assert isinstance(plan, list)
    return plan


def carried_out(plan: list[Any], problem: Mapping[str, Any], hypothesis: Mapping[str, Any]) -> tuple[str, int]:
    """How a plan ends where a hypothesis holds: `anchor X`, or in a search the last place seen from; and its actions."""
    place, seen, count = problem["start"], False, 0
    steps = list(plan)
    last = ""
    while steps:
        step = steps.pop(0)
        if step == ":success":
            return last if problem["kind"] == "identify" else f"{place} {'t' if seen else 'f'}", count
        if step == ":fail":
            return "fail", count
        match step:
            case ["move", to]:
                assert to in problem["places"][place], f"no way from {place} to {to}"
                place, count = to, count + 1
            case ["look-at", target]:
                seen, count = place in hypothesis["visible_from"].get(target, ()), count + 1
            case ["anchor", _, target]:
                last, count = f"anchor {target}", count + 1
            case ["cond", *branches]:
                (steps,) = [list(rest) for (_, _, _, value), *rest in branches if value == ("t" if seen else "f")]
            case _:
                raise AssertionError(step)
    raise AssertionError("the plan has no end")
