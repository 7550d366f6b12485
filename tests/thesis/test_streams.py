"""Section 4.3: fluent streams, the functions on them, sources, computational units and joins."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import dyknow
from dyknow import (
    NO_VALUE,
    ComputationalUnit,
    Field,
    History,
    Join,
    Label,
    Network,
    Policy,
    Sample,
    Sort,
    ValueNotAvailable,
    available,
    available_times,
    join,
    last_available,
    of_values,
    previous,
)
from tests.strategies import streams, times_us
from tests.thesis.stream_definitions import WORKED, last_valid_before, most_recent_at, sample, stream, valid_before


def remembered(f: list[Sample]) -> History:
    history = History(max(1, len(f)))
    for s in f:
        history.add(s)
    return history


def asked(history: History, t: int, tq: int) -> Sample | None:
    try:
        return history.most_recent_at(t, tq)
    except ValueNotAvailable:
        return None


def test_example_4_3_2_no_value_and_nested_tuples_are_values() -> None:
    pair = Sort("pair", (Field("first", ""), Field("second", "")))
    assert (NO_VALUE, (10,)) == (NO_VALUE, (10,))
    pair.check(NO_VALUE)


def test_example_4_3_3_and_4_3_4_valid_time_stays_while_processing_delays_what_is_available() -> None:
    measured = Sample(available_us=11, valid_us=10, value="v")
    filtered = Sample(available_us=measured.available_us + 3 + 2, valid_us=measured.valid_us, value="v'")
    assert filtered[:3] == (16, 10, "v'")
    assert (measured.delay_us, filtered.delay_us) == (1, 6)


@given(streams())
def test_definition_4_3_5_a_fluent_stream_is_ordered_by_unique_available_times(f: list[Sample]) -> None:
    network, label = Network(), Label("f")
    network.add_source(label, Sort("any"))
    got: list[Sample] = []
    network.subscribe(label, Policy(), got.append)
    for s in f:
        network.push(label, s.valid_us, s.value, s.available_us // 10)  # so coarse a clock that instants collide
    times = [s.available_us for s in got]
    assert times == sorted(set(times))
    assert [s[1:] for s in got] == [s[1:] for s in f]


@given(times_us, times_us)
def test_definition_4_3_6_a_sample_has_two_times_and_a_value(at: int, valid: int) -> None:
    s = Sample(at, valid, "v")
    assert (s.available_us, s.valid_us, s.value, s.delay_us) == (at, valid, "v", at - valid)


@given(streams(), times_us)
def test_definitions_4_3_7_and_4_3_8_available_and_last_available(f: list[Sample], t: int) -> None:
    assert {s for s in f if s.available_us <= t} == set(available(f, t))
    last = last_available(f, t)
    assert (last is None) == (not available(f, t))
    assert last is None or (
        last in available(f, t) and all(s.available_us <= last.available_us for s in available(f, t))
    )


@given(streams(), times_us, times_us)
def test_definitions_4_3_9_to_4_3_11_most_recent_at(f: list[Sample], t: int, tq: int) -> None:
    found = asked(remembered(f), t, tq)
    assert found == most_recent_at(f, t, tq) == dyknow.most_recent_at(f, t, tq)
    assert dyknow.valid_before(f, t, tq) == valid_before(f, t, tq)
    assert dyknow.last_valid_before(f, t, tq) == last_valid_before(f, t, tq)
    if found is None:
        assert not valid_before(f, t, tq)
    else:
        assert found in last_valid_before(f, t, tq)
        assert all(s.valid_us <= found.valid_us for s in valid_before(f, t, tq))


@given(streams())
def test_definition_4_3_12_previous(f: list[Sample]) -> None:
    assert previous(f, None) is None
    assert [previous(f, s) for s in f] == [None, *f][: len(f)]


@given(streams(), streams())
def test_definition_4_3_13_available_times(f: list[Sample], g: list[Sample]) -> None:
    assert available_times(f, g) == available_times(f) | available_times(g)
    assert available_times(f) == {s.available_us for s in f}


@pytest.mark.parametrize("case", WORKED["queries"], ids=lambda c: c["from"])
def test_examples_4_3_6_and_4_3_7_queries(case: dict[str, Any]) -> None:
    f, about = stream(case["stream"]), case["about"]
    answer = None if case["answer"] is None else sample(case["answer"])
    if case["ask"] == "last available":
        assert last_available(f, about[0] * 1_000) == answer
    elif case["ask"] == "previous":
        assert previous(f, sample(about[0])) == answer
    else:
        t, tq = (1_000 * time for time in about)
        assert asked(remembered(f), t, tq) == most_recent_at(f, t, tq) == answer


def test_example_4_3_8_available_times() -> None:
    for case in WORKED["arrivals"]:
        assert available_times(*map(stream, case["streams"])) == {1_000 * t for t in case["times"]}


def test_example_4_3_9_a_source_that_has_nothing_to_say_adds_nothing() -> None:
    network, gps = Network(), Label("gps")
    generator = network.add_source(gps, Sort("position"))
    for t, reading in enumerate(["here", None, "there"]):
        if reading is not None:
            network.push(gps, t, reading, t)
    assert [s.value for s in generator.history.get_between(0, 10)] == ["here", "there"]


def test_example_4_3_10_addition_is_a_computational_unit() -> None:
    adder = ComputationalUnit(of_values(lambda a, b: a + b), 2)
    assert adder.on_sample(0, Sample(1, 1, 40), 1) is None
    assert adder.on_sample(1, Sample(2, 2, 2), 2) == Sample(2, 2, 42)
    assert adder.on_sample(0, Sample(3, 1, 50), 3) == Sample(3, 2, 52), "valid when the latest of its inputs is"


@given(st.lists(st.tuples(st.integers(0, 2), times_us), max_size=30))
def test_definition_4_3_15_a_unit_maps_time_inputs_and_state_to_output_and_state(
    arrivals: list[tuple[int, int]],
) -> None:
    calls: list[tuple[int, tuple[Sample | None, ...], object]] = []

    def count(now_us: int, inputs: tuple[Sample | None, ...], state: object) -> tuple[Sample | None, object]:
        calls.append((now_us, inputs, state))
        return (Sample(now_us, now_us, len(calls)) if len(calls) % 2 else None), len(calls)

    unit = ComputationalUnit(count, 3)
    last: list[Sample | None] = [None, None, None]
    for now_us, (i, valid_us) in enumerate(arrivals):
        last[i] = Sample(now_us, valid_us, i)
        output = unit.on_sample(i, Sample(now_us, valid_us, i), now_us)
        assert calls[-1] == (now_us, tuple(last), now_us or NO_VALUE), (
            "the state is what the call before returned, first no_value"
        )
        assert output == (None if now_us % 2 else Sample(now_us, now_us, now_us + 1))


@given(st.lists(streams(max_size=8), min_size=1, max_size=3))
def test_definition_4_3_16_join_step_by_step_is_the_join_of_the_whole(fs: list[list[Sample]]) -> None:
    stepped, at_instant = Join(len(fs)), {}
    for s, i in sorted(((s, i) for i, f in enumerate(fs) for s in f), key=lambda arrival: arrival[0].available_us):
        at_instant[s.available_us] = stepped.on_sample(i, s, s.available_us)
    assert list(at_instant.values()) == join(*fs)
    for element in join(*fs):
        assert element.value == tuple(last_available(f, element.available_us) for f in fs)


def test_example_4_3_11_join() -> None:
    for case in WORKED["joins"]:
        joined = join(*map(stream, case["streams"]))
        expected = [
            Sample(at * 1_000, valid * 1_000, tuple(s and sample(s) for s in pair))
            for at, valid, pair in case["joined"]
        ]
        assert joined == expected
