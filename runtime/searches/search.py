"""A search for a plan as a process: `python -m dyknow.runtime.searches.search` reads a request and writes the outcome.

One line of JSON comes in on standard input; lines of JSON go out: `{"nodes": ...}` now and then, and one with `plan`, which is
the last. The process takes at most 2 GB of memory, and ends when the process that began it does.
"""

import json
import os
import resource
import sys
import time
from collections.abc import Callable, Mapping
from typing import Any, Final

from dyknow.agents.capabilities.missions.mission_texts import texts_record
from dyknow.model.errors import DyknowError
from dyknow.model.instants import print_span
from dyknow.planning.contingent.sent_problems import planned_record
from dyknow.planning.domains.texts import parse_domain, parse_problem
from dyknow.planning.search.planner import PlanFound, find_plan

MEMORY_BYTES: Final = 2 << 30
NICENESS: Final = 5


def found_record(
    request: Mapping[str, Any], stop: Callable[[], str], progress: Callable[[int], None] = lambda _nodes: None
) -> dict[str, Any]:
    """Search for a plan; returns the fields of the last line; `stop` gives a reason to end, or nothing."""
    try:
        if request.get("looking") is not None:
            return planned_record(request["looking"], stop)
        if request.get("reading") is not None:
            return {"plan": texts_record(request["reading"]), "reason": "", "is_certain": True, "nodes": 0}
        domain = parse_domain(request["domain"])
        problem = parse_problem(request["problem"], domain)
        found = find_plan(domain, problem, stop=stop, progress=progress, units=request["units"])
    except DyknowError as wrong:
        return {"plan": None, "reason": str(wrong), "is_certain": True, "nodes": 0}
    except MemoryError:
        reason = f"gave up: the search took more than {MEMORY_BYTES >> 30} GB of memory"
        return {"plan": None, "reason": reason, "is_certain": False, "nodes": 0}
    if isinstance(found, PlanFound):
        return {"plan": found.plan.as_record(), "reason": "", "is_certain": True, "nodes": found.nodes}
    reason = "; ".join([found.reason, *found.causes])
    return {"plan": None, "reason": reason, "is_certain": found.is_certain, "nodes": found.nodes}


def main() -> None:
    """See the module."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    os.nice(NICENESS)
    request, parent = json.loads(sys.stdin.readline()), os.getppid()
    limit_us = int(request["limit_us"])
    end_s = time.monotonic() + limit_us / 1e6

    def stop() -> str:
        if os.getppid() != parent:
            sys.exit()
        return f"gave up after {print_span(limit_us)}" if time.monotonic() > end_s else ""

    def write(record: dict[str, Any]) -> None:
        sys.stdout.write(f"{json.dumps(record)}\n")
        sys.stdout.flush()

    write(found_record(request, stop, lambda nodes: write({"nodes": nodes})))


if __name__ == "__main__":
    main()
