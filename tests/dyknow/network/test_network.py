import gc
import weakref

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import (
    NO_VALUE,
    ComputationalUnit,
    Label,
    LabelAlreadyExists,
    Network,
    Policy,
    Sample,
    Sort,
    TextError,
    UnitFunction,
    UnitPrototype,
    UnknownLabel,
    of_values,
)
from dyknow.network.computational_unit import latest_valid_us
from dyknow.network.process import Input
from dyknow.network.refinement import RefinementProcess
from tests.fakes import FakeClock
from tests.strategies import streams

SPEED, LIMIT, OVER = Label("speed", ("uav1",)), Label("limit"), Label("over", ("uav1",))
NUMBER = Sort("number")


def refine(network: Network, made: Label, function: UnitFunction, *inputs: Label) -> None:
    unit = UnitPrototype("unit", "", ("",) * len(inputs), lambda: function)
    network.add_process(made, NUMBER, RefinementProcess(unit, list(map(Input, inputs))))


@pytest.fixture
def network() -> Network:
    network = Network(history=100)
    network.add_source(SPEED, NUMBER)
    network.add_source(LIMIT, NUMBER)
    return network


def test_samples_flow_from_sources_through_units_to_consumers(network: Network) -> None:
    refine(network, OVER, of_values(lambda speed, limit: speed - limit), SPEED, LIMIT)
    got: list[Sample] = []
    network.connect(OVER, Policy(change="any change"), got.append)
    network.push(LIMIT, Sample(1, 0, 10))
    network.push(SPEED, Sample(6, 5, 9))
    network.push(SPEED, Sample(8, 7, 11))
    assert got == [Sample(6, 5, -1), Sample(8, 7, 1)]
    assert network.generator(OVER).history.get_latest() == got[-1]
    assert network.labels() == (SPEED, LIMIT, OVER)


def test_every_subscriber_has_its_own_policy(network: Network) -> None:
    every, some = [], []
    network.connect(SPEED, Policy(), every.append)
    subscription = network.connect(SPEED, Policy(change="sample", sample_us=10), some.append)
    for t in range(25):
        network.push(SPEED, Sample(t, t, t))
    assert [s.value for s in every] == list(range(25))
    assert [s.value for s in some] == [0, 10, 20]
    assert subscription.adapter.dropped == {"off grid": 22}
    assert subscription.policy.sample_us == 10


def test_labels_are_unique_and_unknown_ones_are_named_with_what_there_is(network: Network) -> None:
    with pytest.raises(LabelAlreadyExists, match="speed"):
        network.add_source(SPEED, NUMBER)
    with pytest.raises(LabelAlreadyExists):
        refine(network, SPEED, of_values(abs), LIMIT)
    wrong = Label("sped", ("uav1",))
    for ask in (
        lambda: network.push(wrong, Sample(0, 0, 0)),
        lambda: network.remove(wrong),
        lambda: network.generator(wrong),
    ):
        with pytest.raises(UnknownLabel, match=r"speed\[uav1\]"):
            ask()


def test_a_cancelled_subscription_gets_nothing_more_not_even_of_the_present_sample(network: Network) -> None:
    got: list[str] = []
    first = network.connect(SPEED, Policy(), lambda _: (got.append("first"), second.cancel()))
    second = network.connect(SPEED, Policy(), lambda _: got.append("second"))
    network.push(SPEED, Sample(0, 0, 0))
    first.cancel()
    first.cancel()
    network.push(SPEED, Sample(1, 1, 1))
    assert got == ["first"]
    assert not second.linked


def test_consumers_may_subscribe_and_add_while_they_are_called(network: Network) -> None:
    got: list[Sample] = []

    def grow(sample: Sample) -> None:
        label = Label("copy", (str(sample.value),))
        refine(network, label, of_values(lambda v: v), SPEED)
        network.connect(label, Policy(), got.append)

    growing = network.connect(SPEED, Policy(), grow)
    network.push(SPEED, Sample(0, 0, 0))
    growing.cancel()
    network.push(SPEED, Sample(1, 1, 1))
    assert got == [Sample(1, 1, 1)], "what is subscribed during a push starts with the next one"


def test_a_removed_generator_ends_its_streams_and_starves_its_units(network: Network) -> None:
    refine(network, OVER, of_values(lambda a, b: a - b), SPEED, LIMIT)
    ended: list[str] = []
    over = network.connect(OVER, Policy(), print)
    subscription = network.connect(SPEED, Policy(), print, lambda linked: linked or ended.append("speed"))
    network.connect(SPEED, Policy(order="strict"), print, lambda linked: linked or ended.append("also"))
    network.remove(SPEED)
    assert ended == ["speed", "also"]
    subscription.cancel()
    assert network.labels() == (LIMIT, OVER)
    network.push(LIMIT, Sample(0, 0, 1))
    assert network.generator(OVER).history.get_size() == 0
    network.remove(OVER)
    assert not over.linked
    assert network.generator(LIMIT).subscriptions == (), "a removed unit lets go of its inputs"
    network.add_source(SPEED, NUMBER)


def test_what_is_removed_is_forgotten(network: Network) -> None:
    class Sink:
        def __call__(self, sample: Sample) -> None: ...

    for n in range(10):
        label, sink = Label("copy", (str(n),)), Sink()
        refine(network, label, of_values(lambda v: v), SPEED)
        wanted = Policy.parse("from 0 to oo, sample every 1, max delay 1, use most recent")
        stream = network.connect(label, wanted, sink)
        gone = weakref.ref(sink)
        network.remove(label)
        stream.cancel()
        del sink
    network.push(SPEED, Sample(0, 0, 0))
    network.connect(SPEED, Policy.parse("from 0 to oo, sample every 1, max delay 1, use most recent"), print)
    gc.collect()
    assert gone() is None
    assert len(network._timed) == 1


def test_policies_that_owe_samples_give_the_network_a_deadline(network: Network) -> None:
    clock, got = FakeClock(), []
    assert network.deadline_us is None
    for limit_us in (70, 30):
        network.connect(SPEED, Policy("sample", 100, limit_us, 0, 100, approximation="most recent"), got.append)
    network.on_time(clock.now_us())
    network.push(SPEED, Sample(clock.now_us(), 0, "v"))
    assert network.deadline_us == 130
    network.on_time(clock.advance_us(129))
    assert len(got) == 2
    network.on_time(clock.advance_us(1))
    assert network.deadline_us == 170
    network.on_time(clock.advance_us(40))
    assert got[2:] == [Sample(130, 100, "v"), Sample(170, 100, "v")]
    assert network.deadline_us is None


@given(streams(), st.integers(1, 60))
def test_available_times_of_a_generator_increase_strictly(f: list[Sample], tick_us: int) -> None:
    generator = Network().add_source(SPEED, NUMBER)
    pushed = [generator.push(Sample(s.available_us // tick_us * tick_us, s.valid_us, s.value)) for s in f]
    times = [s.available_us for s in pushed]
    assert times == sorted(set(times))
    assert all(p.available_us >= s.available_us // tick_us * tick_us for p, s in zip(pushed, f, strict=True))


def test_a_source_may_have_a_history_of_its_own_length(network: Network) -> None:
    assert network.add_source(OVER, NUMBER, history=2).history.capacity == 2
    assert network.generator(SPEED).history.capacity == 100


def test_a_unit_waits_for_all_inputs_and_passes_no_value_on() -> None:
    unit = ComputationalUnit(of_values(lambda a, b: a + b), 2)
    assert unit.on_sample(0, Sample(1, 1, NO_VALUE), 1) is None
    assert unit.on_sample(1, Sample(2, 2, 5), 2) == Sample(2, 2, NO_VALUE)
    assert latest_valid_us((None, None)) is None
    with pytest.raises(ValueError, match="at least 1"):
        ComputationalUnit(of_values(abs), 0)


def test_labels_and_policies_may_be_text() -> None:
    network, got, linked = Network(), list[Sample](), list[Sample]()
    network.add_source("pos[car1]", Sort("number"))
    network.connect("pos[car1]", "sample every 100ms, from 0 to oo", got.append)
    network.connect(Label("pos", ("car1",)), "any update", linked.append)
    for t in range(4):
        network.push("pos[car1]", Sample(t * 50_000, t * 50_000, t))
    assert [s.value for s in got] == [0, 2]
    assert len(linked) == 4
    with pytest.raises(UnknownLabel):
        network.push("pos[car2]", Sample(1, 1, 1))
    with pytest.raises(TextError):
        network.connect("pos[car1]", "sample always", print)
