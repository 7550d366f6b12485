"""Mediation and configuration against a direct model: who is a member when, and what of them is passed on (3.3.3, 3.3.4)."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import NO_VALUE, Label, Network, Policy, Sample, UnitPrototype, ValueNotAvailable, of_values
from dyknow.model.errors import SortError
from dyknow.model.members import MAX_MEMBERS, members_of
from dyknow.network.mediation import Configuration, Mediation
from dyknow.network.process import Input
from dyknow.network.refinement import RefinementProcess
from tests.dyknow.networks import ANY, NUMBER, Counted, invariants, joined, pass_time, policy, state_of, times
from tests.strategies import definition, rows

IDS, OUT = Label("ids"), Label("out")
CARS = ("a", "b", "c")


def pos(car):
    return Label("pos", (car,))


def network_of_cars(history=1000):
    network = Network(history)
    network.add_source(IDS, ANY)
    for car in CARS:
        network.add_source(pos(car), ANY)
    return network


def mediate(network, single, domain=Policy(), member=Policy()):  # noqa: B008
    network.add_process(OUT, ANY, Mediation(Input(IDS, domain), lambda car: Input(pos(car), member), single=single))


sets = st.frozensets(st.sampled_from(CARS)) | st.sampled_from([*CARS, ("c", "a"), NO_VALUE])


@st.composite
def happenings(draw, sets=sets):
    now_us, found = 0, []
    for step, delay, what in rows(draw, 30, 3):
        now_us += 5 + step % 16
        valid_us = max(0, now_us - delay % 31)
        named = what % 4 == 0
        found.append(
            (IDS, valid_us, draw(sets), now_us) if named else (pos(CARS[what % 4 - 1]), valid_us, now_us, now_us)
        )
    return found


def feed(network, events):
    for name, valid_us, value, now_us in events:
        pass_time(network, now_us)
        network.push(name, Sample(now_us, valid_us, value))


def members(value, single, before):
    """The direct model of who is a member after a value."""
    try:
        named = members_of(value)
    except SortError:
        return before
    return () if single and len(named) != 1 else named


def model(events, single):
    """All that is ever passed on: figures 3.4 to 3.7 by hand, for members under no constraint."""
    current, found = (), []
    for name, valid_us, value, now_us in events:
        if name == IDS:
            current = members(value, single, current)
        elif name.objects[0] in current:
            found.append((now_us, valid_us, value))
    return found


@definition
@given(happenings(), st.booleans(), st.integers(0, 30))
def test_select_and_merge_pass_on_what_those_who_are_members_bring(events, single, at) -> None:
    """Whenever somebody subscribes: what the stream of members said last counts from then on."""
    network, got = network_of_cars(), []
    mediate(network, single)
    feed(network, events[:at])
    stream = network.connect(OUT, Policy(), got.append)
    feed(network, events[at:])
    assert times(got) == [one for one in model(events, single) if at < len(events) and one[0] >= events[at][3]]
    invariants(network)
    stream.cancel()
    assert all(network.generator(name).subscriptions == () for name in network.labels())


@given(
    happenings(sets | st.sampled_from([7.5, ("a", 7.5)])),
    st.booleans(),
    st.integers(0, 30),
    st.integers(0, 30),
    st.sampled_from(["", "sample every 10us", "strict order", "monotone order, max delay 20us", "any change"]),
    st.sampled_from(["", "monotone order", "max delay 20us"]),
)
def test_mediation_that_begins_in_the_past_is_what_had_been_there(events, single, at, from_us, member, domain) -> None:
    from_us *= 10
    there, network = network_of_cars(), network_of_cars()
    expected: list[Sample] = []
    got: list[Sample] = []
    for each in (there, network):
        mediate(each, single, policy(domain), policy(member))
    there.connect(OUT, Policy(), expected.append)
    feed(there, events)
    feed(network, events[:at])
    stream = network.connect(OUT, Policy(), got.append, from_us=from_us)
    got += stream.take_backlog()
    feed(network, events[at:])
    past_us = events[at - 1][3] if 0 < at <= len(events) else events[-1][3] if events and at else -1
    assert times(got) == [s for s in times(expected) if s[1] >= from_us or s[0] > past_us]
    invariants(network)


def test_a_past_of_members_that_is_not_held_is_refused() -> None:
    network = network_of_cars(history=5)
    mediate(network, single=False)
    network.push(IDS, Sample(0, 0, ("a", "b")))
    for t in range(100, 1200, 10):
        network.push(pos("a"), Sample(t, t, t))
    before = state_of(network)
    with pytest.raises(ValueNotAvailable, match="earliest possible time is 1141 us"):
        network.connect(OUT, Policy(), lambda _: None, from_us=100)
    assert state_of(network) == before
    stream = network.connect(OUT, Policy(), lambda _: None, from_us=1141)
    assert [s.valid_us for s in stream.take_backlog()] == [1150, 1160, 1170, 1180, 1190]


def test_members_and_their_streams_may_come_in_any_order() -> None:
    """The stream of members may be made later than what needs it, and by a process that rests until then."""
    network, got = Network(), []
    network.add_process(OUT, ANY, Mediation(Input(Label("made")), lambda car: Input(pos(car)), single=False))
    network.connect(OUT, Policy(), got.append)
    network.add_source(IDS, ANY)
    network.push(IDS, Sample(0, 0, ("a", "b")))
    same = UnitPrototype("Same", "any", ("any",), lambda: of_values(lambda named: named))
    network.add_process(Label("made"), ANY, RefinementProcess(same, [Input(IDS)]))
    assert list(network.process(OUT).members) == ["a", "b"]  # type: ignore[union-attr]
    network.add_source(pos("b"), ANY)
    network.push(pos("b"), Sample(1, 1, 1))
    assert times(got) == [(1, 1, 1)]


def test_only_what_is_asked_for_is_asked_of_the_members() -> None:
    network, units = network_of_cars(), {car: Counted() for car in CARS}
    for car, unit in units.items():
        network.add_process(Label("far", (car,)), ANY, RefinementProcess(unit.prototype, [Input(pos(car))]))
    network.add_process(OUT, ANY, Mediation(Input(IDS), lambda car: Input(Label("far", (car,))), single=False))
    network.push(IDS, Sample(0, 0, ("a",)))
    network.connect(OUT, policy("sample every 100us, from 0 to oo"), lambda _: None)
    network.push(IDS, Sample(1, 0, ("a", "b")))
    for t in range(50, 300, 50):
        for car in CARS:
            network.push(pos(car), Sample(t, t, t))
    assert [units[car].seen for car in CARS] == [[100, 200], [100, 200], []]


def test_what_is_not_of_the_sort_is_not_passed_on() -> None:
    network, got, faults = network_of_cars(), [], []
    network.on_fault = lambda _name, said: faults.append(said)
    network.add_process(OUT, NUMBER, Mediation(Input(IDS), lambda car: Input(pos(car)), single=False))
    network.push(IDS, Sample(0, 0, ("a",)))
    network.connect(OUT, Policy(), got.append)
    for t, value in enumerate([1.0, (2.0, 3.0), 4.0, float("nan")]):
        network.push(pos("a"), Sample(t, t, value))
    assert [s.value for s in got] == [1.0, 4.0]
    assert len(faults) == 2
    assert "not of the sort" in faults[0]


@pytest.mark.parametrize(
    ("value", "found"),
    [
        ("car1", ("car1",)),
        (7, ("7",)),
        (("b", "a", "b", 3), ("b", "a", "3")),
        (frozenset({"b", "a"}), ("a", "b")),
        (NO_VALUE, ()),
        ((), ()),
        ("from", ("from",)),
    ],
)
def test_a_value_names_objects(value, found) -> None:
    assert members_of(value) == found


HOSTILE = [
        True, 1.0, float("nan"), -1, 10**5000, -(10**5000), None, b"car", [], {"a": 1}, object(), "", " ", "a b", "a[b]", "1a",
        "with", "true", "x" * 60_000, ("a", ("b",)), ("a", True), tuple(range(MAX_MEMBERS + 1)), "a\n", "ä", frozenset({1.5}),
]  # fmt: skip


@pytest.mark.parametrize("value", HOSTILE, ids=map(str, range(len(HOSTILE))))
def test_what_names_no_object_is_told_and_changes_nothing(value) -> None:
    with pytest.raises(SortError) as told:
        members_of(value)
    assert len(str(told.value)) < 200
    network, faults = network_of_cars(), []
    network.on_fault = lambda name, said: faults.append((name, said))
    mediate(network, single=False)
    network.push(IDS, Sample(0, 0, ("a",)))
    network.connect(OUT, Policy(), lambda _: None)
    held: set[str] = set()
    configuration = Configuration(network, Input(IDS), held.add, held.discard, members_of)
    network.push(IDS, Sample(1, 1, value))
    assert [name for name, _ in faults] == [OUT, IDS]
    assert list(network.process(OUT).members) == ["a"]  # type: ignore[union-attr]
    assert list(configuration.members) == ["a"]
    assert held == {"a"}


@definition
@given(happenings(), st.integers(0, 30))
def test_configuration_creates_and_removes_what_belongs_to_the_members(events, at) -> None:
    network, held = network_of_cars(), set()

    def create(car):
        assert car not in held
        held.add(car)

    feed(network, events[:at])
    configuration = Configuration(network, Input(IDS), create, held.remove, members_of)
    feed(network, events[at:])
    current = ()
    for name, _, value, _ in events:
        if name == IDS:
            current = members(value, False, current)
    assert set(configuration.members) == held == set(current)
    configuration.cancel()
    assert not held
    assert network.generator(IDS).subscriptions == ()


def test_figures_3_6_and_3_7_select_follows_the_one_that_is_named() -> None:
    """One input at a time: when another car is tracked its positions come, and those of the first no more."""
    network, got = network_of_cars(), []
    mediate(network, single=True)
    network.connect(OUT, Policy(), got.append)
    feed(network, [(pos("a"), 5, "a0", 5), (IDS, 10, "a", 10), (pos("a"), 15, "a1", 15), (pos("b"), 16, "b0", 16)])
    feed(network, [(IDS, 20, "b", 20), (pos("a"), 25, "a2", 25), (pos("b"), 26, "b1", 26), (IDS, 30, NO_VALUE, 30)])
    feed(network, [(pos("b"), 35, "b2", 35), (IDS, 40, ("a", "b"), 40), (pos("a"), 45, "a3", 45)])
    assert [s.value for s in got] == ["a1", "b1"]


def test_select_tells_once_that_several_are_named_until_one_is_again() -> None:
    network, got, faults = network_of_cars(), [], []
    network.on_fault = lambda label, said: faults.append((label, said))
    mediate(network, single=True)
    network.connect(OUT, Policy(), got.append)
    feed(network, [(IDS, 10, ("a", "b"), 10), (IDS, 20, ("b", "c", "d"), 20), (pos("b"), 25, "b1", 25)])
    assert [label for label, _ in faults] == [OUT]
    assert "names 2 objects at once, so that none is selected" in faults[0][1]
    feed(network, [(IDS, 30, "b", 30), (pos("b"), 35, "b2", 35), (IDS, 40, ("a", "b"), 40)])
    assert [s.value for s in got] == ["b2"]
    assert len(faults) == 2


def test_merge_has_a_varying_set_of_inputs() -> None:
    network, got = network_of_cars(), []
    mediate(network, single=False)
    network.connect(OUT, Policy(), got.append)
    feed(
        network,
        [(IDS, 10, ("a", "b"), 10), (pos("a"), 15, "a1", 15), (pos("b"), 16, "b1", 16), (pos("c"), 17, "c1", 17)],
    )
    feed(
        network,
        [(IDS, 20, ("b", "c"), 20), (pos("a"), 25, "a2", 25), (pos("b"), 26, "b2", 26), (pos("c"), 27, "c2", 27)],
    )
    assert [s.value for s in got] == ["a1", "b1", "b2", "c2"]


def test_figures_3_4_and_3_5_a_process_per_member_comes_and_goes_with_it() -> None:
    network, got = network_of_cars(), []

    def speed(car):
        return Label("speed", (car,))

    def create(car):
        network.add_process(speed(car), ANY, RefinementProcess(joined(1), [Input(pos(car))]))

    Configuration(network, Input(IDS), create, lambda car: network.remove(speed(car)), members_of)
    network.connect(speed("a"), Policy(), got.append)
    feed(network, [(pos("a"), 5, 1, 5), (IDS, 10, ("a",), 10), (pos("a"), 15, 2, 15), (IDS, 20, (), 20)])
    feed(network, [(pos("a"), 25, 3, 25), (IDS, 30, ("a", "b"), 30), (pos("a"), 35, 4, 35)])
    assert [s.value for s in got] == [6, 12]
    assert set(network.labels()) == {IDS, *map(pos, CARS), speed("a"), speed("b")}
