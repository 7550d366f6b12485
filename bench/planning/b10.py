"""B10: recovery plans for generated problems of places and objects, against exact dynamic programming (tests/planning/contingent).

Each round plans 200 problems of seeds of its own. `longest_s` is the slowest of them in processor time; `wrong` counts those whose
worth, leaves and actions are not the optimum. The other side is the dynamic programming itself.
"""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import count
from statistics import median
from time import process_time

from bench.rows import Bar, Figures, Limit, Options, Side
from dyknow.planning.contingent.files import read_recovery
from dyknow.planning.contingent.recovery_planning import RecoveryPlan, plan_recovery
from tests.planning.contingent.dynamic_programming import Oracle, generated

TITLE = "recovery plans, 200 generated problems a round"
BARS: tuple[Bar, ...] = (Limit("longest_s", 0.05), Limit("wrong", 0.0))

PROBLEMS = 200


def planned(seeds: range) -> Figures:
    times_s, wrong, unsolvable = [], 0, 0
    for seed in seeds:
        written = generated(seed)
        text = json.dumps(written)
        begun_s = process_time()
        case = read_recovery(text)
        plan = plan_recovery(case.problem, case.value)
        times_s.append(process_time() - begun_s)
        oracle = Oracle(written)
        best = oracle.best()
        if best is None or not isinstance(plan, RecoveryPlan):
            unsolvable += 1
            wrong += best is not None or isinstance(plan, RecoveryPlan)
            continue
        exact = float(best[0] if oracle.is_worst else oracle.expected(best))
        cost = plan.figures.worst_cost if oracle.is_worst else plan.expected
        wrong += abs(cost - exact) > 1e-9 or (plan.figures.leaves, plan.figures.actions) != best[1:]
    return {
        "longest_s": max(times_s),
        "median_s": median(times_s),
        "wrong": float(wrong),
        "unsolvable": float(unsolvable),
    }


def exact(seeds: range) -> Figures:
    times_s = []
    for seed in seeds:
        written = generated(seed)
        begun_s = process_time()
        Oracle(written).best()
        times_s.append(process_time() - begun_s)
    return {"longest_s": max(times_s), "median_s": median(times_s)}


@contextmanager
def sides(options: Options) -> Iterator[Mapping[str, Side]]:
    ours, theirs = count(), count()
    problems = max(1, round(PROBLEMS * options.effort))

    def seeds(numbers: Iterator[int]) -> range:
        number = next(numbers)
        return range(number * problems, (number + 1) * problems)

    found: dict[str, Side] = {"ours": lambda: planned(seeds(ours))}
    if options.wants("exact"):
        found["exact"] = lambda: exact(seeds(theirs))
    yield found
