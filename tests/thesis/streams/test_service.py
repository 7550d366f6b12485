"""Chapter 5, the service: who takes part (Figures 5.1 to 5.5), its operations and exceptions, the set-ups of 5.5."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.streams.experiments import of_one_source, of_sources, of_units
from dyknow import (
    Label,
    LabelAlreadyExists,
    Network,
    Policy,
    Sample,
    Sort,
    SourcePrototype,
    UnitPrototype,
    UnknownLabel,
    ValueNotAvailable,
    of_values,
)
from dyknow.kpl import parse_specification
from dyknow.model.errors import PolicyNotSupported, PrototypeExists, WrongNumberOfInputs
from dyknow.network.factory import Prototypes, process_of
from dyknow.network.process import Input
from tests.dyknow.networks import pass_time
from tests.kpl.instances import Running
from tests.strategies import definition, gridded_streams, policies
from tests.thesis.streams.stream_definitions import run, stream

ANY = Sort("any", is_open=True)
POS, SPEED, OTHER = Label("pos", ("car1",)), Label("speed", ("car1",)), Label("pos", ("car2",))
DOUBLE = UnitPrototype("Double", "number", ("number",), lambda: of_values(lambda v: 2 * v), samplewise=True)
GPS = SourcePrototype("gps", "number")


def test_figure_5_1_an_application_of_a_source_and_units_that_consume_and_produce_streams() -> None:
    running = Running(
        "source number gps\nstrmgen pos = gps\nstrmgen twice = Double(pos)\nstrmgen sum1 = Add(pos, twice)\nstream out = sum1"
    )
    running.push("gps", 1)
    running.push("gps", 10)
    assert running.values("out")[-1] == 30


def test_figures_5_2_and_5_3_a_client_creates_a_process_and_accesses_its_stream() -> None:
    """Prototypes are registered with the instance, generators with the network, which the client asks by label only."""
    running, got = Running(prototypes=[GPS, DOUBLE]), list[Sample]()
    running.network.connect(SPEED, Policy(), got.append)
    text = "source number gps\ncompunit number Double(number)\nstrmgen pos[car1] = gps\nstrmgen speed[car1] = Double(pos[car1])"
    running.instance.add(parse_specification(text), 0)
    running.instance.push("gps", Sample(6, 5, 21))
    assert got == [Sample(6, 5, 42)]
    running.instance.remove(running.instance.specification[-1:], 6)
    assert not running.network.has(SPEED)


@definition
@given(gridded_streams(), st.lists(policies(), max_size=4))
def test_definition_3_3_6_figures_5_4_and_5_5_one_generator_serves_every_subscription_by_its_own_policy(
    f: list[Sample], wanted: list[Policy]
) -> None:
    network, got = Network(), [list[Sample]() for _ in wanted]
    network.add_source(POS, ANY)
    for policy, found in zip(wanted, got, strict=True):
        network.connect(POS, policy, found.append)
    for s in f:
        pass_time(network, s.available_us)
        network.push(POS, s)
    horizon_us = max([s.available_us for s in f], default=0) + 100
    pass_time(network, horizon_us + 1)
    assert got == [run(f, policy, horizon_us)[0] for policy in wanted]


@pytest.mark.parametrize(
    ("text", "generators", "streams", "inputs"),
    [(of_one_source(5), 1, 5, 0), (of_sources(3, 6), 3, 6, 0), (of_units(2, 6), 3, 4, 2)],
    ids=["figure 5.6", "figure 5.8", "figure 5.10"],
)
def test_figures_5_6_5_8_and_5_10_the_set_ups_of_the_experiments(
    text: str, generators: int, streams: int, inputs: int
) -> None:
    copy = UnitPrototype("CU", "int", ("int",), lambda: of_values(lambda v: v), samplewise=True)
    running = Running(prototypes=[copy], sorts={})
    running.instance.add(parse_specification(text), 0)
    labels = running.network.labels()
    assert len(labels) == generators
    assert len(running.instance.streams) == streams
    assert sum(len(running.network.generator(label).subscriptions) for label in labels) == streams + inputs


CACHED = stream([(1, 10, "a"), (2, 40, "b"), (3, 20, "c"), (4, 20, "d"), (5, 30, "e")])
A, B, C, D, E = CACHED
NOT_THERE = ValueNotAvailable


@pytest.mark.parametrize(
    ("operation", "arguments", "answer"),
    [
        ("get_size", (), 5),
        ("get_latest", (), E),
        ("get_nth_latest", (0,), E),
        ("get_nth_latest", (3,), B),
        ("get_nth_latest", (5,), NOT_THERE),
        ("get_slice", (1, 3), [B, C, D]),
        ("get_slice", (0, 5), NOT_THERE),
        ("get_latest_vtime", (), B),
        ("get_closest_at_or_before", (20_000,), D),
        ("get_closest_at_or_before", (39_999,), E),
        ("get_closest_at_or_before", (9_999,), NOT_THERE),
        ("get_between", (20_000, 30_000), [C, D, E]),
        ("get_between", (41_000, 50_000), []),
    ],
)
def test_5_3_2_the_operations_of_a_stream_generator(operation: str, arguments: tuple[int, ...], answer: Any) -> None:
    network = Network()
    network.add_source(POS, ANY)
    for s in CACHED:
        network.push(POS, s)
    ask = getattr(network.snapshot(POS), operation)
    if answer is NOT_THERE:
        with pytest.raises(NOT_THERE):
            ask(*arguments)
    else:
        assert ask(*arguments) == answer


@pytest.mark.parametrize("operation", ["get_latest", "get_latest_vtime"])
def test_5_3_2_after_a_reset_nothing_is_cached(operation: str) -> None:
    network = Network()
    generator = network.add_source(POS, ANY)
    network.push(POS, Sample(1, 1, "a"))
    generator.history.reset()
    assert generator.history.get_size() == 0
    with pytest.raises(NOT_THERE):
        getattr(generator.history, operation)()


def test_5_3_1_and_5_4_1_what_cannot_be_created_is_refused() -> None:
    prototypes, network = Prototypes([GPS, DOUBLE]), Network()
    with pytest.raises(PrototypeExists):
        prototypes.add(GPS)
    network.add_source(POS, ANY)
    process = process_of(DOUBLE, [Input(POS)])
    assert process is not None
    with pytest.raises(LabelAlreadyExists):
        network.add_process(POS, ANY, process)
    with pytest.raises(WrongNumberOfInputs):
        process_of(DOUBLE, [Input(POS), Input(OTHER)])
    with pytest.raises(PolicyNotSupported):
        process_of(GPS, (), Policy(order="strict"))
    with pytest.raises(UnknownLabel):
        network.remove(SPEED)
    prototypes.remove("gps")
    prototypes.add(GPS)


OPERATIONS, LABELS = ("create", "add", "remove", "get"), (POS, SPEED, OTHER)
steps = st.binary(max_size=20).map(lambda drawn: [(OPERATIONS[n % 4], LABELS[n // 4 % 3]) for n in drawn])


@definition
@given(steps)
def test_5_4_1_and_5_4_2_processes_and_generators_by_label_are_as_a_table_of_labels_has_them(
    steps: list[tuple[str, Label]],
) -> None:
    """The table says who made what is there; an operation that it refuses changes nothing."""
    network, table = Network(), set[Label]()
    for operation, label in steps:
        there = label in table
        if operation == "create":
            expect(
                LabelAlreadyExists if there else None,
                network.add_process,
                label,
                ANY,
                process_of(DOUBLE, [Input(OTHER)]),
            )
        elif operation == "add":
            expect(LabelAlreadyExists if there else None, network.add_source, label, ANY)
        elif operation == "remove":
            expect(None if there else UnknownLabel, network.remove, label)
        else:
            expect(None if there else UnknownLabel, network.generator, label)
        if operation in {"create", "add"}:
            table.add(label)
        elif operation == "remove":
            table.discard(label)
        assert set(network.labels()) == table


def test_5_4_2_a_generator_without_its_label_is_not_destroyed_and_an_unknown_label_is_nothing() -> None:
    network, got, other = Network(), list[Sample](), list[Sample]()
    source = network.add_source(POS, ANY)
    network.add_process(SPEED, ANY, process_of(DOUBLE, [Input(POS)]))  # type: ignore[arg-type]
    network.connect(SPEED, Policy(), got.append)
    speed = network.generator(SPEED)
    assert network.release(OTHER) is None
    assert network.release(SPEED) is speed
    assert network.release(POS) is source
    assert network.labels() == ()
    source.push(Sample(1, 1, 4))
    assert [sample.value for sample in got] == [8], "its process and its streams are there"
    network.add_source(SPEED, ANY)
    network.connect(SPEED, Policy(), other.append)
    network.push(SPEED, Sample(2, 2, 5))
    network.remove(SPEED)
    source.push(Sample(3, 3, 6))
    assert ([sample.value for sample in got], [sample.value for sample in other]) == ([8, 12], [5])


def expect(refusal: type[Exception] | None, operation: Any, *arguments: Any) -> None:
    if refusal is None:
        operation(*arguments)
    else:
        with pytest.raises(refusal):
            operation(*arguments)
