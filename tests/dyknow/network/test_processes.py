"""Processes on demand: the same as if everything were always computed, and nothing else computed (3.3, 5.4)."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import Label, Network, Policy, Sample, Sort, ValueNotAvailable, of_values, source
from dyknow.model.errors import SortError, TooEarly
from dyknow.model.values import Field
from dyknow.network.process import Input
from dyknow.network.processes import SourceReader
from dyknow.network.prototypes import UnitPrototype, prototypes_in
from dyknow.network.refinement import RefinementProcess
from tests.dyknow.networks import (
    ANY,
    NUMBER,
    Counted,
    arrivals,
    compute,
    doubled,
    feed,
    invariants,
    joined,
    label,
    pass_time,
    refine,
    remembering,
    state_of,
    stateful,
    stateless,
    times,
)
from tests.satisfaction import satisfied
from tests.strategies import definition, policies


def lazy(sources=1, history=100):
    network = Network(history)
    for i in range(sources):
        network.add_source(label(i), ANY)
    return network


@st.composite
def chains(draw, policies=stateless):
    """Node 0 is a source; every other takes an earlier one, under a policy."""
    return [(draw(st.integers(0, i)), Policy.parse(draw(policies))) for i in range(draw(st.integers(1, 4)))]


@st.composite
def clients(draw, nodes, moments):
    """(node, policy, subscribes before event .., cancels before event ..)."""
    from_at = draw(st.integers(0, moments))
    return draw(st.integers(0, nodes)), draw(policies()), from_at, draw(st.none() | st.integers(from_at, moments))


def serve(network, events, wanted, forgotten=()):
    """What each client gets; `forgotten`: (before event .., node) of histories that a client has forgotten."""
    got = [[] for _ in wanted]
    streams = {}
    for at, event in enumerate([*events, None]):
        if event is not None:
            pass_time(network, event[3])
        for node in (node for before, node in forgotten if before == at):
            network.generator(label(node)).history.forget()
            assert network.generator(label(node)).history.get_size() == 0
        for i, (node, policy, from_at, to_at) in enumerate(wanted):
            if from_at == at:
                streams[i] = network.connect(label(node), policy, got[i].append)
            if to_at == at:
                streams[i].cancel()
        if event is not None:
            network.push(label(event[0]), Sample(event[3], event[1], event[2]))
    pass_time(network, 2_000)
    return [times(one) for one in got]


@definition
@given(st.data())
def test_on_demand_every_client_gets_what_it_would_get_if_everything_were_always_computed(data) -> None:
    chain, events = data.draw(chains()), data.draw(arrivals(1))
    wanted = data.draw(st.lists(clients(len(chain), len(events)), max_size=4))
    eager, network = lazy(), lazy()
    for i, (upon, policy) in enumerate(chain, 1):
        compute(eager, i, of_values(doubled), upon, policy)
        refine(network, i, Counted().prototype, [(upon, policy)])
    assert serve(network, events, wanted) == serve(eager, events, wanted)
    invariants(network)


@given(st.data())
def test_who_has_histories_forgotten_takes_no_sample_from_any_client(data) -> None:
    chain, events = data.draw(chains()), data.draw(arrivals(1))
    wanted = data.draw(st.lists(clients(len(chain), len(events)), min_size=1, max_size=4))
    moments = st.tuples(st.integers(0, len(events)), st.integers(0, len(chain)))
    plain, robbed = lazy(), lazy()
    for network in (plain, robbed):
        for i, (upon, policy) in enumerate(chain, 1):
            refine(network, i, Counted().prototype, [(upon, policy)])
    assert serve(robbed, events, wanted, data.draw(st.lists(moments, max_size=8))) == serve(plain, events, wanted)
    invariants(robbed)


def test_a_stream_that_would_begin_in_what_is_forgotten_is_refused() -> None:
    network = lazy()
    refine(network, 1, Counted().prototype, [(0, Policy())])
    network.connect(label(1), Policy(), lambda _: None)
    feed(network, [(0, t, t, t) for t in range(10, 60, 10)])
    assert network.generator(label(1)).history.forget() == 5
    with pytest.raises(TooEarly, match="51"):
        network.connect(label(1), Policy(), lambda _: None, from_us=30)
    feed(network, [(0, 60, 60, 60)])
    stream = network.connect(label(1), Policy(), lambda _: None, from_us=51)
    assert [s.valid_us for s in stream.take_backlog()] == [60]


@definition
@given(st.data())
def test_nothing_is_computed_that_nobody_asked_for(data) -> None:
    """Of unconstrained inputs: while all ask for samples on grids, only what lies on one of their grids' union."""
    events, counted, network = data.draw(arrivals(1)), [Counted(), Counted()], lazy()
    refine(network, 1, counted[0].prototype, [(0, Policy())])
    refine(network, 2, counted[1].prototype, [(1, Policy())])
    half = len(events) // 2
    feed(network, events[:half])
    assert not counted[0].seen
    period_us = data.draw(st.sampled_from([20, 40, 60]))
    got = []
    policy = Policy(change="sample", sample_us=period_us, from_us=0, to_us=None)
    stream = network.connect(label(2), policy, got.append)
    feed(network, events[half:])
    on_grid = [valid_us for _, valid_us, _, _ in events[half:] if valid_us % period_us == 0]
    assert counted[0].seen == on_grid
    assert counted[1].seen == on_grid
    before = len(counted[0].seen)
    stream.cancel()
    last_us = network.now_us
    network.push(label(0), Sample(last_us + 1, 0, 1))
    assert len(counted[0].seen) == before
    invariants(network)


def test_a_faster_subscription_raises_what_is_asked_for_up_the_chain_and_ending_it_lowers_it() -> None:
    network, units = lazy(), [Counted() for _ in range(3)]
    for i, unit in enumerate(units, 1):
        refine(network, i, unit.prototype, [(i - 1, Policy())])
    slow = network.connect(label(3), Policy.parse("sample every 100us, from 0 to oo"), lambda _: None)
    grids = [network.generator(label(i)).wanted for i in range(4)]
    assert [grid.period_us for grid in grids if grid] == [100] * 4
    fast = network.connect(label(3), Policy.parse("sample every 40us, from 0 to oo"), lambda _: None)
    assert [network.generator(label(i)).wanted.period_us for i in range(4)] == [20] * 4
    everything = network.connect(label(2), Policy(), lambda _: None)
    assert [network.generator(label(i)).wanted for i in range(3)] == [None] * 3
    assert network.generator(label(3)).wanted.period_us == 20
    everything.cancel()
    fast.cancel()
    assert [network.generator(label(i)).wanted.period_us for i in range(4)] == [100] * 4
    slow.cancel()
    invariants(network)
    assert network.generator(label(0)).subscriptions == ()


def test_a_grid_whose_place_only_the_first_sample_says_is_asked_for_once_it_is_known() -> None:
    network, unit = lazy(), Counted()
    refine(network, 1, unit.prototype, [(0, Policy())])
    got: list[Sample] = []
    network.connect(label(1), Policy.parse("sample every 100us, max delay 50us"), got.append)
    feed(network, [(0, 0, 1, 60), (0, 30, 2, 61), (0, 70, 3, 71), (0, 130, 4, 131), (0, 140, 5, 141)])
    assert [s.valid_us for s in got] == [30, 130], "the one that came too late says nothing of the grid"
    assert unit.seen == [0, 30, 130]


# Streams that begin in the past


@st.composite
def nets(draw):
    """Sources 0 and 1, then units of one or two inputs, with a memory or without.

    Two inputs come from different sources: what one sample brings by two ways comes at one instant, in no known order.
    """
    found = []
    come_from = [{0}, {1}]
    for i in range(2, 2 + draw(st.integers(1, 4))):
        taken = [draw(st.integers(0, i - 1))]
        others = [j for j in range(i) if not come_from[j] & come_from[taken[0]]]
        if others and draw(st.booleans()):
            taken.append(draw(st.sampled_from(others)))
        come_from.append(set().union(*(come_from[j] for j in taken)))
        inputs = [(j, Policy.parse(draw(stateful))) for j in taken]
        found.append((draw(st.sampled_from([joined, remembering])), inputs))
    return found


def build(net, history=1000):
    network = lazy(2, history)
    for i, (unit, inputs) in enumerate(net, 2):
        refine(network, i, unit(len(inputs)), inputs)
    return network


@given(nets(), arrivals(), st.integers(0, 30), st.integers(0, 300), st.data())
def test_a_stream_that_begins_in_the_past_is_the_one_that_had_been_there(net, events, at, from_us, data) -> None:
    past, later = events[:at], events[at:]
    node, wanted = len(net) + 1, Policy.parse(data.draw(stateful))
    there = build(net)
    expected: list[Sample] = []
    there.connect(label(node), wanted, expected.append)
    feed(there, [event for event in past if event[1] >= from_us])
    feed(there, later)

    network = build(net)
    feed(network, past)
    got: list[Sample] = []
    stream = network.connect(label(node), wanted, got.append, from_us=from_us)
    got += stream.take_backlog()
    feed(network, later)
    assert times(got) == times(expected)
    invariants(network)
    stream.cancel()
    invariants(network)


@given(arrivals(1), st.integers(0, 30), st.integers(0, 20), st.sampled_from([10, 20, 30]))
def test_what_was_owed_in_the_past_is_owed_at_its_time(events, at, from_at, delay_us) -> None:
    from_us = from_at * 10
    text = f"from {from_us}us to oo, sample every 20us, max delay {delay_us}us, use most recent"
    networks = [lazy(), lazy()]
    for network in networks:
        refine(network, 1, remembering(1), [(0, Policy.parse(text))])
    past, later = [event for event in events[:at] if event[1] >= from_us], events[at:]
    got: list[list[Sample]] = [[], []]
    networks[0].connect(label(1), Policy(), got[0].append)
    for network in networks:
        feed(network, past)
    stream = networks[1].connect(label(1), Policy(), got[1].append, from_us=from_us)
    got[1] += stream.take_backlog()
    for network in networks:
        feed(network, later)
        pass_time(network, 700)
    if past:
        assert times(got[1]) == times(got[0])
    else:
        assert {s.valid_us for s in got[1]} <= {s.valid_us for s in got[0]}, "nobody waited for what had never begun"


@given(arrivals(1, max_size=40), st.integers(1, 8), st.integers(0, 400), st.sampled_from([1, 2]), st.booleans())
def test_what_is_not_held_any_more_is_refused_with_the_earliest_time_that_can_be(
    events, capacity, from_us, node, warm
) -> None:
    network = lazy(1, capacity)
    prototype = UnitPrototype("Warm", "any", ("any",), lambda: of_values(doubled), history_us=50 if warm else 0)
    refine(network, 1, prototype, [(0, Policy())])
    refine(network, 2, remembering(1), [(1, Policy())])
    feed(network, events)
    before = state_of(network)
    forgotten = [valid_us for _, valid_us, _, _ in events[: max(0, len(events) - capacity)]]
    earliest_us = max(forgotten) + 1 if forgotten else None
    if earliest_us is None or from_us >= earliest_us:
        network.connect(label(node), Policy(), lambda _: None, from_us=from_us).cancel()
    else:
        with pytest.raises(ValueNotAvailable, match=f"earliest possible time is {earliest_us} us"):
            network.connect(label(node), Policy(), lambda _: None, from_us=from_us)
        assert state_of(network) == before
        network.connect(label(node), Policy(), lambda _: None, from_us=earliest_us).cancel()
    assert state_of(network) == before
    invariants(network)


def test_a_process_that_brings_more_than_is_held_is_refused_and_leaves_nothing() -> None:
    """Two inputs bring twice as many samples as a history holds."""
    network = lazy(2, 10)
    refine(network, 2, joined(2), [(0, Policy()), (1, Policy())])
    refine(network, 3, joined(1), [(2, Policy())])
    feed(network, [(i % 2, 10 * i, i, 10 * i) for i in range(20)])
    before = state_of(network)
    with pytest.raises(ValueNotAvailable, match="earliest possible time is 91 us"):
        network.connect(label(3), Policy(), lambda _: None, from_us=0)
    assert state_of(network) == before
    stream = network.connect(label(3), Policy(), lambda _: None, from_us=91)
    assert [s.valid_us for s in stream.take_backlog()] == list(range(110, 200, 10))
    assert network.snapshot(label(2)).get_size() == 9


def test_a_process_that_runs_already_knows_only_what_came_since() -> None:
    network = lazy()
    refine(network, 1, remembering(1), [(0, Policy())])
    feed(network, [(0, 10, 1, 10)])
    first = network.connect(label(1), Policy(), lambda _: None)
    feed(network, [(0, 20, 1, 20), (0, 30, 1, 30)])
    with pytest.raises(ValueNotAvailable, match="earliest possible time is 11 us"):
        network.connect(label(1), Policy(), lambda _: None, from_us=10)
    stream = network.connect(label(1), Policy(), lambda _: None, from_us=11)
    assert [s.value for s in stream.take_backlog()] == [1, 2], "of the one process that there is"
    first.cancel()
    assert network.process(label(1)).running  # type: ignore[union-attr]


def test_what_was_not_computed_because_nobody_wanted_it_is_no_past_to_begin_in() -> None:
    network, unit = lazy(), Counted()
    refine(network, 1, unit.prototype, [(0, Policy())])
    network.connect(label(1), Policy.parse("sample every 100us, from 0 to oo"), lambda _: None)
    feed(network, [(0, t, t, t) for t in range(0, 300, 50)])
    with pytest.raises(ValueNotAvailable, match="earliest possible time is 251 us"):
        network.connect(label(1), Policy(), lambda _: None, from_us=100)
    got: list[Sample] = []
    network.connect(label(1), Policy(), got.append)
    feed(network, [(0, t, t, t) for t in range(300, 500, 50)])
    with pytest.raises(ValueNotAvailable):
        network.connect(label(1), Policy(), lambda _: None, from_us=200)
    stream = network.connect(label(1), Policy(), lambda _: None, from_us=251)
    assert [s.valid_us for s in stream.take_backlog()] == [300, 350, 400, 450]


def test_a_unit_gets_the_history_that_it_needs() -> None:
    network = lazy()
    unit = UnitPrototype("Warm", "any", ("any",), remembering(1).make, history_us=25)
    refine(network, 1, unit, [(0, Policy())])
    feed(network, [(0, t, 1, t) for t in range(10, 60, 10)])
    got: list[Sample] = []
    network.connect(label(1), Policy(), got.append)
    feed(network, [(0, 60, 1, 60)])
    assert times(got) == [(60, 60, 4)], "25 us before 50 are 30, 40 and 50"
    past = lazy()
    refine(past, 1, unit, [(0, Policy())])
    feed(past, [(0, t, 1, t) for t in range(10, 60, 10)])
    assert times(past.connect(label(1), Policy(), got.append, from_us=50).take_backlog()) == [(50, 50, 3)]


# Replacing, querying, failing


@given(st.lists(st.sampled_from(["push", "push", "remove", "add", "replace", "tie"]), max_size=30))
def test_generators_come_go_and_are_replaced_under_a_client(steps) -> None:
    """Order and grid go on, available times increase, and the client hears of every link."""
    network = lazy()
    refine(network, 1, joined(1), [(0, Policy())])
    got: list[Sample] = []
    gridded: list[Sample] = []
    links: list[bool] = []
    network.connect(label(1), Policy(), got.append, links.append)
    network.connect(label(1), Policy.parse("sample every 20us"), gridded.append)
    there, now_us, expected = True, 0, [True]
    pushed = []
    for step in steps:
        if step in {"push", "tie"}:
            now_us += 10 if step == "push" else 0
            network.push(label(0), Sample(now_us, now_us, 1))
            if there:
                pushed.append(now_us)
        elif step == "remove" and there:
            network.remove(label(1))
            there = False
            expected.append(False)
        elif step == "add" and not there:
            refine(network, 1, joined(1), [(0, Policy())])
            there = True
            expected.append(True)
        elif step == "replace" and there:
            unit = RefinementProcess(remembering(1), [Input(label(0), Policy())])
            network.replace_process(label(1), ANY, unit)
    assert links == expected
    assert [s.valid_us for s in got] == pushed
    assert all(a.available_us < b.available_us for a, b in itertools.pairwise(got))
    assert satisfied(Policy.parse("sample every 20us"), gridded)
    if there:
        invariants(network)


def test_what_a_replaced_process_made_stays() -> None:
    network = lazy()
    refine(network, 1, joined(1), [(0, Policy())])
    got: list[Sample] = []
    network.connect(label(1), Policy(), got.append)
    for _ in range(3):
        network.push(label(0), Sample(5, 5, 1))
    assert [s.available_us for s in got] == [5, 6, 7]
    network.replace_process(label(1), ANY, RefinementProcess(remembering(1), [Input(label(0))]))
    network.push(label(0), Sample(6, 6, 1))
    assert [s.available_us for s in got] == [5, 6, 7, 8]
    assert network.snapshot(label(1)).get_size() == 4
    network.replace_process(label(1), ANY, None)
    network.push(label(1), Sample(9, 7, 7))
    assert got[-1].value == 7
    with pytest.raises(SortError, match="cannot replace"):
        network.replace_process(label(1), NUMBER, None)


def test_what_rests_can_be_asked_and_rests_again() -> None:
    network = lazy()
    refine(network, 1, joined(1), [(0, Policy())])
    refine(network, 2, remembering(1), [(1, Policy())])
    feed(network, [(0, t, 1, t) for t in range(10, 50, 10)])
    before = state_of(network)
    history = network.snapshot(label(2))
    assert [s.value for s in history.get_between(0, 100)] == [3, 6, 9, 12]
    assert history.most_recent_at(25, 100).value == 6
    assert history.get_closest_at_or_before(39).valid_us == 30
    assert state_of(network) == before
    network.push(label(0), Sample(50, 50, 1))
    assert history.get_size() == 4, "a snapshot does not go on"


POS = Sort("pos", (Field("latitude_deg", "deg"), Field("altitude_m", "m")))
UAV = Label("pos", ("uav1",))
ALTITUDE = Label("pos.altitude_m", ("uav1",))


def test_attributes_come_with_those_who_want_them_and_go_with_them() -> None:
    network = Network()
    got: list[Sample] = []
    early = network.connect(ALTITUDE, Policy(), got.append)
    assert not early.linked
    network.add_source(UAV, POS)
    assert early.linked
    assert network.is_implicit(ALTITUDE)
    network.push(UAV, Sample(6, 5, (58.0, 120.5)))
    assert times(got) == [(6, 5, 120.5)]
    early.cancel()
    assert state_of(network)["labels"] == (UAV,)
    assert state_of(network)["attributes"] == {}
    assert network.snapshot(ALTITUDE).get_latest().value == 120.5
    assert network.labels() == (UAV,)
    with pytest.raises(ValueNotAvailable):
        small = Network(history=1)
        small.add_source(UAV, POS)
        for t in range(200):
            small.push(UAV, Sample(t, t, (0.0, 0.0)))
        small.connect(ALTITUDE, Policy(), got.append, from_us=0)
    assert small.labels() == (UAV,)
    again = network.connect(ALTITUDE, Policy(), got.append, from_us=0)
    assert [s.value for s in again.take_backlog()] == [120.5]
    network.remove(UAV)
    assert not again.linked
    assert network.labels() == ()
    network.add_source(UAV, POS)
    assert again.linked
    other = network.connect(Label("pos.speed", ("uav1",)), Policy(), got.append)
    assert not other.linked
    other.cancel()
    again.cancel()
    assert state_of(network)["waiting"] == {}


def test_a_chain_over_an_attribute_begins_in_the_past_too() -> None:
    network = Network()
    network.add_source(UAV, POS)
    network.add_process(label(1), ANY, RefinementProcess(remembering(1), [Input(ALTITUDE)]))
    for t in range(3):
        network.push(UAV, Sample(t, t, (0.0, 2.0)))
    stream = network.connect(label(1), Policy(), lambda _: None, from_us=1)
    assert [s.value for s in stream.take_backlog()] == [2.0, 4.0]
    stream.cancel()
    assert network.labels() == (UAV, label(1))


def raising(value):
    if value == 3:
        raise ZeroDivisionError("three")
    return "text" if value == 4 else value


def test_a_unit_that_raises_or_makes_what_is_not_of_its_sort_ends_nothing() -> None:
    network, faults = lazy(), []
    network.on_fault = lambda name, said: faults.append((name, said))
    unit = UnitPrototype("Raising", "pos", ("any",), lambda: of_values(raising), samplewise=True)
    network.add_process(label(1), POS, RefinementProcess(unit, [Input(label(0))]))
    got: list[Sample] = []
    network.connect(label(1), Policy(), got.append)
    for t, value in enumerate([(1.0, 2.0), 3, 4, (5.0, 6.0)]):
        network.push(label(0), Sample(t, t, value))
    assert [s.value for s in got] == [(1.0, 2.0), (5.0, 6.0)]
    assert [name for name, _ in faults] == [label(1)] * 2
    assert "ZeroDivisionError" in faults[0][1]
    assert "not of its sort" in faults[1][1]

    def broken():
        raise RuntimeError("no camera")

    network.add_process(
        label(2), ANY, RefinementProcess(UnitPrototype("Broken", "any", ("any",), broken), [Input(label(0))])
    )
    network.connect(label(2), Policy(), got.append)
    network.push(label(0), Sample(9, 9, 1))
    assert "Broken cannot be made" in faults[2][1]


def reading(*samples):
    @source("any", "Read")
    def read(_from_us):
        yield from samples

    (prototype,) = prototypes_in([read])
    return SourceReader(prototype)


def test_a_source_is_read_while_somebody_wants_it() -> None:
    network, begun = Network(), []

    @source("any")
    def ticking(from_us):
        begun.append(from_us)
        for t in range(from_us - from_us % 10 + 10, 10_000, 10):
            yield t, t

    (prototype,) = prototypes_in([ticking])
    network.add_process(label(0), ANY, SourceReader(prototype))
    network.on_time(100)
    assert not begun
    got: list[Sample] = []
    stream = network.connect(label(0), Policy(), got.append)
    pass_time(network, 131)
    assert times(got) == [(110, 110, 110), (120, 120, 120), (130, 130, 130)]
    stream.cancel()
    assert network.deadline_us is None
    assert not network._timed
    with pytest.raises(ValueNotAvailable, match="earliest possible time is 131 us"):
        network.connect(label(0), Policy(), got.append, from_us=100)
    network.connect(label(0), Policy(), got.append, from_us=131)
    assert begun == [100, 131]


@pytest.mark.parametrize(
    ("samples", "said"),
    [
        ([(1, 1), (0, 2)], "went back from 1 to 0 us"),
        ([(1, 1), ("x", 2)], "ValueError"),
        ([(1, 1), 7], "TypeError"),
        ([(1, 1), (None, 7)], "TypeError"),
    ],
)
def test_a_source_that_goes_wrong_is_read_no_more(samples, said) -> None:
    network, faults = Network(), []
    network.on_fault = lambda _name, what: faults.append(what)
    network.add_process(label(0), ANY, reading(*samples))
    got: list[Sample] = []
    network.connect(label(0), Policy(), got.append)
    network.on_time(10)
    assert [s.value for s in got] == [1]
    assert said in faults[0]
    assert network.deadline_us is None


def test_a_source_without_end_lets_others_have_their_turn() -> None:
    network = Network(history=10)

    @source("any", "Flood")
    def flood(_from_us):
        while True:
            yield 0, 0

    network.add_process(label(0), ANY, SourceReader(prototypes_in([flood])[0]))
    got: list[Sample] = []
    network.connect(label(0), Policy(), got.append)
    network.on_time(1)
    assert 0 < len(got) < 10_000
    assert network.deadline_us == 0, "there is more to do at once"


def test_another_unit_does_the_work_from_now_on() -> None:
    network = lazy()
    process = refine(network, 1, joined(1), [(0, Policy())])
    got: list[Sample] = []
    network.connect(label(1), Policy.parse("sample every 20us, from 0 to oo"), got.append)
    feed(network, [(0, t, 1, t) for t in (0, 20)])
    cheap = Counted()
    process.exchange(cheap.prototype)
    assert network.generator(label(0)).wanted.period_us == 20  # type: ignore[union-attr]
    feed(network, [(0, t, 1, t) for t in (30, 40)])
    process.exchange(joined(1))
    assert network.generator(label(0)).wanted is None
    feed(network, [(0, t, 1, t) for t in (50, 60)])
    assert [s.value for s in got] == [3, 3, 2, 3]
    assert cheap.seen == [40]
