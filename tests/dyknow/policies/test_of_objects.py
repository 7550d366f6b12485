"""Policies of streams about many objects: what they say holds of each object by itself (Def. 8.5.2)."""

from hypothesis import given
from hypothesis import strategies as st

from dyknow import Field, Label, Network, Policy, PolicyAdapter, Quality, Sample, Sort
from dyknow.policies.of_objects import MOST_OBJECTS, adapted_to

CAR = Sort("car", (Field("symbol", "text"), Field("x_m", "m"), Field("end", "bool")))
POLICIES = st.sampled_from(
    ["max delay 30us", "strict order", "monotone order", "any change", "from 40us to 300us", "min certainty 0.9",
     "strict order, max delay 50us", "max deviation 2"]
)  # fmt: skip


@st.composite
def states(draw):
    """Samples in the order of available times, of three objects."""
    found, now_us = [], 0
    for later_us, delay_us, symbol, x_m, certainty in draw(
        st.lists(
            st.tuples(
                st.integers(1, 20),
                st.integers(0, 60),
                st.sampled_from("abc"),
                st.integers(0, 2),
                st.sampled_from([0.8, 1.0]),
            ),
            max_size=30,
        )
    ):
        now_us += later_us
        quality = Quality(certainty, ((float(x_m) ** 2,),))
        found.append(Sample(now_us, max(0, now_us - delay_us), (symbol, float(x_m), False), quality))
    return found


@given(states(), POLICIES)
def test_what_passes_of_each_object_is_what_a_stream_of_it_alone_would_give(samples, policy):
    together = adapted_to(PolicyAdapter(Policy.of(policy)), CAR)
    alone = {symbol: PolicyAdapter(Policy.of(policy)) for symbol in "abc"}
    passed = [each.value for sample in samples for each in together.on_sample(sample, sample.available_us)]
    expected = [
        each.value for sample in samples for each in alone[sample.value[0]].on_sample(sample, sample.available_us)
    ]
    assert passed == expected
    assert together.dropped == sum((each.dropped for each in alone.values()), start=type(together.dropped)())


@given(states())
def test_sampled_each_object_has_one_state_in_each_period_and_keeps_its_valid_time(samples):
    adapter = adapted_to(PolicyAdapter(Policy.of("sample every 50us, from 0")), CAR)
    passed = [each for sample in samples for each in adapter.on_sample(sample, sample.available_us)]
    periods = [(each.value[0], each.valid_us // 50) for each in passed]
    assert len(set(periods)) == len(periods)
    assert {each[:2] for each in periods} == {(s.value[0], s.valid_us // 50) for s in passed}
    assert {each.valid_us for each in passed} <= {each.valid_us for each in samples}


def test_the_last_state_of_an_object_passes_whatever_the_policy_says():
    adapter = adapted_to(PolicyAdapter(Policy.of("sample every 100, from 0, max delay 10")), CAR)
    assert adapter.on_sample(Sample(1000, 1000, ("a", 0.0, False)), 1000)
    assert not adapter.on_sample(Sample(2000, 2000, ("a", 0.0, False)), 2000)
    assert adapter.on_sample(Sample(90_000, 3000, ("a", 0.0, True)), 90_000)


def test_subscribers_of_object_streams_get_them_so_and_continue_so_under_another_policy():
    network = Network()
    network.add_source("cars", CAR)
    brought = []
    proxy = network.connect(Label("cars"), Policy.of("sample every 100, from 0"), brought.append)
    for at_us in (13_000, 14_000):
        for symbol in ("a", "b"):
            network.push("cars", at_us, (symbol, 0.0, False), at_us)
    proxy.stretch(2)
    for symbol in ("a", "b", "c"):
        network.push("cars", 150_000, (symbol, 0.0, False), 150_000)
    assert [(each.value[0], each.valid_us) for each in brought] == [("a", 13_000), ("b", 13_000), ("c", 150_000)]


def test_what_is_remembered_of_objects_is_bounded():
    adapter = adapted_to(PolicyAdapter(Policy.of("strict order")), CAR)
    for i in range(MOST_OBJECTS + 10):
        adapter.on_sample(Sample(i, i, (f"car{i}", 0.0, False)), i)
    assert len(adapter._each) == MOST_OBJECTS
