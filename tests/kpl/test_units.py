"""Units of a module in a specification that runs: `dyknow kpl run --units`."""

import json

import pytest

from tests.command import run as dyknow
from tests.kpl.instances import Running

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

@value_unit("number", "number", name="Costly", cost_us=30_000)
def costly(number):
    return number

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


def test_the_figures_that_a_governor_watches_have_processing_in_them(run):
    """Thesis 3.2, 10.7: what a unit makes is available when it has finished, and `max delay` counts from when it was valid."""
    done = run(
        "source number one\nstrmgen a = one\nstrmgen b = Costly(a)\nstream made = b\nstream late = b with max delay 29\n"
        "stream told = stream_delay[made]\nstream worst = stream_delay[worst]",
        *[{"one": at} for at in range(200)],
    )
    found = values(done)
    assert len(found["made"]) > 10
    assert found["told"][-1] >= 30
    assert found["worst"][-1] >= 30
    assert "late" not in found


def test_what_comes_after_a_later_one_is_waited_for_by_states_and_dropped_by_an_order(run):
    """Thesis 3.3.5: a generator "could wait"; an ordered stream delays nothing that is punctual."""
    fed = [{"t_ms": t, "at_ms": at, "one": t} for t, at in ((0, 0), (200, 210), (100, 250), (300, 310))]
    done = run(
        "source number one\nstrmgen a = one\nstrmgen s = state(a) with sample every 100, from 0 to 300, max delay 200\n"
        "stream ordered = a with monotone order, max delay 1s\nstream states = s",
        *fed,
    )
    assert values(done) == {"ordered": [0, 200, 300], "states": [[0], [100], [200], [300]]}


def test_two_generators_of_one_source_are_one_element_of_the_join():
    running = Running("source number one\nstrmgen a = one\nstrmgen b = one\nstrmgen c = Add(a, b)\nstream out = c")
    running.push("one", 1)
    running.push("one", 10)
    assert running.values("out") == [2, 20]
