"""The logistics domain and its problems, as the examples have them."""

from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

from dyknow.planning import Declarations, PlanFound, find_plan, parse_domain, parse_problem

FOLDER = Path(__file__).parents[2] / "examples/logistics"


@cache
def text() -> str:
    return (FOLDER / "logistics.dom").read_text(encoding="utf-8")


@cache
def domain() -> Declarations:
    return parse_domain(text())


def problem_text(**wanted: int) -> str:
    spec = spec_from_file_location("boxes", FOLDER / "boxes.py")
    assert spec is not None and spec.loader is not None
    boxes: Any = module_from_spec(spec)
    spec.loader.exec_module(boxes)
    found: str = boxes.problem(**wanted)
    return found


def problem(**wanted: int) -> Declarations:
    return parse_problem(problem_text(**wanted), domain())


def found(domain: Declarations, problem: Declarations, **options: Any) -> PlanFound:
    result = find_plan(domain, problem, **options)
    assert isinstance(result, PlanFound), result
    return result
