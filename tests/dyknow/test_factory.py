"""The knowledge process factory and the stream generator manager: every operation and exception (5.3.1, 5.4)."""

import pytest

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
    source,
    value_unit,
)
from dyknow.errors import PolicyNotSupported, PrototypeExists, UnknownPrototype, WrongNumberOfInputs
from dyknow.factory import ProcessFactory
from dyknow.processes import Input
from dyknow.prototypes import prototypes_in
from dyknow.values import Field
from tests.dyknow.networks import policy, times

POS, SPEED = Label("pos", ("car1",)), Label("speed", ("car1",))


@value_unit("speed", "pos", name="SpeedEst")
def speed_est(value):
    return value * 2


@source("pos", name="gps")
def gps(from_us):
    for t in range(from_us, from_us + 100, 10):
        yield t, t


@pytest.fixture
def factory() -> ProcessFactory:
    factory = ProcessFactory(Network())
    for prototype in prototypes_in([speed_est, gps]):
        factory.add_prototype(prototype)
    factory.add_prototype(SourcePrototype("feed", "pos"))
    return factory


def test_prototypes_are_added_found_and_removed(factory: ProcessFactory) -> None:
    assert {each.name for each in factory.prototypes()} == {"SpeedEst", "gps", "feed"}
    assert factory.prototype("gps").sort == "pos"
    with pytest.raises(PrototypeExists, match="'gps' exists already"):
        factory.add_prototype(SourcePrototype("gps", "other"))
    factory.remove_prototype("gps")
    assert factory.find("gps") is None
    for ask in (factory.prototype, factory.remove_prototype):
        with pytest.raises(UnknownPrototype, match=r"'gps'; there are SpeedEst, feed"):
            ask("gps")


def test_processes_are_created_and_destroyed(factory: ProcessFactory) -> None:
    network = factory._network
    factory.create_knowledge_process(POS, "feed")
    factory.create_knowledge_process(SPEED, "SpeedEst", [Input(POS)])
    got: list[Sample] = []
    network.connect(SPEED, Policy(), got.append)
    network.push(POS, 1, 2, 3)
    assert times(got) == [(3, 1, 4)]
    factory.remove_prototype("SpeedEst")
    network.push(POS, 2, 3, 4)
    assert len(got) == 2, "what was made goes on"
    factory.destroy_knowledge_process(SPEED)
    assert network.labels() == (POS,)
    assert network.generator(POS).subscriptions == ()
    with pytest.raises(UnknownLabel):
        factory.destroy_knowledge_process(SPEED)
    network.add_source(SPEED, Sort("speed"))
    with pytest.raises(UnknownLabel):
        factory.destroy_knowledge_process(SPEED)
    factory.destroy_knowledge_process(POS)


def test_what_was_taken_away_otherwise_can_be_destroyed_no_more_and_made_again(factory: ProcessFactory) -> None:
    factory.create_knowledge_process(POS, "feed")
    factory._network.remove(POS)
    with pytest.raises(UnknownLabel):
        factory.destroy_knowledge_process(POS)
    factory.create_knowledge_process(POS, "feed")
    factory.destroy_knowledge_process(POS)


def test_what_cannot_be_made_is_refused_and_leaves_nothing(factory: ProcessFactory) -> None:
    factory.create_knowledge_process(POS, "feed")
    before = factory._network.labels()
    with pytest.raises(UnknownPrototype):
        factory.create_knowledge_process(SPEED, "Spede", [Input(POS)])
    for inputs in ([], [Input(POS)] * 2):
        with pytest.raises(WrongNumberOfInputs, match="SpeedEst takes 1 streams"):
            factory.create_knowledge_process(SPEED, "SpeedEst", inputs)
    with pytest.raises(WrongNumberOfInputs, match="feed takes 0 streams"):
        factory.create_knowledge_process(SPEED, "feed", [Input(POS)])
    with pytest.raises(LabelAlreadyExists):
        factory.create_knowledge_process(POS, "SpeedEst", [Input(SPEED)])
    for name, inputs, text in (
        ("feed", [], "max delay 5"),
        ("SpeedEst", [Input(POS)], "sample every 5, use linear"),
        ("gps", [], "strict order"),
    ):
        with pytest.raises(PolicyNotSupported, match=name):
            factory.create_knowledge_process(SPEED, name, inputs, policy(text))
    picky = UnitPrototype("Picky", "a", ("b",), lambda: of_values(abs), supports=lambda wanted: wanted.order == "any")
    factory.add_prototype(picky)
    with pytest.raises(PolicyNotSupported, match="Picky"):
        factory.create_knowledge_process(SPEED, "Picky", [Input(POS)], policy("strict order"))
    assert factory._network.labels() == before
    assert factory._network.generator(POS).subscriptions == ()


def test_an_output_policy_is_kept_by_the_process(factory: ProcessFactory) -> None:
    network = factory._network
    factory.create_knowledge_process(POS, "feed")
    factory.create_knowledge_process(SPEED, "SpeedEst", [Input(POS)], policy("sample every 20us, from 0 to oo"))
    got: list[Sample] = []
    network.connect(SPEED, Policy(), got.append)
    for t in (10, 20, 30, 40, 20):
        network.push(POS, t, t, t + 1)
    assert [s.valid_us for s in got] == [20, 40]
    assert network.generator(SPEED).history.get_size() == 2


def test_a_source_that_is_read_is_made_like_any_other(factory: ProcessFactory) -> None:
    network = factory._network
    factory.create_knowledge_process(POS, "gps")
    factory.create_knowledge_process(SPEED, "SpeedEst", [Input(POS)])
    got: list[Sample] = []
    network.connect(SPEED, Policy(), got.append)
    while network.deadline_us <= 25:
        network.on_time(25)
    assert [s.value for s in got] == [0, 20, 40]


def test_values_of_sorts_that_are_known_are_checked_and_others_are_not() -> None:
    @value_unit("place", "any", name="Place")
    def place(value):
        return value

    (prototype,) = prototypes_in([place])
    for sorts, passed in (({}, 3), ({"place": Sort("place", (Field("north_m", "m"), Field("east_m", "m")))}, 1)):
        network = Network()
        factory = ProcessFactory(network, sorts)
        factory.add_prototype(prototype)
        network.add_source(POS, Sort("any", is_open=True))
        factory.create_knowledge_process(SPEED, "Place", [Input(POS)])
        got: list[Sample] = []
        network.connect(SPEED, Policy(), got.append)
        for t, value in enumerate([(1.0, 2.0), 3.0, frozenset({"a"})]):
            network.push(POS, t, value, t)
        assert len(got) == passed


def test_the_operations_of_a_stream_generator() -> None:
    """5.3.2: what is held can be asked in each of these ways, and what is not is an exception."""
    network = Network(history=3)
    generator = network.add_source(POS, Sort("number"))
    history = network.snapshot(POS)
    for ask in (history.get_latest, history.get_latest_vtime, lambda: history.get_nth_latest(0)):
        with pytest.raises(ValueNotAvailable):
            ask()
    for t, valid_us in enumerate([10, 40, 20, 30], 1):
        network.push(POS, valid_us, t, t)
    assert history.get_size() == 3
    assert history.get_latest().valid_us == 30
    assert history.get_latest_vtime().valid_us == 40
    assert history.get_nth_latest(2).valid_us == 40
    assert [s.valid_us for s in history.get_slice(0, 1)] == [40, 20]
    assert [s.valid_us for s in history.get_between(20, 30)] == [20, 30]
    assert history.get_closest_at_or_before(35).valid_us == 30
    with pytest.raises(ValueNotAvailable):
        history.get_closest_at_or_before(19)
    with pytest.raises(ValueNotAvailable):
        history.get_nth_latest(3)
    with pytest.raises(ValueNotAvailable):
        history.get_slice(1, 3)
    assert generator.since_us == 11, "10 was forgotten"
    history.reset()
    assert history.get_size() == 0
    with pytest.raises(UnknownLabel):
        network.snapshot(SPEED)


def test_what_another_put_in_the_place_of_what_was_made_is_not_destroyed(factory: ProcessFactory) -> None:
    factory.create_knowledge_process(POS, "feed")
    factory._network.remove(POS)
    factory._network.add_source(POS, Sort("pos"))
    with pytest.raises(UnknownLabel):
        factory.destroy_knowledge_process(POS)
    assert factory._network.has(POS)
