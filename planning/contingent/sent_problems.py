"""Problems of looking and their plans as records, for a process that makes plans next to the one that needs them."""

from collections.abc import Callable, Mapping
from typing import Any

from dyknow.planning.contingent.conditional_plans import ConditionalPlan, ObservedFeature, SensingAction
from dyknow.planning.contingent.recovery_planning import NoRecoveryPlan, plan_recovery
from dyknow.planning.contingent.sensing_problems import PossibleLook, RecoveryHypothesis, SensingProblem


def problem_record(problem: SensingProblem) -> dict[str, Any]:
    """The problem; visibility under a hypothesis is part of its looks."""
    return {
        "task": problem.task,
        "ways": {place: dict(others) for place, others in problem.ways.items()},
        "start": problem.start,
        "hypotheses": [[each.possibility, each.answer] for each in problem.hypotheses],
        "looks": [[*each[:3], [[value, hex(mask)] for value, mask in each.outcomes]] for each in problem.looks],
        "symbol": problem.symbol,
    }


def problem_of(record: Mapping[str, Any]) -> SensingProblem:
    """The problem of a record that `problem_record` made."""
    looks = tuple(
        PossibleLook(place, target, feature, tuple((value, int(mask, 16)) for value, mask in outcomes))
        for place, target, feature, outcomes in record["looks"]
    )
    hypotheses = tuple(RecoveryHypothesis(possibility, answer, {}) for possibility, answer in record["hypotheses"])
    return SensingProblem(record["task"], record["ways"], record["start"], hypotheses, looks, record["symbol"])


def planned_record(record: Mapping[str, Any], stop: Callable[[], str] = str) -> dict[str, Any]:
    """The plan of a problem, or why there is none."""
    found = plan_recovery(problem_of(record), stop=stop)
    if isinstance(found, NoRecoveryPlan):
        return {"plan": None, "reason": found.reason, "is_certain": True, "nodes": 0}
    return {"plan": _sent(found.plan), "reason": "", "is_certain": found.is_optimal, "nodes": found.steps}


def plan_of(record: Mapping[str, Any]) -> ConditionalPlan:
    """The plan of `planned_record`."""
    parts = list[ConditionalPlan]()
    for actions, branches, end, answer, possibility in record["parts"]:
        seen = tuple((ObservedFeature(*feature), parts[number]) for feature, number in branches)
        made = tuple(SensingAction(name, tuple(arguments), cost) for name, arguments, cost in actions)
        parts.append(ConditionalPlan(made, seen, end, answer, possibility))
    return parts[-1]


def _sent(plan: ConditionalPlan) -> dict[str, Any]:
    """Its parts, each after those of its branches, which it names by number: plans may be deep."""
    order, waiting = list[ConditionalPlan](), [plan]
    while waiting:
        one = waiting.pop()
        order.append(one)
        waiting += [each for _, each in one.branches]
    order.reverse()
    numbers = {id(each): number for number, each in enumerate(order)}
    return {
        "parts": [
            [
                [[each.name, list(each.arguments), each.cost] for each in one.actions],
                [[list(feature), numbers[id(part)]] for feature, part in one.branches],
                one.end,
                one.answer,
                one.possibility,
            ]
            for one in order
        ]
    }
