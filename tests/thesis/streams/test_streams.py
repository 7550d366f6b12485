"""Section 4.3: fluent streams, the functions on them, sources, computational units and joins."""

from itertools import groupby
from operator import itemgetter
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import (
    NO_VALUE,
    ComputationalUnit,
    Field,
    History,
    Label,
    Network,
    Policy,
    Sample,
    Sort,
    SortError,
    UnitPrototype,
    ValueNotAvailable,
    of_values,
)
from dyknow.network.process import Input
from dyknow.network.refinement import RefinementProcess
from tests.strategies import definition, streams, times_us
from tests.thesis.streams import stream_definitions as thesis
from tests.thesis.streams.stream_definitions import WORKED, sample, stream

F1 = stream([(1, 1, "v1"), (3, 2, "v2"), (4, 5, "v3")])
F2 = stream([(2, 1, "v4"), (4, 1, "v5"), (5, 1, "v6")])  # Example 4.3.5
ANY = Sort("any", is_open=True)


def remembered(f: list[Sample]) -> History:
    history = History(max(1, len(f)))
    for s in f:
        history.add(s)
    return history


def latest(f: list[Sample], t: int) -> Sample | None:
    """What a generator that has heard of `f` until `t` has as its latest sample."""
    try:
        return remembered([s for s in f if s.available_us <= t]).get_latest()
    except ValueNotAvailable:
        return None


def joined(*fs: list[Sample]) -> list[Sample]:
    """The join as a unit of a network meets it: what it is called with, and when."""
    network, labels, called = Network(), [Label("f", (str(i),)) for i in range(len(fs))], list[Sample]()

    def note(now_us: int, inputs: Any, state: Any) -> tuple[None, Any]:
        called.append(Sample(now_us, now_us, inputs))
        return None, state

    unit = UnitPrototype("Join", "any", ("any",) * len(fs), lambda: note)
    for label in labels:
        network.add_source(label, ANY)
    network.add_process(Label("join"), ANY, RefinementProcess(unit, [Input(label) for label in labels]))
    network.connect("join", "", called.append)
    arrivals = sorted((s.available_us, i, s) for i, f in enumerate(fs) for s in f)
    for at_us, together in groupby(arrivals, itemgetter(0)):
        with network.instant.whole():
            for _, i, s in together:
                network.push(labels[i], Sample(at_us, s.valid_us, s.value))
    return called


def asked(history: History, t: int, tq: int) -> Sample | None:
    try:
        return history.most_recent_at(t, tq)
    except ValueNotAvailable:
        return None


def test_example_4_3_1_a_domain_of_ten_objects_and_their_positions_and_speeds() -> None:
    network = Network()
    labels = [Label("pos", (f"o{i}",)) for i in range(1, 11)]
    for label in labels:
        network.add_source(label, ANY)
    primitive = [f"{kind}{i}" for kind in "ps" for i in range(1, 11)]
    for t, value in enumerate(primitive):
        network.push(labels[t % 10], Sample(t, t, value))
    found = [s for label in labels for s in network.snapshot(label).get_between(0, 100)]
    assert {s.value for s in found} == set(primitive)
    assert {s.valid_us for s in found} == set(range(20)), "time-points are the integers from 0"


def test_example_4_3_2_simple_values_no_value_and_tuples_of_values_are_values() -> None:
    for value in ("p4", "o3", "s9", NO_VALUE, (NO_VALUE, ("o10",))):
        ANY.check(value)
        assert thesis.is_value(value)
    pair = Sort("pair", (Field("first", ""), Field("second", "")))
    pair.check(NO_VALUE)
    with pytest.raises(SortError):
        pair.check((NO_VALUE, ("o10",)))


anything = st.recursive(
    st.sampled_from(["p4", 7, 1.5, True, NO_VALUE, None, float("nan"), float("inf"), -float("inf"), b"p", object()]),
    lambda inner: st.lists(inner, max_size=3).map(tuple) | st.lists(inner, max_size=2),
    max_leaves=5,
)


@definition
@given(anything)
def test_definitions_4_3_2_and_4_3_3_what_is_a_value(found: Any) -> None:
    try:
        ANY.check(found)
    except SortError:
        assert not thesis.is_value(found)
    else:
        assert thesis.is_value(found)


def test_example_4_3_3_the_blob_of_a_picture_is_valid_when_the_picture_was_taken() -> None:
    network, picture, blob = Network(), Label("picture"), Label("blob")
    network.add_source(picture, ANY)
    unit = UnitPrototype("Blob", "", ("",), lambda: of_values(str.upper))
    network.add_process(blob, ANY, RefinementProcess(unit, [Input(picture)]))
    network.push(picture, Sample(13, 10, "image"))
    for label in (picture, blob):
        (found,) = network.snapshot(label).get_between(0, 100)
        assert (found.valid_us, found.available_us, found.delay_us) == (10, 13, 3)


def test_example_4_3_4_processing_and_communication_delay_what_is_available() -> None:
    """The sample is there after 1, processing it takes 3, communicating it 2; it is the networks that add them up."""
    network, receiver = Network(), Network()
    measured, filtered, received = list[Sample](), list[Sample](), list[Sample]()
    camera, filtering = Label("camera"), Label("filter")
    network.add_source(camera, ANY)
    unit = UnitPrototype("Filter", "", ("",), lambda: of_values(lambda value: f"{value}'"), cost_us=3)
    network.add_process(filtering, ANY, RefinementProcess(unit, [Input(camera)]))
    network.connect(camera, Policy(), measured.append)
    network.connect(filtering, Policy(), filtered.append)
    network.push(camera, Sample(11, 10, "v"))
    assert not filtered, "it has not finished"
    assert network.deadline_us == 14
    network.on_time(14)
    receiver.add_source(filtering, ANY)
    receiver.connect(filtering, Policy(), received.append)
    receiver.push(filtering, Sample(filtered[0].available_us + 2, filtered[0].valid_us, filtered[0].value))
    assert [s[:3] for s in (*measured, *filtered, *received)] == [(11, 10, "v"), (14, 10, "v'"), (16, 10, "v'")]


def test_example_4_3_5_and_figure_4_2_two_fluent_streams() -> None:
    network = Network()
    for f in (F1, F2):
        label = Label("f", (f[0].value,))
        network.add_source(label, ANY)
        for s in f:
            network.push(label, s)
        assert network.snapshot(label).get_slice(0, 2) == f
        assert thesis.is_fluent_stream(f)


@definition
@given(streams())
def test_definition_4_3_5_a_fluent_stream_is_ordered_by_unique_available_times(f: list[Sample]) -> None:
    network, label = Network(), Label("f")
    network.add_source(label, Sort("any"))
    got: list[Sample] = []
    network.connect(label, Policy(), got.append)
    for s in f:
        network.push(
            label, Sample(s.available_us // 10, s.valid_us, s.value)
        )  # so coarse a clock that instants collide
    assert thesis.is_fluent_stream(got)
    assert [s[1:] for s in got] == [s[1:] for s in f]


@definition
@given(times_us, times_us)
def test_definition_4_3_6_a_sample_has_two_times_and_a_value(at: int, valid: int) -> None:
    network, label = Network(), Label("f")
    network.add_source(label, ANY)
    network.push(label, Sample(at, valid, "v"))
    s = network.snapshot(label).get_latest()
    assert (s.available_us, s.valid_us, s.value, s.delay_us) == (at, valid, "v", at - valid)


@definition
@given(streams(), times_us)
def test_definitions_4_3_7_and_4_3_8_available_and_last_available(f: list[Sample], t: int) -> None:
    assert remembered(f).get_slice(0, len(f) - 1)[: len(thesis.available(f, t))] == thesis.available(f, t)
    assert latest(f, t) == thesis.last_available(f, t)


@definition
@given(streams(), times_us, times_us)
def test_definitions_4_3_9_to_4_3_11_most_recent_at(f: list[Sample], t: int, tq: int) -> None:
    assert asked(remembered(f), t, tq) == thesis.most_recent_at(f, t, tq)
    assert remembered(thesis.available(f, tq)).get_between(0, t) == sorted(
        thesis.valid_before(f, t, tq), key=lambda s: (s.valid_us, s.available_us)
    )


@definition
@given(streams(), streams(max_size=1))
def test_definition_4_3_12_previous(f: list[Sample], other: list[Sample]) -> None:
    for s in (*f, *other):
        assert latest(f, s.available_us - 1) == thesis.previous(f, s)


@definition
@given(streams(), streams())
def test_definition_4_3_13_available_times(f: list[Sample], g: list[Sample]) -> None:
    assert [s.available_us for s in joined(f)] == sorted(thesis.available_times(f))
    assert [s.available_us for s in joined(f, g)] == sorted(thesis.available_times(f, g))


@pytest.mark.parametrize("case", WORKED["queries"], ids=lambda c: c["from"])
def test_the_worked_queries_of_4_3(case: dict[str, Any]) -> None:
    f, about = stream(case["stream"]), case["about"]
    answer = None if case["answer"] is None else sample(case["answer"])
    if case["ask"] == "last available":
        assert latest(f, about[0] * 1_000) == answer
    elif case["ask"] == "previous":
        assert latest(f, sample(about[0]).available_us - 1) == answer
    else:
        t, tq = (1_000 * time for time in about)
        assert asked(remembered(f), t, tq) == thesis.most_recent_at(f, t, tq) == answer


def test_example_4_3_6_the_last_available_sample() -> None:
    assert [latest(F1, t * 1_000) for t in (2, 3)] == F1[:2]
    assert [latest(F2, t * 1_000) for t in (1, 3, 4)] == [None, *F2[:2]]


def test_example_4_3_7_the_previous_sample() -> None:
    assert latest(F1, F1[1].available_us - 1) == F1[0]
    assert latest(F1, F1[0].available_us - 1) is None


def test_example_4_3_8_available_times() -> None:
    for case in WORKED["arrivals"]:
        assert {s.available_us for s in joined(*map(stream, case["streams"]))} == {1_000 * t for t in case["times"]}
    assert [s.available_us for s in joined(F1)] == [1_000, 3_000, 4_000]
    assert [s.available_us for s in joined(F2)] == [2_000, 4_000, 5_000]


def test_example_4_3_9_a_source_that_has_nothing_to_say_adds_nothing() -> None:
    network, gps = Network(), Label("gps")
    generator = network.add_source(gps, Sort("position"))
    for t, reading in enumerate(["here", None, "there"]):
        if reading is not None:
            network.push(gps, Sample(t, t, reading))
    assert [s.value for s in generator.history.get_between(0, 10)] == ["here", "there"]


def test_example_4_3_10_addition_is_a_computational_unit() -> None:
    adder = ComputationalUnit(of_values(lambda a, b: a + b), 2)
    assert adder.on_sample(0, Sample(1, 1, 40), 1) is None
    assert adder.on_sample(1, Sample(2, 2, 2), 2) == Sample(2, 2, 42)
    assert adder.on_sample(0, Sample(3, 1, 50), 3) == Sample(3, 2, 52), "valid when the latest of its inputs is"


@definition
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


@definition
@given(st.lists(streams(max_size=8), min_size=1, max_size=3))
def test_definition_4_3_16_join_step_by_step_is_the_join_of_the_whole(fs: list[list[Sample]]) -> None:
    assert joined(*fs) == thesis.join(*fs)


def test_example_4_3_11_and_figure_4_3_join() -> None:
    for case in WORKED["joins"]:
        expected = [
            Sample(at * 1_000, valid * 1_000, tuple(s and sample(s) for s in pair))
            for at, valid, pair in case["joined"]
        ]
        assert joined(*map(stream, case["streams"])) == expected
