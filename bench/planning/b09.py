"""B9: plans of 150 to 250 actions for the logistics domain of thesis 7.4.1, with control formulas as formulas.

Timed is the search, from declarations that were read to a plan; each round is a problem of its own seed. Without its
control formulas the same domain is searched as well, for the length of its plans.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from itertools import cycle
from time import perf_counter

from bench.rows import Bar, Figures, Limit, Options, Side
from planning import Declarations, PlanFound, find_plan, parse_domain, parse_problem
from tests.planning.logistics import problem_text, text

TITLE = "a plan for 10 boxes, one carrier and one UAV"
BARS: tuple[Bar, ...] = (Limit("search_s", 0.2),)

BOXES, SEEDS = 10, 8


def searched(domain: Declarations, problem: Declarations) -> Figures:
    begun_s = perf_counter()
    end_s = begun_s + 10.0
    found = find_plan(domain, problem, stop=lambda: "gave up" if perf_counter() > end_s else "")
    took_s = perf_counter() - begun_s
    if not isinstance(found, PlanFound):
        return {"search_s": took_s, "nodes": float(found.nodes)}
    plan = found.plan
    return {
        "search_s": took_s,
        "actions": float(len(plan.actions)),
        "nodes": float(found.nodes),
        "takes_s": plan.end_ms / 1000,
        "cost": plan.cost,
    }


@contextmanager
def sides(options: Options) -> Iterator[Mapping[str, Side]]:
    domain = parse_domain(text())
    free = replace(domain, controls=(), operators=tuple(replace(one, controls=()) for one in domain.operators))
    problems = [parse_problem(problem_text(boxes=BOXES, seed=seed), domain) for seed in range(1, SEEDS + 1)]
    asked, asked_freely = cycle(problems), cycle(problems)
    found: dict[str, Side] = {"ours": lambda: searched(domain, next(asked))}
    if options.wants("free"):
        found["free"] = lambda: searched(free, next(asked_freely))
    yield found
