"""Formulas made to hurt meet clear errors or bounded work, whichever way they go; bounds are counted in work, not time."""

import os
import random
from time import process_time

import pytest

from dyknow.kpl import read_formula
from dyknow.model.errors import DyknowError, TextError
from dyknow.reasoning import make_progression
from dyknow.reasoning.formulas.tree import Always

FULL = bool(os.environ.get("DYKNOW_FULL"))
WAYS = ("object", "deadlines")
CPU_S = 5.0
"""No formula may cost more than this to read, nor any state: work that has no bound takes for ever. It takes less than one
second of an idle processor, and somewhat more of one that is shared.
"""
NESTED = 10_000


def cheap(work):
    began = process_time()
    try:
        return work()
    finally:
        spent = process_time() - began
        assert spent < CPU_S, f"{spent:.2f} s"


def progressed(formula, way, states, domains=None):
    """Some states; a refusal is told when it begins, and nothing else."""
    progression = make_progression(formula, 100_000, way=way)
    for at, values in enumerate(states):
        cheap(lambda at=at, values=values: progression.progress(at * 100_000, values, domains))
    return progression


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("(" * NESTED + "p" + ")" * NESTED, "nested more than 200 deep"),
        ("not " * NESTED + "p", "nested more than 200 deep"),
        ("always " * 9_000 + "p", "nested more than 200 deep"),
        ("eventually[0, 1] always[0, 1] " * 1_500 + "p", "nested more than 200 deep"),
        ("p until[0, 1] " * 3_000 + "q", "nested more than 200 deep"),
        ("x < " + "-" * 20_000 + "1", "nested more than 200 deep"),
        ("x < " + "1+" * 10_000 + "1", "nested more than 200 deep"),
        ("p -> " * 7_000 + "p", "nested more than 200 deep"),
        ("forall u in d: " * 4_000 + "p", "nested more than 200 deep"),
        ("[" * NESTED, "nested more than 200 deep"),
        ("x < 1" + "0" * 5_000, "the number is too large"),
        ("x < 1e999", "the number is too large"),
        ("x < 1e308 * 1e308 * 1e308", ""),
        ("always[0, 1e300] p", "is not a duration"),
        (f"always[0, {'9' * 40}] p", "is not a duration"),
        (f"eventually[{'9' * 15}h, oo] p", "is too long a time"),
        ("always forall u in {" + ", ".join(f"u{at}" for at in range(10_000)) + "}: p", "65536 are allowed"),
        ("p and " * 12_000 + "p", "65536 are allowed"),
        ("p and " * 8_000 + "a < 1+" + "1+" * 6_000 + "1", "more than 22000 names, numbers and signs"),
        ('"' * 60_000, ""),
        ("\0" * 20_000, "has no meaning here"),
    ],
    ids=lambda one: one[:24],
)
def test_texts_too_deep_too_large_or_too_long_are_refused_in_short_words(text, said):
    try:
        formula = cheap(lambda: read_formula(text))
    except TextError as error:
        assert said in str(error)
        assert len(str(error)) < 2_000
    else:
        assert not said
        for way in WAYS:
            progressed(formula, way, [{"x": 1.0}] * 3)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(
    "text",
    [
        "always eventually " * 3 + "p",
        "always[0, 1s] eventually[0, 1s] " * 3 + "p",
        "eventually[0, 300] always[0, 1s] " * 3 + "p",
        "eventually[0, 1s] eventually eventually[0, 1s] always always[0, 1s] always[200, 800] p",
        "p until (not p until[0, 500] (always eventually[0, 1s] (p until (always[0, 1s] p))))",
        "always eventually always[0, 1s] eventually[0, 300] always p",
    ],
)
def test_temporal_operators_deep_inside_one_another_are_bounded_work(text, way):
    rng = random.Random(text)
    progression = progressed(read_formula(text), way, [{"p": rng.random() < 0.7} for _ in range(25)])
    assert progression.kept < 50_000


def test_more_temporal_operators_inside_one_another_are_refused():
    text = "always eventually " * 60 + "p"
    with pytest.raises(TextError, match=r"120 temporal operators stand inside one another, 6 are allowed"):
        read_formula(text)
    deep = read_formula("p")
    for _ in range(7):
        deep = Always(deep)
    for way in WAYS:
        with pytest.raises(TextError, match="7 temporal operators stand inside one another"):
            progressed(deep, way, [{"p": True}])


OBJECTS = 10_000 if FULL else 1_000
MANY = {"d": tuple(f"u{at}" for at in range(OBJECTS)), "e": tuple(f"u{at}" for at in range(100))}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(
    "text",
    [
        "always forall u in d: s[u]",
        "always exists u in d growing: s[u]",
        "forall u in d growing: eventually[0, 500ms] s[u]",
        "forall u in d: eventually[0, 500ms] s[u]",
        "always forall u in d: x[u] > 1 -> eventually[0, 500ms] x[u] <= 1",
        "exists u in d: (s[u] until x[u] < 1)",
        "forall u in d: forall v in d: s[u]",
        "forall u in d: forall v in d: eventually[0, 1s] s[u]",
        "always forall u in e: forall v in e - {u}: x[u] > 1 -> eventually[0, 500ms] x[v] <= 1",
        "exists u in e: (eventually[0, 1s] s[u]) and (always[0, 500ms] eventually[0, 300ms] x[u] > 1)",
        "always exists u in e: (s[u] until[0, 1s] x[u] > 1) and (s[u] until[0, 2s] x[u] > 3)",
    ],
)
def test_thousands_of_quantified_objects_are_bounded_work(text, way):
    names = [f"{name}[u{at}]" for name in "sx" for at in range(OBJECTS)]
    states = [
        {name: (step + at) % 7 == 0 if name[0] == "s" else float((3 * step + at) % 5) for at, name in enumerate(names)}
        for step in range(4)
    ]
    try:
        progressed(read_formula(text), way, states, MANY)
    except TextError as error:
        assert "expands to more than" in str(error)


SEEDS = (
    "always forall u in uavs: speed[u] > 0.5 -> winch[u] <= 0.1",
    "always (x > 90 -> (x < 108 until[0, 5s] always[0, 10s] x <= 90))",
    "EXEC until[0, 5000] (p until abs(x - y) * 2 / 3 >= 7e2)",
    'eventually[0, oo] always[0, 1000] exists u in {a, b} - {a} growing: s[u] and mode = "idle"',
    "always (not p -> eventually[1ms, 1h] (since(p) >= 999us or occurred(landed[a]) or now < 2min))",
)  # fmt: skip
PIECES = (*'()[]{}<>=!-+*/,:"#\0\n.é', " not ", "always", "eventually[0, 1]", " until ", "forall u in uavs: ", "oo",
          "9" * 30, "1e308", "0", "-1", "p", "s[u]", "nan", "true", "and", "or", "->", "growing", "\u202e")  # fmt: skip
VALUES = (True, False, 0, 1.5, -1e308, float("nan"), float("inf"), 10**400, "idle", (1.0, 2.0), None)
LABELS = ("p", "x", "y", "mode", "EXEC", "s[a]", "s[b]", "s[u]", "speed[a]", "winch[a]", "speed[b]", "winch[b]")


def mutated(rng):
    """One of the seeds, with pieces put in, taken out, doubled and exchanged."""
    text = rng.choice(SEEDS)
    for _ in range(rng.choice((0, 1, 1, 2, 3, 8))):
        at = rng.randrange(len(text) + 1)
        to = min(len(text), at + rng.choice((0, 0, 1, 2, 8)))
        put = rng.choice((rng.choice(PIECES), "", text[at:to] * 2, rng.choice(SEEDS)[at : at + 9]))
        text = text[:at] + put + text[to:]
    return text


def test_mutated_formulas_are_read_or_refused_and_what_is_read_survives_any_state():
    rng = random.Random(20_261_121)
    read = 0
    for number in range(100_000 if FULL else 500):
        text = mutated(rng)
        try:
            formula = cheap(lambda text=text: read_formula(text))
        except TextError as error:
            assert 0 < len(str(error)) < 5_000, text
            continue
        read += 1
        way = WAYS[number % len(WAYS)]
        states = [{name: rng.choice(VALUES) for name in LABELS if rng.random() < 0.8} for _ in range(3)]
        try:
            progressed(formula, way, states, {"uavs": ("a", "b")})
        except DyknowError as error:
            assert str(error), text
    assert read > 50


@pytest.mark.parametrize("way", ["object", "deadlines"])
@pytest.mark.parametrize(
    "text", ["eventually " + "always eventually " * 2 + "a > 3", "always eventually " * 2 + "a > 3"]
)
def test_operators_in_turn_inside_one_another_are_bounded_work_and_decide_nothing(way, text):
    states = [{"a": at % 2 * 5} for at in range(60)]
    progression = progressed(read_formula(text), way, states)
    assert progression.verdict == "undecided"


@pytest.mark.parametrize("depth", [4, 12, 60])
def test_operators_in_turn_too_deep_inside_one_another_are_refused(depth):
    with pytest.raises(TextError, match="temporal operators"):
        read_formula("always eventually " * depth + "a > 3")
