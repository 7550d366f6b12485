"""A search for a plan as a process: `python -m runtime.searches.search` reads a request, and writes what comes of it.

One line of JSON comes in on standard input; lines of JSON go out: `{"nodes": ...}` now and then, and one with `plan`, which is
the last. The process takes at most 2 GB of memory, and ends when the process that began it does.
"""

import json
import os
import resource
import sys
import time
from typing import Any, Final

from dyknow.model.errors import DyknowError
from dyknow.model.instants import print_span
from planning.domains.texts import parse_domain, parse_problem
from planning.search.planner import PlanFound, find_plan

MEMORY_BYTES: Final = 2 << 30
NICENESS: Final = 5


def search(request: dict[str, Any], write: Any) -> dict[str, Any]:
    """Do it: what the last line says."""
    parent, limit_us = os.getppid(), request["limit_us"]
    end_s = time.monotonic() + limit_us / 1e6

    def stop() -> str:
        if os.getppid() != parent:
            sys.exit()
        return f"gave up after {print_span(limit_us)}" if time.monotonic() > end_s else ""

    try:
        domain = parse_domain(request["domain"])
        problem = parse_problem(request["problem"], domain)
        found = find_plan(domain, problem, stop=stop, progress=lambda nodes: write({"nodes": nodes}))
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

    def write(record: dict[str, Any]) -> None:
        sys.stdout.write(f"{json.dumps(record)}\n")
        sys.stdout.flush()

    write(search(json.loads(sys.stdin.readline()), write))


if __name__ == "__main__":
    main()
