"""Whatever a text is, formula, specification, chronicle or domain: it is read, or refused at a place, within a second."""

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random

import pytest

from dyknow.kpl import parse_chronicles, parse_formula, parse_specification
from dyknow.model.errors import TextError
from dyknow.planning.domains.texts import parse_domain

MUTANTS = 200_000 if os.environ.get("DYKNOW_FULL") else 400
MOST_S = 1.0 if os.environ.get("DYKNOW_FULL") else 5.0
"""Processor time; short runs share their cores with others, and only show that no cost is out of proportion."""
EXAMPLES = Path(__file__).parents[2] / "examples"
Reader = Callable[[str], object]
READERS: dict[str, Reader] = {
    "formula": parse_formula,
    "kpl": parse_specification,
    "chr": parse_chronicles,
    "dom": parse_domain,
}
WHOLE = 65_000


def filled(piece: str, characters: int = WHOLE, joint: str = "") -> str:
    """So many characters of the piece again and again."""
    return joint.join([piece] * (characters // (len(piece) + len(joint))))


def bombs() -> Iterator[tuple[str, str]]:
    """What is long, deep, full of errors or of names; the reader, and the text."""
    for joint in (" and ", " or ", " -> ", " until[0,1s] ", " + ", " = "):
        yield "formula", filled("a>1", joint=joint)
        yield "formula", filled("a", joint=joint)
    yield from (
        ("formula", filled(piece) + "a > 1") for piece in ("not ", "always ", "- ", "forall x in d: ", "(", "abs(")
    )
    yield from (("formula", piece * WHOLE) for piece in ('"', "%", "é", "a", "9", "[", "\0", "#"))
    yield "formula", "f[" + filled("a", joint=",") + "] > 1"
    yield "formula", "always " * 60 + filled("a > 1", joint=" and ")
    yield "formula", filled("(a > 1 or not b < 2)", joint=" and ")
    for piece in (
        "stream s = a[self]\n",
        "source bool b\n",
        "% ",
        "a,",
        "monitor m always a > 1\n",
        "strmgen s = f(a, b)\n",
    ):
        yield "kpl", filled(piece)
        yield "kpl", filled(piece) + "%"
    yield "kpl", "".join(f"source bool s{number}\n" for number in range(4000))
    yield "kpl", "".join(f"source bool s{number}\nstream t{number} = u{number}\n" for number in range(1800))
    yield "kpl", "stream s = a with " + filled("sample every 1", joint=", ")
    for piece in ("event(a[?u]:(?,?v), t) ", "x\n", "t < ", "{", "-"):
        yield "chr", "chronicle c { " + filled(piece) + "}"
    yield "chr", filled("chronicle c { x }\n")
    for piece in ("a", "a > 1", "not a"):
        yield "dom", "#goal g: " + filled(piece, 300_000, " and ")
        yield "dom", "#domain d\n#feature a: boolean\n#goal g: " + filled(piece, 60_000, " and ")
    yield "dom", "#goal g: " + "(" * 150_000 + "true" + ")" * 150_000
    yield "dom", filled("é%$", 900_000)
    yield "dom", "#domain d\n#objects d = {" + ", ".join(f"o{number}" for number in range(60_000)) + "}"
    yield "dom", "#domain d\n" + "".join(f"#feature f{number}(x): boolean\n" for number in range(8000))
    yield "dom", "#domain d\n" + "".join(f"#operator o{number}(x) :precond y{number}\n" for number in range(3000))


def cost_s(kind: str, text: str) -> float:
    """Processor time to read it; what is wrong has a place."""
    began = time.process_time()
    try:
        READERS[kind](text)
    except TextError as wrong:
        took = time.process_time() - began
        assert 1 <= wrong.line <= text.count("\n") + 2
        assert wrong.column >= 1
        assert str(wrong)
        return took
    return time.process_time() - began


@pytest.fixture(scope="module", autouse=True)
def warm() -> None:
    """Tables and messages are made once in a process."""
    for read in READERS.values():
        for text in ("x y", "%"):
            with pytest.raises(TextError):
                read(text)


BOMBS = list(bombs())


@pytest.mark.parametrize(("kind", "text"), BOMBS, ids=[f"{kind} {text[:24]!a}" for kind, text in BOMBS])
def test_a_bomb_is_read_or_refused_at_a_place_within_a_second(kind: str, text: str) -> None:
    assert cost_s(kind, text) <= MOST_S


def samples() -> dict[str, list[str]]:
    found = {kind: [path.read_text() for path in sorted(EXAMPLES.rglob(f"*.{kind}"))] for kind in ("kpl", "chr", "dom")}
    found["formula"] = [
        "always forall u in units: distance_xy[self,u] > 10",
        "a[self] > 1 until[0, 5s] (b.c - 2 <= abs(d) or not e = true)",
        'eventually[0, 2min] exists x in {1, 2, c} growing: f[x, 3] != "on" -> since(g[x]) < 3s',
    ]
    return found


def mutant(random: Random, texts: list[str]) -> str:
    """A text with pieces of itself and of others lost, doubled, moved, and odd characters."""
    text = random.choice(texts)
    if len(text) > 4000:
        start = random.randrange(len(text) - 2000)
        text = text[start : start + 2000]
    for _ in range(random.choice([1, 1, 2, 4, 9])):
        at, to = sorted(random.randrange(len(text) + 1) for _ in range(2))
        other = random.choice(texts)
        piece = random.choice(
            [
                "",
                text[at:to] * 2,
                other[(cut := random.randrange(len(other) + 1)) : cut + 40],
                random.choice(["(", ")", "[", '"', "é", "\0", "9" * 40, " and ", "->", "\n", ",", "-", "{", "0x", "#"]),
            ]
        )
        text = text[:at] + piece + text[to if random.random() < 0.5 else at :]
    return text


@pytest.mark.timeout(3600)
def test_mutated_texts_are_read_or_refused_at_a_place_within_a_second() -> None:
    random, texts = Random(25), samples()
    assert all(texts.values())
    for number in range(MUTANTS):
        kind = random.choice(list(texts))
        text = mutant(random, texts[kind])
        assert cost_s(kind, text) <= MOST_S, (number, kind, text)
