"""Stream proxies: a stream at its client, whatever becomes of those who make it (5.2, 5.4.3, 10.7)."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import Network, Policy, PolicyAdapter, Sample
from dyknow.network.stream_proxy import StreamProxy
from dyknow.policies.sampling import Grid
from tests.dyknow.networks import ANY, Counted, feed, invariants, label, policy, refine, times
from tests.satisfaction import satisfied
from tests.strategies import gridded_streams, policies


def network_of_one():
    network = Network()
    network.add_source(label(0), ANY)
    return network


def test_a_proxy_waits_is_linked_and_told() -> None:
    network, links, got = Network(), [], []
    stream = network.connect(label(0), policy("sample every 20us"), got.append, links.append)
    assert not stream.linked
    network.add_source(label(0), ANY)
    feed(network, [(0, t, t, t) for t in range(10, 60, 10)])
    network.remove(label(0))
    network.add_source(label(0), ANY)
    feed(network, [(0, t, t, t) for t in range(60, 100, 10)])
    assert [s.valid_us for s in got] == [10, 30, 50, 70, 90], "the grid goes on"
    assert links == [True, False, True]
    stream.cancel()
    stream.cancel()
    network.remove(label(0))
    assert links == [True, False, True]
    assert not network._waiting


def test_a_waiting_proxy_that_is_cancelled_is_forgotten() -> None:
    network = Network()
    streams = [network.connect(label(0), Policy(), lambda _: None) for _ in range(3)]
    for stream in streams:
        stream.cancel()
    assert not network._waiting
    network.add_source(label(0), ANY)
    assert network.generator(label(0)).subscriptions == ()


def test_a_client_may_cancel_and_remove_while_it_is_told() -> None:
    network, got = network_of_one(), []
    streams = []

    def on_link(linked):
        if not linked:
            streams[0].cancel()

    streams.append(network.connect(label(0), Policy(), got.append, on_link))
    streams.append(network.connect(label(0), Policy(), lambda _: network.remove(label(0))))
    network.push(label(0), Sample(1, 1, 1))
    network.add_source(label(0), ANY)
    network.push(label(0), Sample(2, 2, 2))
    assert times(got) == [(1, 1, 1)]


def test_stretching_lengthens_the_sample_period_and_takes_it_back() -> None:
    network, unit, got = network_of_one(), Counted(), []
    refine(network, 1, unit.prototype, [(0, Policy())])
    stream = network.connect(label(1), policy("sample every 10us, from 0 to oo"), got.append)
    feed(network, [(0, t, t, t) for t in range(10, 50, 10)])
    stream.stretch(3)
    assert stream.stretched == 3
    assert stream.adapter.policy.sample_us == 30
    feed(network, [(0, t, t, t) for t in range(50, 130, 10)])
    stream.stretch(1)
    feed(network, [(0, t, t, t) for t in range(130, 150, 10)])
    assert [s.valid_us for s in got] == [10, 20, 30, 40, 60, 90, 120, 130, 140]
    assert unit.seen == [10, 20, 30, 40, 60, 90, 120, 130, 140], "what is not asked for is not computed"
    assert stream.policy == policy("sample every 10us, from 0 to oo")
    stream.change(policy("sample every 20us, from 0 to oo"))
    stream.stretch(2)
    feed(network, [(0, t, t, t) for t in range(150, 250, 10)])
    assert [s.valid_us for s in got[9:]] == [160, 200, 240]


def test_what_has_no_sample_period_is_not_stretched() -> None:
    network, got = network_of_one(), []
    stream = network.connect(label(0), policy("max delay 5us"), got.append)
    stream.stretch(4)
    feed(network, [(0, t, t, t) for t in range(10, 50, 10)])
    assert len(got) == 4


def taken(adapter: PolicyAdapter, samples: list[Sample], now_us: int) -> list[Sample]:
    """What comes out when every timer goes off in its instant."""
    found = []
    for s in samples:
        while (due_us := adapter.deadline_us) is not None and due_us < s.available_us:
            found += adapter.on_time(max(due_us, now_us))
        found += adapter.on_sample(s, s.available_us)
    return found


@given(gridded_streams(), st.integers(0, 20), policies(), policies())
def test_a_continued_stream_keeps_the_order_and_counts_on(samples, at, before, after) -> None:
    adapter = PolicyAdapter(before)
    first = taken(adapter, samples[:at], 0)
    counted = sum(adapter.dropped.values())
    again = adapter.continued(after)
    assert again.policy == after
    rest = taken(again, samples[at:], samples[at - 1].available_us if 0 < at <= len(samples) else 0)
    available = [s.available_us for s in first + rest]
    assert available == sorted(set(available))
    if after.order == "strict" and first and after.approximation == "none":
        assert all(s.valid_us > first[-1].valid_us for s in rest)
    assert sum(again.dropped.values()) + sum(adapter.dropped.values()) >= counted
    assert satisfied(after, rest)


@given(gridded_streams(), policies(), st.sampled_from([20, 40]), st.integers(0, 1))
def test_a_confined_stream_is_the_same_stream_without_what_lies_beside_the_grid(samples, wanted, period_us, at) -> None:
    whole, confined = PolicyAdapter(wanted), PolicyAdapter(wanted)
    confined.confine(Grid(period_us, at))
    every = [found for s in samples for found in whole.on_sample(s, s.available_us)]
    some = [found for s in samples for found in confined.on_sample(s, s.available_us)]
    assert some == [s for s in every if (s.valid_us - at) % period_us == 0]
    assert confined.dropped == whole.dropped
    confined.confine(None)
    assert confined.on_sample == confined._all


def test_who_subscribes_while_a_sample_is_delivered_begins_with_the_next() -> None:
    network: Network = network_of_one()
    late: list[Sample] = []
    streams = []

    def consumer(sample):
        if not streams:
            streams.append(network.connect(label(0), policy("max delay 10us"), late.append))

    network.connect(label(0), Policy(), consumer)
    feed(network, [(0, 1, 1, 1), (0, 2, 2, 2)])
    assert [s.value for s in late] == [2]
    invariants(network)


@pytest.mark.parametrize(
    ("text", "step_us", "jitter_us", "told"),
    [
        ("sample every 20us", 20, 1, 1),
        ("sample every 20us, from 0", 20, 1, 1),
        ("sample every 20us", 20, 0, 0),
        ("sample every 20us, from 0", 3, 0, 0),
        ("sample every 200us, from 0", 1, 0, 0),
    ],
)
def test_a_stream_that_gets_next_to_nothing_for_its_grid_says_so_once(text, step_us, jitter_us, told) -> None:
    network, said = Network(), []
    network.on_fault = lambda _label, fault: said.append(fault)
    network.add_source(label(0), ANY)
    network.connect(label(0), policy(text), lambda _sample: None)
    for i in range(1, 1000 // step_us):
        valid_us = step_us * i + jitter_us * (1 + i % 17)
        network.push(label(0), Sample(valid_us, valid_us, i))
    assert len(said) == told
    assert all("next to nothing" in each and "`use linear`" in each for each in said)


def heard(samples, wanted, clients, changes, lost_at, current) -> list[list[Sample]]:
    """What each client gets that joins before a sample; clients change what they want, and the source is lost once."""
    network = network_of_one()
    streams, got = {}, [[] for _ in clients]
    for at, s in enumerate(samples):
        for number, joins_at in enumerate(clients):
            if joins_at == at:
                streams[number] = network.connect(label(0), wanted, got[number].append, current=current)
        for changes_at, number, what in changes:
            if changes_at == at and number in streams:
                {
                    "cancel": StreamProxy.cancel,
                    "stretch": lambda stream: stream.stretch(2),
                    "want": lambda stream: stream.want(Grid(40, 0)),
                    "want all": lambda stream: stream.want(None),
                }[what](streams[number])
        if at == lost_at:
            network.remove(label(0))
            network.add_source(label(0), ANY)
        while (due_us := network.deadline_us) is not None and due_us < s.available_us:
            network.on_time(due_us)
        network.push(label(0), s)
    return got


@given(
    gridded_streams(),
    policies(),
    st.lists(st.sampled_from([0, 0, 0, 1, 5]), min_size=2, max_size=4),
    st.lists(
        st.tuples(st.integers(0, 12), st.integers(0, 3), st.sampled_from(["cancel", "stretch", "want", "want all"])),
        max_size=4,
    ),
    st.sampled_from([None, 2, 7]),
    st.booleans(),
)
def test_a_client_gets_what_it_would_get_alone(samples, wanted, clients, changes, lost_at, current) -> None:
    others = lost_at, current
    alone = [
        heard(samples, wanted, [joins_at], [(at, 0, what) for at, of, what in changes if of == number], *others)[0]
        for number, joins_at in enumerate(clients)
    ]
    assert heard(samples, wanted, clients, changes, *others) == alone


def test_streams_of_one_policy_that_begin_together_share_one_adapter() -> None:
    network = network_of_one()
    streams = [network.connect(label(0), policy("sample every 20us"), lambda _: None) for _ in range(3)]
    network.push(label(0), Sample(1, 1, 1))
    late = network.connect(label(0), policy("sample every 20us"), lambda _: None)
    assert len({stream.adapter for stream in streams}) == 1
    assert late.adapter is not streams[0].adapter
    streams[0].stretch(2)
    assert streams[0].adapter.policy.sample_us == 40
    assert streams[1].adapter.policy.sample_us == 20


def test_each_of_several_clients_begins_again_with_the_newest_sample() -> None:
    network, got = network_of_one(), ([], [])
    refine(network, 1, Counted().prototype, [(0, Policy())])
    for each in got:
        network.connect(label(1), policy("sample every 10us"), each.append, current=True)
    feed(network, [(0, 10, 1, 10), (0, 20, 2, 20)])
    network.remove(label(1))
    feed(network, [(0, 30, 3, 30)])
    refine(network, 1, Counted().prototype, [(0, Policy())])
    assert [[s.valid_us for s in each] for each in got] == [[10, 20, 30]] * 2
