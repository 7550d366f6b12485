"""B9: plans of 150 to 250 actions for the logistics domain of thesis 7.4.1, with control formulas as formulas.

The search is timed, not the reading of the texts. Each round has a problem of another seed, and begins with a garbage
collection, since a search of the product runs in a process of its own. Without its control formulas the same domain is searched as well, for the length of its plans. Where the extra `planning` is
installed, fast-downward plans for as many boxes without coordinates (`symbolic.dom`), each with a place of its own.
"""

import gc
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from importlib.util import find_spec
from itertools import cycle
from pathlib import Path
from time import perf_counter

from bench.rows import Bar, Figures, Limit, Options, Side
from dyknow.planning import Declarations, PlanFound, find_plan, parse_domain, parse_problem
from tests.planning.logistics import problem_text, text

TITLE = "a plan for 10 boxes, one carrier and one UAV"
BARS: tuple[Bar, ...] = (Limit("search_s", 0.2),)
EXTRA = {"fast-downward": "up_fast_downward"}

BOXES, SEEDS = 10, 8
SYMBOLIC_BOXES = 20


def searched(domain: Declarations, problem: Declarations) -> Figures:
    gc.collect()
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


def symbolic_text(boxes: int) -> str:
    """The symbolic problem: boxes and a carrier in a depot, half of the goals at each of two sites."""
    places = ", ".join(["depot", *(f"p{at}" for at in range(boxes))])
    lines = [f"#objects uav = {{uav1}}\n#objects box = b0 .. b{boxes - 1}\n#objects carrier = {{c1}}"]
    lines.append(f"#objects place = {{{places}}}\n#init in-state(uav1, unprepared), at(uav1, depot), at(c1, depot)")
    lines += [f"#init at(b{at}, depot)" for at in range(boxes)]
    return "\n".join([*lines, "#goal " + " & ".join(f"at(b{at}, p{at})" for at in range(boxes))])


def fast_downward() -> Side:
    """The first plan of fast-downward for the symbolic problem."""
    from unified_planning.shortcuts import OneshotPlanner, get_environment

    from dyknow.planning.symbolic.exporting import to_unified

    domain = parse_domain(Path(__file__).with_name("symbolic.dom").read_text(encoding="utf-8"))
    problem = to_unified(domain, parse_problem(symbolic_text(SYMBOLIC_BOXES), domain)).problem
    get_environment().credits_stream = None

    def solved() -> Figures:
        begun_s = perf_counter()
        with OneshotPlanner(name="fast-downward") as planner:
            found = planner.solve(problem)
        return {"search_s": perf_counter() - begun_s, "actions": float(len(found.plan.actions))}

    return solved


@contextmanager
def sides(options: Options) -> Iterator[Mapping[str, Side]]:
    domain = parse_domain(text())
    free = replace(domain, controls=(), operators=tuple(replace(one, controls=()) for one in domain.operators))
    problems = [parse_problem(problem_text(boxes=BOXES, seed=seed), domain) for seed in range(1, SEEDS + 1)]
    asked, asked_freely = cycle(problems), cycle(problems)
    found: dict[str, Side] = {"ours": lambda: searched(domain, next(asked))}
    if options.wants("free"):
        found["free"] = lambda: searched(free, next(asked_freely))
    if options.wants("fast-downward") and find_spec(EXTRA["fast-downward"]) is not None:
        found["fast-downward"] = fast_downward()
    yield found
