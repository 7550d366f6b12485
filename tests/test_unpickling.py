"""Bytes never name what is called: no module of the product reads pickles, or runs what a file or a message holds as code."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.test_architecture import ROOMS, ROOT

MODULES = {
    "pickle", "_pickle", "cPickle", "marshal", "shelve", "dbm", "copyreg", "dill", "cloudpickle", "joblib", "jsonpickle", "multiprocessing",
    "concurrent.futures.process", "yaml", "code", "codeop", "runpy", "xmlrpc", "torch",
}  # fmt: skip
"""What unpickles, or has an interpreter read text; processes of `multiprocessing` pickle what goes between them."""
CALLS = {"eval", "exec", "compile", "__import__", "read_pickle", "from_pickle", "ProcessPoolExecutor", "unsafe_load"}
OPTIONS = {"allow_pickle", "cache"}
"""Of numpy, and of lark, which keeps its tables so."""
METHODS = {"__reduce__", "__reduce_ex__", "__getstate__", "__setstate__"}


def files() -> list[Path]:
    return sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.py"))


def imported(tree: ast.AST) -> Iterator[tuple[str, int]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((each.name, node.lineno) for each in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield str(node.module), node.lineno
            yield from ((f"{node.module}.{each.name}", node.lineno) for each in node.names)


def called(tree: ast.AST) -> Iterator[tuple[str, int]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            function = node.func
            if isinstance(function, ast.Name):
                yield function.id, node.lineno
            elif isinstance(function, ast.Attribute) and function.attr not in {"eval", "exec", "compile"}:
                yield function.attr, node.lineno
            yield from ((f"{each.arg}=", node.lineno) for each in node.keywords if each.arg in OPTIONS)
        elif isinstance(node, ast.FunctionDef) and node.name in METHODS:
            yield node.name, node.lineno


def broken(text: str) -> list[tuple[str, int]]:
    tree = ast.parse(text)
    return [
        *((name, line) for name, line in imported(tree) if {name, name.partition(".")[0]} & MODULES),
        *((name, line) for name, line in called(tree) if name in CALLS | METHODS | {f"{each}=" for each in OPTIONS}),
    ]


def test_no_module_unpickles_or_runs_text() -> None:
    found = [(path.relative_to(ROOT).as_posix(), *each) for path in files() for each in broken(path.read_text("utf-8"))]
    assert len(files()) > 500
    assert not found


@pytest.mark.parametrize(
    "text",
    [
        "import pickle", "from pickle import loads", "import multiprocessing.connection", "from concurrent.futures.process import BrokenProcessPool",
        "from concurrent.futures import ProcessPoolExecutor\nProcessPoolExecutor()", "eval(text)", "np.load(file, allow_pickle=True)",
        "Lark(text, cache=True)", "class A:\n    def __reduce__(self): ...", "pandas.read_pickle(file)",
    ],
)  # fmt: skip
def test_each_of_them_is_found(text: str) -> None:
    assert broken(text)


@pytest.mark.parametrize(
    "text", ["import re\nre.compile(text)", "from functools import cache", "model.eval()", "import codecs"]
)
def test_what_looks_like_them_is_not(text: str) -> None:
    assert not broken(text)
