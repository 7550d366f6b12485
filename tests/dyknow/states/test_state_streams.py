"""State streams as processes: synchronised, or one state per change (7.8.1, 7.8.2), begun now or in the past."""

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dyknow import (
    NO_VALUE,
    Label,
    Network,
    Policy,
    PolicyError,
    Predicted,
    Quality,
    Sample,
    StateInput,
    StatePolicy,
    Synchronizer,
)
from dyknow.network.process import Input
from dyknow.states.state_streams import StateStreamProcess, exactly, state_policy
from tests.dyknow.networks import ANY, arrivals, feed, invariants, label, pass_time, policy, times
from tests.strategies import definition

STATE = Label("state")
INPUT = policy("sample every 20us, max delay 30us")


def network_with(when="sampled", made=None, inputs=(INPUT, INPUT)):
    network = Network()
    for i in range(len(inputs)):
        network.add_source(label(i), ANY)
    made = StatePolicy(20, 40, from_us=0) if made is None and when == "sampled" else made
    stream = StateStreamProcess([Input(label(i), each) for i, each in enumerate(inputs)], made, when)
    network.add_process(STATE, ANY, stream)
    return network, stream


@given(arrivals())
def test_sampled_states_are_those_of_the_synchroniser_over_adapted_inputs(events) -> None:
    network, _ = network_with()
    got: list[Sample] = []
    network.connect(STATE, Policy(), got.append)
    feed(network, events)
    pass_time(network, 900)
    direct = Network()
    found = []
    maker = Synchronizer([StateInput(str(i), INPUT) for i in range(2)], StatePolicy(20, 40, from_us=0))
    for i in range(2):
        direct.add_source(label(i), ANY)
        direct.connect(label(i), INPUT, lambda s, i=i: found.extend(maker.on_sample(i, s, s.available_us)))
    for source, valid_us, value, now_us in events:
        while (due_us := maker.deadline_us) is not None and due_us < now_us:
            found += maker.on_time(due_us)
        direct.push(label(source), Sample(now_us, valid_us, value))
    while (due_us := maker.deadline_us) is not None and due_us < 900:
        found += maker.on_time(due_us)
    assert times(got) == [(s.available_us, s.valid_us, s.values) for s in found]
    invariants(network)


@given(
    arrivals(),
    st.integers(0, 30),
    st.integers(0, 20),
    st.sampled_from(["sampled", "any update", "any change", "all updated", "all changed"]),
)
@example([(0, 120, 0, 151)], 1, 6, "sampled").via("all that came by then came too late")
@example([(0, 270, 0, 286), (0, 280, 0, 311), (0, 310, 0, 312)], 2, 14, "sampled")
@example([(0, 0, 0, 25), (0, 10, 0, 45), (1, 80, 0, 90)], 3, 0, "sampled")
def test_states_that_begin_in_the_past_are_those_that_had_been_there(events, at, from_at, when) -> None:
    from_us = 20 * from_at
    made = StatePolicy(20, 40, from_us=from_us) if when == "sampled" else None
    (there, _), (network, _) = network_with(when, made), network_with(when, made)
    past, later = [event for event in events[:at] if event[1] >= from_us], events[at:]
    expected: list[Sample] = []
    got: list[Sample] = []
    there.connect(STATE, Policy(), expected.append)
    feed(there, past + later)
    feed(network, past)
    stream = network.connect(STATE, Policy(), got.append, from_us=from_us)
    got += stream.take_backlog()
    feed(network, later)
    for each in (there, network):
        pass_time(each, 900)
    if past:
        assert times(got) == times(expected)
    stream.cancel()
    invariants(network)
    assert not network._timed


def changes(events, when):
    """A direct model over inputs without constraints."""
    last: dict[int, tuple[int, object]] = {}
    news: set[int] = set()
    found = []
    for source, valid_us, value, _ in events:
        if "change" not in when or source not in last or last[source][1] != value:
            news.add(source)
        last[source] = (valid_us, value)
        if len(last) == 2 and (len(news) == 2 if when.startswith("all") else news):
            news.clear()
            found.append((max(last[0][0], last[1][0]), (last[0][1], last[1][1])))
    return found


@definition
@given(arrivals(), st.sampled_from(["any update", "any change", "all updated", "all changed"]))
def test_a_state_per_change_of_any_input_or_of_all(events, when) -> None:
    network, _ = network_with(when, inputs=(Policy(), Policy()))
    got: list[Sample] = []
    network.connect(STATE, Policy(), got.append)
    feed(network, events)
    assert [(s.valid_us, s.value) for s in got] == changes(events, when)


def test_states_wait_for_their_timers_though_nothing_has_come_yet() -> None:
    """Also when something else begins to wait meanwhile."""
    network, stream = network_with(made=StatePolicy(20, 40))
    got: list[Sample] = []
    network.connect(STATE, Policy(), got.append)
    assert network.deadline_us is None
    for i in range(200):
        text = f"from {i}us to oo, sample every 10us, max delay 5us, use most recent"
        network.connect(label(1), policy(text), lambda _: None).cancel()
    network.push(label(0), Sample(25, 20, 7))
    assert network.deadline_us == 50, "after that nothing more can come"
    assert "n[1]" in str(stream.awaited()[0])
    pass_time(network, 51)
    assert times(got) == [(50, 20, (7, NO_VALUE))]
    assert [origin.manner for origin in stream.recent[0].origins] == ["exact", "no value"]


@pytest.mark.parametrize("when", ["sampled", "any update"])
def test_a_state_is_as_certain_as_its_values_are_together(when: str) -> None:
    network, _ = network_with(when, StatePolicy(20, 40))
    got: list[Sample] = []
    network.connect(STATE, policy("min certainty 0.4"), got.append)
    for i, valid_us, certainty in ((0, 0, 0.8), (1, 0, 0.5), (0, 20, 0.5), (1, 20, 0.5)):
        network.generator(label(i)).push(Sample(valid_us + i, valid_us, i, Quality(certainty)))
    assert [(each.valid_us, each.quality.certainty) for each in got] == [(0, 0.4)]


def test_a_state_of_states() -> None:
    network, _ = network_with("any update", inputs=(Policy(), Policy()))
    outer = Label("outer")
    network.add_process(outer, ANY, StateStreamProcess([Input(STATE), Input(label(0))], None, "all updated"))
    got: list[Sample] = []
    stream = network.connect(outer, Policy(), got.append)
    feed(network, [(0, 10, 1, 10), (1, 20, 2, 20), (0, 30, 3, 30)])
    assert [(s.valid_us, s.value) for s in got] == [(20, ((1, 2), 1)), (30, ((3, 2), 3))]
    stream.cancel()
    invariants(network)


@pytest.mark.parametrize(
    ("wanted", "inputs", "when"),
    [
        ("", ["sample every 20us, max delay 1us"] * 2, "sampled"),
        ("", ["sample every 20us, max delay 1us", ""], "any update"),
        ("any change", ["sample every 20us"], "any change"),
        ("sample every 20us, max delay 5us", ["", ""], "sampled"),
        ("sample every 20us", ["max delay 5us", "max delay 9us"], "sampled"),
    ],
)
def test_what_a_policy_says_of_states(wanted, inputs, when) -> None:
    made, found = state_policy(policy(wanted), [policy(each) for each in inputs])
    assert found == when
    assert (made is not None) == (when == "sampled")
    if wanted == "sample every 20us":
        assert made is not None
        assert made.max_delay_us == 9


@pytest.mark.parametrize(
    ("of_state", "of_inputs", "values"),
    [
        ("", ("", ""), [(0, "a"), (1, "a"), (1, "b")]),
        ("no approximation", ("", ""), [(0, "a"), (1, NO_VALUE), (NO_VALUE, "b")]),
        ("", ("no approximation", ""), [(0, "a"), (1, "a"), (NO_VALUE, "b")]),
    ],
)
@pytest.mark.parametrize("sampled", [True, False])
def test_with_no_approximation_said_a_state_has_exact_values_only(of_state, of_inputs, values, sampled) -> None:
    when_wanted = "sample every 20us, max delay 5us, from 0" if sampled else "any update"
    wanted = policy(", ".join(filter(None, (when_wanted, of_state))))
    inputs = [Input(label(i), policy(each)) for i, each in enumerate(of_inputs)]
    made, when = state_policy(wanted, [each.policy for each in inputs])
    network = Network()
    for i in range(2):
        network.add_source(label(i), ANY)
    network.add_process(STATE, ANY, StateStreamProcess(exactly(wanted, inputs), made, when))
    got: list[Sample] = []
    network.connect(STATE, Policy(), got.append)
    feed(network, [(0, 0, 0, 0), (1, 0, "a", 1), (0, 20, 1, 20), (1, 40, "b", 40)])
    pass_time(network, 50)
    assert [each.value for each in got] == values


def test_a_sampled_state_must_know_how_long_to_wait() -> None:
    with pytest.raises(PolicyError, match="needs `max delay`"):
        state_policy(policy("sample every 20us"), [policy("max delay 5us"), Policy()])


@pytest.mark.parametrize("when", ["sampled", "any update"])
def test_with_max_age_a_state_has_no_value_of_what_was_not_observed_lately(when) -> None:
    """One input falls silent; of the other there are predictions, made at 100."""
    network = Network()
    inputs = [Input(label(i), policy("from 0, sample every 20us, max delay 30us")) for i in range(2)]
    for each in inputs:
        network.add_source(each.label, ANY)
    made = StatePolicy(20, 40, from_us=0) if when == "sampled" else None
    network.add_process(STATE, ANY, StateStreamProcess(inputs, made, when, 60))
    got: list[Sample] = []
    network.connect(STATE, Policy(), got.append)
    for at in range(0, 300, 20):
        if at <= 200:
            network.push(label(0), Sample(at, at, 1.0))
        network.push(label(1), Sample(at, at, 2.0, Quality(prediction=Predicted(100)) if at > 100 else Quality()))
    pass_time(network, 400)
    values = {each.valid_us: each.value for each in got}
    assert values[100] == values[160] == (1.0, 2.0)
    assert values[180] == values[200] == (1.0, NO_VALUE)
    assert values[260] == (1.0, NO_VALUE)
    assert values[280] == (NO_VALUE, NO_VALUE)
