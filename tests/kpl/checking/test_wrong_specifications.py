"""Wrong specifications: each is told with line, column, cause and repair, several in one pass; no text ever crashes."""

import json
import random
import time
from pathlib import Path

import pytest

from dyknow import Policy
from dyknow.kpl import parse_specification
from dyknow.kpl.diagnostics.languages import table
from dyknow.kpl.syntax.statements import read_specification
from dyknow.model.errors import SourceText, TextError, TextErrors
from tests.kpl.instances import Running

FOUND = json.loads(Path(__file__).with_name("wrong_specifications.json").read_text(encoding="utf-8"))
BEFORE, WRONG = FOUND["before"], FOUND["wrong"]


def errors_of(text: str) -> list[TextError]:
    running = Running()
    with pytest.raises(TextError) as told:
        running.add(text)
    assert running.instance.specification == ()
    assert running.network.labels() == ()
    return list(told.value.errors if isinstance(told.value, TextErrors) else (told.value,))


def test_there_are_sixty_at_least() -> None:
    assert len(WRONG) >= 60
    Running(BEFORE)


@pytest.mark.parametrize("case", WRONG, ids=[case["text"][:60] for case in WRONG])
def test_a_wrong_specification_is_told_with_its_place_the_cause_and_the_repair(case) -> None:
    errors = errors_of(f"{BEFORE}{case['text']}\n")
    told = [{"line": e.line, "column": e.column, "cause": e.message, "repair": e.repair} for e in errors]
    assert told == case["errors"]
    for error in errors:
        assert error.file == "a.kpl"
        assert "^" in error.drawn()


def test_every_error_has_a_repair_and_statements_and_policies_among_them_can_be_read() -> None:
    repairs = {error["repair"] for case in WRONG for error in case["errors"]}
    assert all(repairs)
    words = table("suggestions")
    forms = words["forms"]
    for repair in (
        *forms.values(),
        *words["makings"].values(),
        *(each for each in repairs if each.split()[0] in forms),
    ):
        if " " in repair and not repair.endswith("before it"):
            parse_specification(repair)
    for constraint in (*words["continued"].values(), *words["asked"].values(), words["policy"].removeprefix("with ")):
        if not constraint.startswith(("close", "no value")):
            needed = {"use linear": "sample every 100, ", "use most recent": "sample every 100, max delay 1, from 0, "}
            Policy.parse(needed.get(constraint, "") + constraint)


def test_what_cannot_be_read_hides_nothing_of_what_can() -> None:
    """Grammar, policies, names, arities and formulas in one pass; what an unread statement declares is not missed."""
    text = """stream a = pos[car1] with sample every 200, any change
stream b = nobody
strem c = pos[car1]
strmgen d = SpeedEst(pos[car1], pos[car1])
strmgen e := gps
stream f = e
strmgen g = NoUnit(pos[car1])
monitor m = 3
define p = q > 3 and p
stream h = d
"""
    whole = SourceText(BEFORE + text, "a.kpl")
    reading = read_specification(whole)
    findings = Running().instance.findings(reading.specification, (), whole, reading.unread)
    first = BEFORE.count("\n") + 1
    told = sorted(error.line - first for error in [*reading.errors, *findings.errors])
    assert told == [0, 1, 2, 3, 4, 6, 7, 8]


def grammatical(case):
    try:
        parse_specification(f"{BEFORE}{case['text']}\n")
    except TextError:
        return False
    return True


def test_several_are_told_in_one_pass() -> None:
    left_grammar = [
        case for case in WRONG if not grammatical(case) and "never closed" not in case["errors"][0]["cause"]
    ]
    begins = ("source", "compunit", "strmgen", "stream", "for", "export", "import", "define", "monitor", "chronicle")
    some = [case for case in left_grammar if case["text"].split()[0] in begins and "\n" not in case["text"]][:40]
    errors = errors_of(BEFORE + "".join(f"{case['text']}\n" for case in some))
    first = BEFORE.count("\n") + 1
    assert {error.line for error in errors} >= set(range(first, first + len(some)))


WORDS = [
    "source", "compunit", "strmgen", "stream", "for", "in", "select", "merge", "state", "link", "export", "import", "from", "as",
    "define", "monitor", "chronicle", "file", "with", "sample", "every", "max", "delay", "use", "most", "recent", "linear", "any",
    "update", "change", "order", "strict", "monotone", "to", "oo", "until", "always", "eventually", "forall", "exists", "growing",
    "not", "and", "or", "->", "<", "<=", "=", "!=", "==", "(", ")", "[", "]", "{", "}", ",", ":", ".", ";", "+", "-", "*", "/", "#",
    '"a"', "'", "\n", "\t", "0", "1", "3.5", "1e400", "200ms", "5s", "a", "pos", "pos[car1]", "speed", "self", "now", "since", "\x00",
    "ä", "\u2028", "\ufeff", "no", "value", "close", "after", "min", "certainty", "importance", "_", "a-b", "--", "\\", "0x1", "1ms2",
]  # fmt: skip


def fuzzed(rng: random.Random) -> str:
    kind = rng.random()
    if kind < 0.4:
        return " ".join(rng.choice(WORDS) for _ in range(rng.randrange(40)))
    text = list(BEFORE + rng.choice(WRONG)["text"])
    for _ in range(rng.randrange(1, 12)):
        at = rng.randrange(len(text))
        match rng.randrange(4):
            case 0:
                del text[at]
            case 1:
                text.insert(at, rng.choice(WORDS))
            case 2:
                text[at] = chr(rng.choice([rng.randrange(32, 127), rng.randrange(0x110000)]))
            case _:
                text[at:at] = text[at : at + rng.randrange(30)]
        if not text:
            break
    return "".join(text)


@pytest.mark.timeout(7200)
@pytest.mark.parametrize("texts", [2_000, pytest.param(100_000, marks=pytest.mark.full)])
def test_no_text_crashes_the_reader_or_takes_long(texts, record_testsuite_property) -> None:
    rng, longest_s = random.Random(7), 0.0
    for i in range(texts):
        text = fuzzed(rng)
        began = time.process_time()
        try:
            read = read_specification(text)
            if i % 10 == 0:
                Running().instance.add(read.specification, 0, text)
        except TextError as told:
            assert str(told)
        took_s = time.process_time() - began
        assert took_s < 1.0, text
        longest_s = max(longest_s, took_s)
    record_testsuite_property(f"longest_s of {texts}", longest_s)
