"""Policies of streams about many objects: what they say holds of each object by itself (Def. 8.5.2)."""

import math

from hypothesis import given
from hypothesis import strategies as st

from dyknow import NO_VALUE, SURE, Field, Label, Network, Policy, PolicyAdapter, Predicted, Quality, Sample, Sort
from dyknow.policies.of_objects import MOST_OBJECTS, adapted_to

CAR = Sort("car", (Field("symbol", "text"), Field("x_m", "m"), Field("end", "bool")))
POLICIES = st.sampled_from(
    ["max delay 30us", "strict order", "monotone order", "any change", "from 40us to 300us", "min certainty 0.9",
     "strict order, max delay 50us", "max deviation 2", "max age of prediction 30us"]
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
        made = Predicted(max(0, now_us - 2 * delay_us)) if x_m else None
        quality = Quality(certainty, ((float(x_m) ** 2,),), made)
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
            network.push("cars", Sample(at_us, at_us, (symbol, 0.0, False)))
    proxy.stretch(2)
    for symbol in ("a", "b", "c"):
        network.push("cars", Sample(150_000, 150_000, (symbol, 0.0, False)))
    assert [(each.value[0], each.valid_us) for each in brought] == [("a", 13_000), ("b", 13_000), ("c", 150_000)]


def test_what_is_remembered_of_objects_is_bounded():
    adapter = adapted_to(PolicyAdapter(Policy.of("strict order")), CAR)
    for i in range(MOST_OBJECTS + 10):
        adapter.on_sample(Sample(i, i, (f"car{i}", 0.0, False)), i)
    assert len(adapter._each) == MOST_OBJECTS


TRACK = Sort(
    "track",
    (
        Field("symbol", "text"), Field("x_m", "m"), Field("y_m", "m"), Field("latitude_deg", "deg"),
        Field("longitude_deg", "deg"), Field("vx_m_s", "m/s"), Field("vy_m_s", "m/s"), Field("sd_m", "m"),
        Field("v_sd_m_s", "m/s"), Field("colour", "text"), Field("end", "bool"),
    ),
)  # fmt: skip
S = 1_000_000


def adapted(policy, sort=TRACK):
    return adapted_to(PolicyAdapter(Policy.of(policy)), sort)


def state(valid_us, *, vx_m_s=10.0, end=False, quality=SURE):
    value = ("a", 1.0, 2.0, 58.0, 15.0, vx_m_s, -5.0, 3.0, 2.0, "red", end)
    return Sample(valid_us, valid_us, value, quality)


def test_objects_are_predicted_with_their_own_velocity_and_become_vaguer():
    adapter = adapted("predict 2s")
    (found,) = adapter.on_sample(state(S), S)
    assert (found.valid_us, found.quality.prediction) == (3 * S, Predicted(S))
    record = dict(zip([each.name for each in TRACK.fields], found.value, strict=True))
    assert (record["x_m"], record["y_m"], record["sd_m"], record["colour"]) == (21.0, -8.0, 5.0, "red")
    assert math.isclose((58.0 - record["latitude_deg"]) * 111_195.0, 10.0, rel_tol=1e-4)
    assert math.isclose((record["longitude_deg"] - 15.0) * 111_195.0 * math.cos(math.radians(58)), 20.0, rel_tol=1e-4)
    hidden = Quality(0.5, (), Predicted(S, "left", 0.5))
    (again,) = adapter.on_sample(state(2 * S, quality=hidden), 2 * S)
    assert (again.valid_us, again.quality) == (4 * S, hidden), "what is not seen is moved on as well"
    foreseen = state(9 * S, quality=hidden)._replace(available_us=3 * S)
    assert adapter.on_sample(foreseen, 3 * S) == [foreseen]


def test_objects_without_a_velocity_are_not_predictable_and_counted_and_their_end_passes():
    adapter = adapted("predict 2s")
    assert adapter.on_sample(state(S, vx_m_s=NO_VALUE), S) == []
    assert adapter.dropped == {"not predictable": 1}
    last = state(2 * S, end=True)
    assert adapter.on_sample(last, 2 * S) == [last]
    without = adapted("predict 2s", CAR)
    assert without.on_sample(Sample(S, S, ("a", 1.0, False)), S) == []
    assert without.dropped == {"not predictable": 1}


def test_sampled_all_branches_of_one_time_pass():
    adapter = adapted("sample every 1s")
    left, right = (state(S, quality=Quality(w, (), Predicted(0, name, w))) for name, w in (("l", 0.3), ("r", 0.7)))
    later = state(S + 1, quality=left.quality)
    passed = [each for sample in (left, right, later) for each in adapter.on_sample(sample, sample.available_us)]
    assert [each.quality for each in passed] == [left.quality, right.quality]
