"""Units of a module in a specification that runs: `dyknow kpl run --units`."""

import json

import pytest

from tests.command import run as dyknow

UNITS = """
import itertools
from dyknow import computational_unit, value_unit

turn = itertools.count(1)

@computational_unit("text", "number", "number", name="Either", needs_all=False)
def either(_now_us, a, b):
    return ", ".join("no_sample" if each is None else str(each.value) for each in (a, b))

@computational_unit("text", "number", "number", name="Both")
def both(_now_us, a, b):
    return f"{a.value}, {b.value}"

@value_unit("number", "number", name="Later", priority=-1)
def later(number):
    return next(turn)

@value_unit("number", "number", name="First", priority=1)
def first(number):
    return next(turn)

@value_unit("number", "number", name="Second")
def second(number):
    return next(turn)

@computational_unit("number", "number", name="Slowly", supports=lambda policy: (policy.sample_us or 0) >= 1_000_000)
def slowly(_now_us, number):
    return number.value
"""


@pytest.fixture
def run(tmp_path):
    (tmp_path / "units.py").write_text(UNITS)

    def go(text, *fed):
        (tmp_path / "a.kpl").write_text(text)
        (tmp_path / "a.jsonl").write_text(
            "".join(json.dumps({"t_ms": 10 * i, **each}) + "\n" for i, each in enumerate(fed))
        )
        words = ["kpl", "run", "a.kpl", "--units", "units.py", "--feed", "a.jsonl", "--json"]
        return dyknow(words, {"PATH": ""}, tmp_path)

    return go


def values(done):
    found = {}
    for line in done.stdout.splitlines():
        said = json.loads(line)
        if said["event"] == "sample":
            found.setdefault(said["stream"], []).append(said["value"])
    return found


def test_a_unit_that_does_not_need_all_of_its_inputs_meets_no_sample(run):
    """Thesis 4.3.15: an input is the last available sample, or no_sample."""
    done = run(
        "source number one\nsource number other\nstrmgen a = one\nstrmgen b = other\n"
        "strmgen e = Either(a, b)\nstrmgen f = Both(a, b)\nstream either = e\nstream both = f",
        {"one": 1}, {"one": 2}, {"other": 3}, {"one": 4},
    )  # fmt: skip
    assert values(done) == {
        "either": ["1, no_sample", "2, no_sample", "2, 3", "4, 3"],
        "both": ["2, 3", "4, 3"],
    }


def test_of_units_of_one_input_the_one_of_the_highest_priority_is_called_first(run):
    """Thesis 5.3; the order in which they are declared is another one."""
    done = run(
        "source number one\nstrmgen a = one\n"
        "strmgen l = Later(a)\nstrmgen s = Second(a)\nstrmgen f = First(a)\nstrmgen again = First(f)\n"
        "stream last = l\nstream second = s\nstream first = f\nstream behind = again",
        {"one": 0}, {"one": 0},
    )  # fmt: skip
    assert values(done) == {"first": [1, 5], "behind": [2, 6], "second": [3, 7], "last": [4, 8]}


def test_an_output_policy_that_a_unit_does_not_support_is_refused_with_its_place(run):
    """Thesis 5.3.1, PolicyNotSupported."""
    text = "source number one\nstrmgen a = one\nstrmgen b = Slowly(a) with sample every {}\nstream out = b"
    refused = run(text.format("500"), {"one": 1})
    assert refused.returncode == 2
    assert "a.kpl:3:13: Slowly cannot provide its output with sample every 500" in refused.stderr
    assert values(run(text.format("1s"), {"one": 1})) == {"out": [1]}


def test_what_becomes_available_at_one_instant_is_one_element_of_the_join(run, tmp_path):
    """Thesis 4.5.8: two generators of one source, and two sources of one line of a feed; a record is read as it was made."""
    text = (
        "source number one\nsource number other\nstrmgen a = one\nstrmgen b = other\nstrmgen c = one\n"
        "strmgen e = Both(a, b)\nstrmgen f = Both(a, c)\nstream apart = e\nstream together = f"
    )
    done = run(text, {"one": 1, "other": 1}, {"one": 2, "other": 2})
    assert values(done) == {"apart": ["1, 1", "2, 2"], "together": ["1, 1", "2, 2"]}
    words = ["a.kpl", "--units", "units.py"]
    dyknow(["kpl", "run", *words, "--feed", "a.jsonl", "--record", "a.record"], {"PATH": ""}, tmp_path)
    verified = dyknow(["kpl", "verify", *words, "--journal", "a.record"], {"PATH": ""}, tmp_path)
    assert verified.returncode == 0, verified.stdout
