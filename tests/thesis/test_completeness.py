"""Every numbered definition and example has a test, in the map of ARCHITECTURE.md and in truth: without its line it fails."""

import ast
import os
import re
import subprocess
import sys
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path

import pytest

from tests.thesis.removing import ROOT, VARIABLE, Removed, removed

HERE = Path(__file__).parent
EXAMPLES = {"4_3": 11, "4_4": 14, "4_5": 6, "7_8": 3}  # chapters 3 and 5 have figures, and no numbered example
DEFINITIONS = {"4_3": 16, "4_4": 15, "4_5": 12, "7_8": 6}
NOTATION = {"4_3_1", "4_3_4", "4_5_1", "4_5_2", "4_5_3", "7_8_1", "7_8_2", "7_8_3"}
NUMBER = r"\d_\d_\d+"
REMOVED = removed()
MAP = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8").partition("## 6 Thesis map")[2]


def numbered(sections: dict[str, int]) -> list[str]:
    return [f"{section}_{n}" for section, last in sections.items() for n in range(1, last + 1)]


@cache
def functions() -> dict[str, dict[str, ast.FunctionDef]]:
    """The tests of each file, by its path below tests/; read by the tests, since all workers import this module."""
    found: dict[str, dict[str, ast.FunctionDef]] = {}
    for path in sorted(HERE.parent.rglob("test_*.py")):
        body = ast.parse(path.read_text(encoding="utf-8")).body
        tests = [node for node in body if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")]
        found[path.relative_to(HERE.parent).as_posix()] = {node.name: node for node in tests}
    return found


@cache
def names() -> list[str]:
    return [name for path, tests in functions().items() if path.startswith("thesis/") for name in tests]


@cache
def properties() -> set[str]:
    return {
        name
        for tests in functions().values()
        for name, node in tests.items()
        if {"definition", "given"}
        <= {part.id for each in node.decorator_list for part in ast.walk(each) if isinstance(part, ast.Name)}
    }


def named(name: str) -> set[str]:
    """The numbers in the name of a test; `a_to_b` are all between, in one section."""
    found = set(re.findall(NUMBER, name))
    for first, last in re.findall(rf"({NUMBER})_to_({NUMBER})", name):
        section, begin, end = first[:4], int(first[4:]), int(last[4:])
        found |= {f"{section}{n}" for n in range(begin, end + 1)}
    return found


@pytest.mark.parametrize("number", numbered(EXAMPLES))
def test_an_example_has_a_test_named_after_it(number: str) -> None:
    assert any(re.match(rf"test_example_{number}(?!\d)", name) for name in names())


@pytest.mark.parametrize("number", [each for each in numbered(DEFINITIONS) if each not in NOTATION])
def test_a_definition_that_fixes_something_has_a_property_that_fails_without_it(number: str) -> None:
    keywords = ["4_4_2"]  # a finite set, gone through word by word
    assert number in {*keywords, *(one for name in properties() for one in named(name))}
    proven = [each.test.partition("::")[2] for each in REMOVED if number.replace("_", ".") in each.of]
    assert any(number in keywords or (name in properties() and number in named(name)) for name in proven)


def rows() -> list[tuple[str, str, str]]:
    """The rows of the map: what, where, and by which tests."""
    cells = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in MAP.splitlines() if line.startswith("| ")
    ]
    return [(row[0], row[1], row[2]) for row in cells if len(row) == 3 and row[2] != "test"]


@pytest.mark.parametrize("row", rows(), ids=lambda row: row[0][:60])
def test_a_row_of_the_map_names_tests_that_are_there(row: tuple[str, str, str]) -> None:
    """A name without a file is looked for in the file that stands before it, else anywhere below tests/."""
    _, _, tests = row
    files: list[str] = []
    for path, name in re.findall(r"`(?:([\w/]+\.(?:py|md)))?(?:::)?(test_[\w]+\*?)?`", tests):
        if path.endswith(".md"):
            assert (ROOT / path).exists()
            continue
        if path:
            if not path.rpartition("/")[2].startswith("test_"):
                assert any(HERE.parent.rglob(path.rpartition("/")[2])), path
                continue
            files = [each for each in functions() if each == path.removeprefix("tests/") or each.endswith(f"/{path}")]
            assert files, path
        if name:
            wanted = [each for each in (files if path else functions()) for each in functions()[each]]
            assert any(fnmatchcase(each, name) for each in wanted), name


@pytest.mark.parametrize("one", REMOVED, ids=lambda one: f"{one.of[0]} {one.module}")
def test_what_is_removed_is_there_once_and_its_test_too(one: Removed) -> None:
    path, _, name = one.test.partition("::")
    assert (ROOT / one.module).read_text(encoding="utf-8").count(one.text) == 1
    assert name in functions()[path]


def fails_without(at: int) -> bool:
    """Whether the test fails; a property that happens to draw nothing that shows it gets a second try, with more examples."""
    return any(_fails(at, more) for more in ({}, {"DYKNOW_FULL": "1"}))


def _fails(at: int, more: dict[str, str]) -> bool:
    words = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "tests.thesis.removing", "-p", "no:cacheprovider"]
    environment = {name: value for name, value in os.environ.items() if name != "DYKNOW_FULL"}
    environment |= {VARIABLE: str(at), "PYTHONPATH": str(ROOT), **more}
    done = subprocess.run(
        [*words, f"tests/{REMOVED[at].test}"], cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode in {0, 1}, done.stdout + done.stderr
    return done.returncode == 1


def test_a_test_fails_without_what_it_proves() -> None:
    """One of them always; all of them with the full tests."""
    assert fails_without(next(at for at, each in enumerate(REMOVED) if "4.5.8" in each.of))


@pytest.mark.full
@pytest.mark.parametrize("at", range(len(REMOVED)), ids=lambda at: f"{REMOVED[at].of[0]} {REMOVED[at].module}")
def test_each_test_fails_without_what_it_proves(at: int) -> None:
    assert fails_without(at)
