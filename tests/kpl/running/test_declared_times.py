"""Durations relative to the moment of declaration, and ISO times: resolved once, and told when they are over (4.4.11)."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import Policy
from dyknow.model.errors import PolicyError, TextErrors
from dyknow.model.instants import RelativeInstant, iso_instant, parse_instant, print_instant
from kpl import parse_specification, print_specification
from kpl.checking.warnings import run_warnings
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
    from tests.command import run as dyknow

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
