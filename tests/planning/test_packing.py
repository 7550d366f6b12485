"""Declarations as plain data: what was packed comes back, and what a stranger wrote is declarations or a ValueError."""

import json
import os
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import pytest

from dyknow.planning.domains.model import Declarations
from dyknow.planning.domains.packing import packed, unpacked
from dyknow.planning.domains.texts import parse_domain
from tests.federation.mutants import HOSTILE_NAMES

MUTANTS = 100_000 if os.environ.get("DYKNOW_FULL") else 300
TEXTS = ("examples/missions/survey.dom", "examples/planning/crane.dom", "examples/planning/sampling.dom")
VALUES: list[Any] = [
    None,
    True,
    0,
    -1,
    1e308,
    "",
    "x",
    [],
    {},
    [[]],
    ["And", []],
    ["Const", 1, False],
    ["str"],
    *HOSTILE_NAMES[:8],
]


@cache
def declared(file: str) -> Declarations:
    return parse_domain(Path(file).read_text(encoding="utf-8"))


@pytest.mark.parametrize("file", TEXTS)
def test_what_was_packed_comes_back_on_one_line(file: str) -> None:
    text = packed(declared(file))
    assert "\n" not in text
    assert unpacked(text, Declarations) == declared(file)


def _lists(tree: Any) -> list[list[Any]]:
    waiting, found = [tree], list[list[Any]]()
    while waiting:
        one = waiting.pop()
        if isinstance(one, list):
            waiting += one
            found += [one] if one else []
    return found


def test_a_changed_text_is_declarations_that_pack_to_it_or_is_refused() -> None:
    rng, refused = Random(3), 0
    written = packed(declared(TEXTS[1]))
    for _ in range(MUTANTS):
        tree = json.loads(written)
        one = rng.choice(_lists(tree))
        one[rng.randrange(len(one))] = rng.choice(VALUES)
        text = json.dumps(tree, separators=(",", ":"), ensure_ascii=False)
        try:
            found = unpacked(text, Declarations)
        except ValueError as wrong:
            assert str(wrong).startswith("what was packed cannot be read: ")
            refused += 1
        else:
            assert packed(found) == text
    assert refused > MUTANTS / 2


@pytest.mark.parametrize(
    "text", ["", "7", "null", "{}", "[]", '["Declarations"]', "[" * 100_000, '["Application","x",[]]']
)
def test_what_is_no_declarations_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="what was packed cannot be read"):
        unpacked(text, Declarations)
