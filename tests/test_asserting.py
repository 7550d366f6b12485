"""Every test can fail: it asserts, expects an error, or calls a helper that does."""

import ast
from collections.abc import Iterator
from pathlib import Path

Function = ast.FunctionDef | ast.AsyncFunctionDef
RUNS_A_PAGE = {"test_every_piece_of_python_runs", "test_what_the_page_shows_passes"}
"""Fails where the program of a page does."""


ITSELF = ""
"""Stands for an assertion among what a function calls."""


def calls(function: Function) -> Iterator[str]:
    for node in ast.walk(function):
        if isinstance(node, ast.Call):
            yield node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        elif isinstance(node, ast.Assert | ast.Raise):
            yield ITSELF


def test_every_test_asserts_something() -> None:
    functions = [
        node
        for path in Path(__file__).parent.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, Function)
    ]
    called = [(function.name, frozenset(calls(function))) for function in functions]
    judging = {ITSELF, "raises", "fail", "warns"}
    found = -1
    while found != len(judging):
        found = len(judging)
        judging |= {name for name, calls in called if not judging.isdisjoint(calls)}
    tests = {function.name for function in functions if function.name.startswith("test_")}
    assert tests - judging - RUNS_A_PAGE == set()
