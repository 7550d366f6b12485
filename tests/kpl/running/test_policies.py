"""Policies of specifications: times relative to their declaration (4.4.11), states when all inputs changed (7.8), outputs (5.3.1)."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import Network, Policy
from dyknow.kpl import parse_specification, print_specification
from dyknow.kpl.checking.warnings import run_warnings
from dyknow.kpl.introspection.graph import graph_of
from dyknow.model.errors import PolicyError, TextErrors
from dyknow.model.instants import RelativeInstant, iso_instant, parse_instant, print_instant
from tests.command import run as dyknow
from tests.kpl.instances import Running
from tests.strategies import policies

NOW_US = 1_795_377_600_123_457
INSTANTS = st.integers(0, 2**50) | st.integers(-(2**40), 2**40).map(RelativeInstant)
PUSHED = "source number gps\nstrmgen pos[car1] = gps\n"


def running(text, now_us=NOW_US):
    instance = Running()
    instance.network.now_us = now_us
    instance.add(PUSHED + text)
    return instance


@given(INSTANTS)
def test_an_instant_is_read_back_as_it_is_printed(instant):
    again = parse_instant(print_instant(instant))
    assert (again, type(again)) == (instant, type(instant))


@given(INSTANTS, st.integers(0, 2**50), st.none() | st.integers(1, 10**7))
def test_a_relative_bound_is_the_moment_of_declaration_and_the_offset_on_the_grid_of_its_period(begin, now_us, period):
    policy = Policy(change="sample" if period else "any update", sample_us=period, from_us=begin)
    assert Policy.parse(str(policy)) == policy
    found = policy.at(now_us)
    assert not found.is_relative
    assert found.at(now_us + 1) == found
    if isinstance(begin, RelativeInstant):
        least = max(0, now_us + int(begin))
        assert least <= found.from_us < least + (period or 1)
        assert found.from_us % (period or 1) == 0
    else:
        assert found == policy


@given(policies())
def test_a_policy_without_offsets_is_the_same_at_any_time(policy):
    assert policy.at(NOW_US) is policy


def test_what_is_relative_names_no_stream_between_platforms():
    with pytest.raises(PolicyError, match="relative to when it is declared"):
        Policy.parse("from now").content_hash()


def test_a_stream_from_now_on_has_what_is_valid_in_the_duration_after_its_declaration():
    run = running(
        "stream some = pos[car1] with from +100ms to +200ms\n"
        'stream day = pos[car1] with from "2026-11-22T20:00:00.300Z" to "2026-11-22T21:00:00.350+01:00"\n'
    )
    assert iso_instant("2026-11-22T20:00:00.123457") == NOW_US
    for step in range(50):
        run.push("gps", step, NOW_US + step * 10_000)
    assert run.values("some") == list(range(10, 21))
    assert run.values("day") == list(range(18, 23))


def test_sampled_streams_from_now_on_meet_the_grid_of_the_epoch():
    run = running("stream some = pos[car1] with sample every 100ms, from now to +1s\n")
    begin = NOW_US - NOW_US % 100_000
    for step in range(15):
        run.push("gps", step, begin + step * 100_000) if step else None
    assert run.values("some") == list(range(1, 11))


def test_relative_times_of_inputs_states_and_families_are_those_of_the_declaration():
    run = running(
        "source object cars\nstrmgen ids = cars\ncompunit number Double(number)\n"
        "strmgen twice = Double(pos[car1] with from +1s)\nstrmgen both = state(pos[car1], twice) with any change\n"
        "for car in ids strmgen late[car] = Double(pos[car] with from +1s)\nstream doubled = twice\nstream l = late[car1]\n"
    )
    run.push("gps", 1, NOW_US + 500_000)
    run.push("cars", ("car1",), NOW_US + 1_500_000)
    run.push("gps", 2, NOW_US + 1_600_000)
    assert run.values("doubled") == [4]
    assert run.values("l") == [4], "the member came later; its second is that of the declaration"


def test_the_same_text_read_again_declares_nothing_new_and_what_is_changed_begins_anew():
    text = "stream some = pos[car1] with from now to +1s\nstream other = pos[car1] with from now\n"
    run = running(text)
    kept, declared = run.instance.streams["some"], run.instance.specification
    run.wait(NOW_US + 700_000)
    run.change(PUSHED + text.replace("other = pos[car1] with from now", "other = pos[car1] with from +1ms"))
    assert run.instance.streams["some"] is kept
    assert print_specification(declared[2:3]) == print_specification(run.instance.specification[2:3])
    assert run.instance.streams["other"].policy.from_us == NOW_US + 701_000
    run.remove("stream some = pos[car1] with from now to +1s\n")
    assert "some" not in run.instance.streams
    run.wait(NOW_US + 900_000)
    run.add("stream some = pos[car1] with from now to +1s\n")
    assert run.instance.streams["some"].policy.from_us == NOW_US + 900_000


def test_what_was_refused_was_not_declared():
    run = running("")
    with pytest.raises(TextErrors):
        run.add("stream some = pos[car1] with from now\nstream wrong = nothing\n")
    run.wait(NOW_US + 500_000)
    run.add("stream some = pos[car1] with from now\n")
    assert run.instance.streams["some"].policy.from_us == NOW_US + 500_000


def test_a_duration_that_ends_before_it_starts_when_it_is_declared_is_refused_with_its_place():
    run = running("")
    with pytest.raises(TextErrors) as refused:
        run.add("stream a = pos[car1]\nstream some = pos[car1] with from now to 400\n")
    (wrong,) = refused.value.errors
    assert (wrong.line, wrong.column) == (2, 15)
    assert "collide: a duration cannot end before it starts" in wrong.message


@pytest.mark.parametrize("text", ["from 300 to 400", "to 400", "from 0 to 400, sample every 100"])
def test_a_duration_that_was_over_before_it_was_declared_is_told_with_when_and_why(text):
    source = f"{PUSHED}stream some = pos[car1] with {text}\n"
    run = Running()
    run.network.now_us = NOW_US
    symbols = run.instance.current_symbols()
    (wrong,) = run_warnings(parse_specification(source), symbols, source, NOW_US)
    assert "`to 400` was 20780 days ago (1970-01-01 00:00:00 UTC; a number is ms since 1970)" in wrong.message
    assert wrong.line == 3
    assert not run_warnings(parse_specification(source), symbols, source, 400_000)
    repaired = source.replace(text, wrong.repair)
    run.add(repaired)
    assert not run_warnings(run.instance.specification, run.instance.current_symbols(), repaired, NOW_US)


def test_a_recorded_run_with_relative_times_satisfies_its_specification(tmp_path):

    (tmp_path / "a.kpl").write_text(
        f"{PUSHED}stream some = pos[car1] with from +100ms to +200ms\nstream old = pos[car1] with to 5\n"
    )
    fed = "".join(json.dumps({"t_ms": 50 * i, "gps": i}) + "\n" for i in range(8))
    (tmp_path / "a.jsonl").write_text(fed)
    command = ["kpl", "run", "a.kpl", "--feed", "a.jsonl", "--speed", "5", "--record", "a.rec", "--json"]
    ran = dyknow(command, {"HOME": str(tmp_path)}, tmp_path)
    assert [json.loads(line)["value"] for line in ran.stdout.splitlines()] == [2, 3, 4]
    assert "`to 5` was" in ran.stderr
    verified = dyknow(["kpl", "verify", "a.kpl", "--journal", "a.rec"], {"HOME": str(tmp_path)}, tmp_path)
    assert verified.returncode == 0, verified.stdout
    record = (tmp_path / "a.rec").read_text().replace('"declared_us": ', '"declared_us": 1')
    (tmp_path / "a.rec").write_text(record)
    assert dyknow(["kpl", "verify", "a.kpl", "--journal", "a.rec"], {"HOME": str(tmp_path)}, tmp_path).returncode == 1


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
