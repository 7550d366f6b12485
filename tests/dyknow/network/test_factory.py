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
from dyknow.model.errors import PolicyNotSupported, PrototypeExists, UnknownPrototype, WrongNumberOfInputs
from dyknow.model.values import Field
from dyknow.network.factory import Prototypes, process_of
from dyknow.network.process import Input
from dyknow.network.prototypes import Prototype, prototypes_in
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
def prototypes() -> Prototypes:
    return Prototypes([*prototypes_in([speed_est, gps]), SourcePrototype("feed", "pos")])


@pytest.fixture
def network() -> Network:
    network = Network()
    network.add_source(POS, Sort("pos"))
    return network


def create(network: Network, label: Label, prototype: Prototype | None, *more, sort: Sort | None = None) -> None:
    assert prototype is not None
    process = process_of(prototype, *more)
    assert process is not None
    network.add_process(label, sort or Sort(prototype.sort, is_open=True), process)


def test_prototypes_are_added_found_and_removed(prototypes: Prototypes) -> None:
    assert {each.name for each in prototypes.all()} == {"SpeedEst", "gps", "feed"}
    found = prototypes.find("gps")
    assert found is not None
    assert found.sort == "pos"
    with pytest.raises(PrototypeExists, match="'gps' exists already"):
        prototypes.add(SourcePrototype("gps", "other"))
    prototypes.remove("gps")
    assert prototypes.find("gps") is None
    with pytest.raises(UnknownPrototype, match=r"'gps'; there are SpeedEst, feed"):
        prototypes.remove("gps")


def test_a_process_outlives_its_prototype_and_goes_with_its_generator(prototypes: Prototypes, network: Network) -> None:
    create(network, SPEED, prototypes.find("SpeedEst"), [Input(POS)])
    got: list[Sample] = []
    network.connect(SPEED, Policy(), got.append)
    network.push(POS, Sample(3, 1, 2))
    assert times(got) == [(3, 1, 4)]
    prototypes.remove("SpeedEst")
    network.push(POS, Sample(4, 2, 3))
    assert len(got) == 2
    network.remove(SPEED)
    assert network.labels() == (POS,)
    assert network.generator(POS).subscriptions == ()
    with pytest.raises(UnknownLabel):
        network.remove(SPEED)


def test_what_cannot_be_made_is_refused_and_leaves_nothing(prototypes: Prototypes, network: Network) -> None:
    speed, feed = prototypes.find("SpeedEst"), prototypes.find("feed")
    for inputs in ([], [Input(POS)] * 2):
        with pytest.raises(WrongNumberOfInputs, match="SpeedEst takes 1 streams"):
            create(network, SPEED, speed, inputs)
    with pytest.raises(WrongNumberOfInputs, match="feed takes 0 streams"):
        create(network, SPEED, feed, [Input(POS)])
    with pytest.raises(LabelAlreadyExists):
        create(network, POS, speed, [Input(SPEED)])
    picky = UnitPrototype("Picky", "a", ("b",), lambda: of_values(abs), supports=lambda wanted: wanted.order == "any")
    prototypes.add(picky)
    for name, inputs, text in (
        ("feed", [], "max delay 5"),
        ("SpeedEst", [Input(POS)], "sample every 5, use linear"),
        ("gps", [], "strict order"),
        ("Picky", [Input(POS)], "strict order"),
    ):
        with pytest.raises(PolicyNotSupported, match=name):
            create(network, SPEED, prototypes.find(name), inputs, policy(text))
    assert network.labels() == (POS,)
    assert network.generator(POS).subscriptions == ()


def test_an_output_policy_is_kept_by_the_process(prototypes: Prototypes, network: Network) -> None:
    create(network, SPEED, prototypes.find("SpeedEst"), [Input(POS)], policy("sample every 20us, from 0 to oo"))
    got: list[Sample] = []
    network.connect(SPEED, Policy(), got.append)
    for t in (10, 20, 30, 40, 20):
        network.push(POS, Sample(t + 1, t, t))
    assert [s.valid_us for s in got] == [20, 40]
    assert network.generator(SPEED).history.get_size() == 2


def test_a_source_that_is_read_is_made_like_any_other(prototypes: Prototypes) -> None:
    network = Network()
    create(network, POS, prototypes.find("gps"))
    create(network, SPEED, prototypes.find("SpeedEst"), [Input(POS)])
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
    known = Sort("place", (Field("north_m", "m"), Field("east_m", "m")))
    for sort, passed in ((None, 3), (known, 1)):
        network = Network()
        network.add_source(POS, Sort("any", is_open=True))
        create(network, SPEED, prototype, [Input(POS)], sort=sort)
        got: list[Sample] = []
        network.connect(SPEED, Policy(), got.append)
        for t, value in enumerate([(1.0, 2.0), 3.0, frozenset({"a"})]):
            network.push(POS, Sample(t, t, value))
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
        network.push(POS, Sample(t, valid_us, t))
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
