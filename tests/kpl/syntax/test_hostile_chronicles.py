"""Chronicle files that somebody made to hurt: each is answered in less than a second, by an error or by what it says."""

import os
import random
import re
import time

import pytest

from dyknow.kpl import print_chronicles, read_chronicles
from dyknow.kpl.diagnostics.languages import language
from dyknow.model.errors import SourceText, TextError

LONGEST_S = 1.0
"""Of processor time, looked at where nothing else runs."""
FULL = bool(os.environ.get("DYKNOW_FULL"))
TEXTS = [sample for mistake in language("chronicles").mistakes for sample in mistake.samples] + [
    "domain Car = {car3} | {car2} - ({car1} & ~{}) \\ X + {a}",
    "attribute on_road[?car] { ?value in {true, false} ?car in Car }",
    'message in_crossing[?car, ?crossing] { ?car in Car ?crossing not in {a, -3, "b c"} }',
    "constraint mySequence(t1, t2, t3) { t1 <= t2 <= t3 t3 - t1 <= 5 }",
    "time constraint x { t1 in [-12, 100] + 22 & [1300, oo[ - [0, 1] | ]-oo, 5] }",
    "constraint differ[?a, ?b] { ?a != ?b and not ?a in {x} or ?b == y }",
    "chronicle c[?a](t1) { if ?a == x then ?a != y else ?a == ?b variable ?a, *z in Car instant t4, t5 }",
    "chronicle overtake[?car1, ?car2] { event(car_relations.behind[?car1, ?car2]:(?, true), t1) t4 <= t1; t5 <= t1 }",
    "chronicle d[?x] { noevent(road[?x]:(?road, ?), (t4+1, t3-1)) t3 - t2 in [0, 60000] }",
    "chronicle e { occurs(1, oo, on_road[*x]:(?, false), (t5, t6 + [0, 5])) chronicle c[?a](t1, end = t3) end-start <= 5s }",
]
ODD = ["(", ")", "{", "}", "[", "]", "\n", "99999999999999999999", "1e308"]
PIECES = [*re.findall(r"[?*]?\w+|\S|\s", " ".join(TEXTS)), *ODD]


def answered(text):
    """How long it took, and what was said."""
    begun = time.process_time()
    try:
        found, errors = read_chronicles(SourceText(text, "hostile.chr"))
        said = "\n".join(map(str, errors)) or print_chronicles(found)
    except TextError as error:
        said = str(error)
    return time.process_time() - begun, said


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("chronicle c { " + "(" * 10_000 + "?x == a" + ")" * 10_000 + " }", "nested more than 200 deep"),
        ("chronicle c { " + "not " * 10_000 + "?x == a }", "nested more than 200 deep"),
        ("domain D = " + "~" * 10_000 + "{}", "nested more than 200 deep"),
        ("domain D = " + "(" * 10_000 + "{}" + ")" * 10_000, "nested more than 200 deep"),
        ("domain D = " + " | ".join(["{a}"] * 5_000), "nested more than 200 deep"),
        ("domain D = " + "-".join(["D"] * 10_000), "at most 512 characters"),
        ("chronicle c { event(a, " + "-".join(["t"] * 10_000) + ") }", "at most 512 characters"),
        ("chronicle c { event(a, t" + " + 1" * 10_000 + ") }", "nested more than 200 deep"),
        ("chronicle c { event(a, t) " + " < ".join(["t"] * 10_000) + " }", ""),
        ("chronicle c { event(a, t) t" + " < t2" * 10_000 + " }", "only compared"),
        ("chronicle c { event(a, t) t in " + "-" * 10_000 + "[0, 1] }", "`]`"),
        ("chronicle c { event(a, t) t in " + " & ".join(["[0, 1]"] * 5_000) + " }", ""),
        ("chronicle c { event(a[" + ", ".join(["?x"] * 10_000) + "], t) }", ""),
        ("chronicle c { event(a, t" + "9" * 60_000 + ") }", "at most 512 characters"),
        ("chronicle c { event(a, t + " + "9" * 60_000 + ") }", "at most 9007199254740992 ms"),
        ("chronicle c { event(a, t + 1e999) }", "at most 9007199254740992 ms"),
        ("chronicle c { event(a, t + 1e-999) }", "is finer"),
        ("chronicle c { occurs(1, 99999999999999999999, a, (t, t)) }", "up to 1000000"),
        ("chronicle c { occurs(1, " + "9" * 60_000 + ", a, (t, t)) }", "up to 1000000"),
        ("".join(f"domain D{n} = D{n + 1} | D{n + 1}\n" for n in range(90)) + "domain D90 = {a}", ""),
        (
            "".join(f"domain D{n} = D{n + 1} | D{n + 1}\n" for n in range(1_500)) + "domain D1500 = {a}",
            "stands on too many others",
        ),
        ("".join(f"domain D{n} = D{(n + 1) % 1500}\n" for n in range(1_500)), "stands on too many others"),
        ("domain D = {a}\n" * 4_000, "declared already"),
        ("".join(f"message m{n}\n" for n in range(5_000)), ""),
        (
            "message x\n" + "".join(f"chronicle c{n} {{ event(m{n}, t) }}\n" for n in range(1_500)),
            "there is no message",
        ),
        ("chronicle c { }\n" * 3_000, "declared already"),
        ("chronicle c { x }\n" * 3_000, "a statement is event"),
        ("chronicle c {\n" + "x\n" * 20_000 + "}", "a statement is event"),
        ("chronicle c {\n" + "event(a, t1\n" * 5_000 + "}", ""),
        ("{" * 60_000, "nested more than 200 deep"),
        ("}" * 60_000, ""),
        ("#" * 60_000, ""),
        ("\n" * 60_000, "there is no chronicle"),
        ('"' * 60_000, ""),
        ("chronicle " * 6_000, ""),
        ("a" * 70_000, "65536 are allowed"),
        ("".join(f"chronicle c{n} {{ chronicle c{n + 1} }}\n" for n in range(1_700)), "there is no chronicle"),
        ("".join(f"chronicle c{n} {{ chronicle c{(n + 1) % 1700} }}\n" for n in range(1_700)), "stand on itself"),
        ("chronicle c { event(\x00, t) }", "has no meaning"),
        ("chronicle c { event(\ud800, t) }", "has no meaning"),
    ],
)
def test_a_hostile_text_meets_a_limit_or_is_read(text, wanted):
    took_s, said = answered(text)
    assert took_s < LONGEST_S or not FULL
    assert wanted in said
    assert all(len(line) < 1_000 for line in said.splitlines()) or not wanted
    assert len(said) < 4_000_000


def mutated(seed):
    """Some text of ours with pieces lost, doubled, swapped and put in."""
    rng = random.Random(seed)
    parts = re.findall(r"[?*]?\w+|\S|\s", " ".join(rng.sample(TEXTS, rng.randint(1, 3))))
    for _ in range(rng.randint(1, 6)):
        at = rng.randrange(len(parts))
        match rng.randrange(5):
            case 0:
                parts[at] = ""
            case 1:
                parts.insert(at, rng.choice(PIECES))
            case 2:
                parts[at] = rng.choice(PIECES)
            case 3:
                parts[at:at] = parts[at : at + rng.randint(1, 30)]
            case _:
                other = rng.randrange(len(parts))
                parts[at], parts[other] = parts[other], parts[at]
    return "".join(parts)


@pytest.mark.timeout(3_000)
def test_whatever_the_text_there_is_an_answer_with_a_place():
    count = 100_000 if FULL else 300
    for seed in range(count):
        text = mutated(seed)
        took_s, said = answered(text)
        assert took_s < LONGEST_S or not FULL, text
        assert said, text
