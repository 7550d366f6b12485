"""Policies of what is made: states when all inputs have changed (7.8, Fig. 7.9), and outputs of units (5.3.1)."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import Network
from dyknow.model.errors import PolicyError, TextErrors
from kpl import parse_specification, print_specification
from kpl.introspection.graph import graph_of
from tests.command import run as dyknow
from tests.kpl.instances import Running

TWO = "source number a\nsource number b\nstrmgen a = a\nstrmgen b = b\n"
ARRIVALS = st.lists(st.tuples(st.sampled_from("ab"), st.integers(0, 2)), max_size=40)


@given(ARRIVALS, st.sampled_from(["updated", "changed"]))
def test_a_state_is_made_when_all_inputs_have_been_updated_or_changed_since_the_one_before(arrivals, word):
    run = Running(f"{TWO}strmgen both = state(a, b) with all {word}\nstream both = both\n")
    wanted, news, last = [], set(), {}
    for source, value in arrivals:
        run.push(source, value)
        if word == "updated" or last.get(source) != value:
            news.add(source)
        last[source] = value
        if news == {"a", "b"}:
            wanted.append((last["a"], last["b"]))
            news.clear()
    assert run.values("both") == wanted


@pytest.mark.parametrize("declared", ["stream s = a with all changed", "monitor m = always a > 1 with all updated"])
def test_all_changed_is_refused_where_there_are_no_inputs_to_change(declared):
    run = Running(TWO)
    with pytest.raises(TextErrors) as refused:
        run.add(declared)
    assert "states" in refused.value.errors[0].message
    run.add(declared.replace("with all changed", "").replace("all updated", refused.value.errors[0].repair[5:]))


def test_all_changed_is_refused_of_a_stream_in_the_network():
    network = Network()
    with pytest.raises(PolicyError, match="constraint of states"):
        network.connect("a", "all changed", print)


@given(st.lists(st.tuples(st.integers(1, 4), st.integers(0, 3)), max_size=40))
def test_the_output_of_a_unit_is_what_its_policy_makes_of_it_whoever_takes_it(steps):
    text = (
        "source number a\nstrmgen a = a\ncompunit number Double(number)\n"
        "strmgen plain = Double(a)\nstrmgen made = Double(a) with sample every 20, max delay 1s\n"
        "stream like = plain with sample every 20, max delay 1s\nstream made = made\n"
    )
    assert print_specification(parse_specification(text)).count("with sample every 20, max delay 1000") == 2
    run = Running(text)
    for step, value in steps:
        run.push("a", value, run.now_us + step * 10_000)
    assert run.values("made") == run.values("like")
    drops = next(note for node in graph_of(run.instance).nodes if node.name == "made" for note in node.note)
    assert drops.startswith("its output with sample every 20, max delay 1000; dropped: ")
    run.change(text.replace("= Double(a) with sample every 20, max delay 1s", "= Double(a)"))
    run.push("a", 9, run.now_us + 1_001)
    assert run.values("made")[-1] == 18


@pytest.mark.parametrize(
    ("policy", "said"),
    [
        ("sample every 100, from 0, max delay 1s, use most recent", "Double cannot provide its output with"),
        ("delay before approximation 5", "constraint of states"),
        ("all changed", "constraint of states"),
        ("sample every 100us", "cannot be served"),
    ],
)
def test_an_output_policy_that_cannot_be_kept_is_refused_with_its_place(policy, said):
    text = f"source number a\nstrmgen a = a\ncompunit number Double(number)\nstrmgen made = Double(a) with {policy}\n"
    run = Running()
    with pytest.raises(TextErrors) as refused:
        run.add(text)
    (wrong,) = refused.value.errors
    assert (wrong.line, said in wrong.message) == (4, True)
    assert not run.instance.specification


def test_an_output_that_lies_off_its_own_grid_is_told():
    run = Running(
        "source number a\nstrmgen a = a\ncompunit number Double(number)\n"
        "strmgen made = Double(a) with sample every 100, from 0\nstream made = made\n"
    )
    for i in range(200):
        run.push("a", i, i * 100_000 + 7)
    assert run.values("made") == []
    assert [said for label, said in run.faults if label == "made"] == [
        "its output hardly meets its own policy, sample every 100, from 0 to oo"
    ]


def test_a_specification_with_policies_of_makers_runs_and_is_verified(tmp_path):
    (tmp_path / "u.py").write_text(
        'from dyknow import value_unit\n\n@value_unit("number", "number", name="Echo")\ndef echo(value):\n    return value\n'
    )
    (tmp_path / "a.kpl").write_text(
        f"{TWO}compunit number Echo(number)\nstrmgen e = Echo(a) with sample every 200\n"
        "strmgen both = state(a, b) with all changed\nstream e = e\nstream both = both\n"
    )
    fed = [{"t_ms": 100 * i, "a": i // 2} for i in range(7)] + [{"t_ms": 200 * i + 50, "b": i // 2} for i in range(4)]
    (tmp_path / "a.jsonl").write_text(
        "".join(json.dumps(each) + "\n" for each in sorted(fed, key=lambda one: one["t_ms"]))
    )
    command = ["kpl", "run", "a.kpl", "--units", "u.py", "--feed", "a.jsonl", "--record", "a.rec", "--json"]
    ran = dyknow(command, {"HOME": str(tmp_path)}, tmp_path)
    said = [(one["stream"], one["value"]) for one in map(json.loads, ran.stdout.splitlines())]
    assert [value for name, value in said if name == "e"] == [0, 1, 2, 3]
    assert [value for name, value in said if name == "both"] == [[0, 0], [2, 1]]
    verified = dyknow(
        ["kpl", "verify", "a.kpl", "--units", "u.py", "--journal", "a.rec"], {"HOME": str(tmp_path)}, tmp_path
    )
    assert verified.returncode == 0, verified.stdout
