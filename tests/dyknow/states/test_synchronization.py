import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import NO_VALUE, Policy, PolicyError, Sample, State, StateInput, StatePolicy, Synchronizer
from dyknow.policies.upcoming import MAX_AHEAD
from dyknow.states.synchronization import CATCH_UP, Category
from tests.strategies import gridded_streams

SAMPLED = Policy("sample", 10, max_delay_us=40)
EXACT, APRX_FINAL, APRX_MORE, NOAPRX_FINAL, NOAPRX_MORE = Category


def of(*policies: Policy, **wanted: object) -> Synchronizer:
    settings = {"sample_us": 10, "max_delay_us": 40, **wanted}
    return Synchronizer([StateInput(f"input {i}", p) for i, p in enumerate(policies)], StatePolicy(**settings))  # type: ignore[arg-type]


def test_the_state_leaves_with_the_last_of_its_exact_values() -> None:
    states_of = of(SAMPLED, SAMPLED, SAMPLED)
    assert states_of.names == ("input 0", "input 1", "input 2")
    assert states_of.on_sample(2, Sample(101, 100, "c"), 101) == []
    assert states_of.on_sample(0, Sample(102, 100, "a"), 102) == []
    assert states_of.on_sample(1, Sample(103, 100, "b"), 103) == [State(103, 100, ("a", "b", "c"))]
    assert states_of.deadline_us == 150


def test_the_first_point_is_the_first_multiple_of_the_period_the_first_sample_can_matter_to() -> None:
    states_of = of(Policy(), Policy())
    assert states_of.deadline_us is None
    assert states_of.sync_us is None
    assert states_of.on_time(10**9) == []
    states_of.on_sample(0, Sample(105, 101, "a"), 105)
    assert states_of.sync_us == 110
    assert states_of.categories == (APRX_MORE, NOAPRX_MORE)


@pytest.mark.parametrize("order", ["any", "monotone", "strict"])
def test_a_sample_from_the_far_future_neither_starts_nor_ends_anything(order: str) -> None:
    states_of = of(Policy(order=order))  # type: ignore[arg-type]
    for _ in range(2):
        assert states_of.on_sample(0, Sample(100, 10**15, "wrong"), 100) == []
    assert states_of.sync_us is None
    assert states_of.on_sample(0, Sample(101, 100, "right"), 101) == [State(101, 100, ("right",))]
    assert states_of.on_sample(0, Sample(102, 10**15, "wrong"), 102) == []
    assert states_of.on_sample(0, Sample(111, 110, "right"), 111) == [State(111, 110, ("right",))]
    assert states_of.refused == 3


def test_predictions_give_states_ahead_of_time() -> None:
    states_of = of(SAMPLED)
    assert states_of.on_sample(0, Sample(100, 200, "soon"), 100) == [State(100, 200, ("soon",))]


def test_at_one_instant_all_inputs_come_before_any_timer() -> None:
    states_of = of(Policy(), Policy(), from_us=100, delay_before_us=20)
    states_of.on_sample(0, Sample(91, 91, "old a"), 91)
    states_of.on_sample(1, Sample(92, 92, "old b"), 92)
    assert states_of.on_sample(0, Sample(120, 100, "a"), 120) == []
    assert states_of.on_sample(1, Sample(120, 100, "b"), 120) == [State(120, 100, ("a", "b"))]
    late = of(Policy(), Policy(), from_us=100)
    late.on_time(100)
    assert late.on_sample(0, Sample(140, 100, "a"), 140) == []
    assert late.on_sample(1, Sample(140, 99, "b"), 140) == []
    assert late.on_time(140) == [State(140, 100, ("a", "b"))]


def test_the_maximum_delay_too_lets_all_inputs_of_its_instant_come_first() -> None:
    states_of = of(Policy(), Policy(), from_us=100, to_us=100, delay_before_us=10)
    states_of.on_time(100)
    states_of.on_time(110)
    assert states_of.on_sample(0, Sample(140, 100, "a"), 140) == []
    assert states_of.on_sample(1, Sample(140, 100, "b"), 140) == [State(140, 100, ("a", "b"))]


def test_timers_that_were_missed_go_off_before_a_later_sample_counts() -> None:
    states_of = of(Policy(), Policy(), from_us=100)
    states_of.on_sample(0, Sample(100, 100, "a"), 100)
    assert states_of.on_sample(1, Sample(141, 100, "too late"), 141) == [State(141, 100, ("a", NO_VALUE))]


def test_states_computed_in_one_instant_have_their_own_available_times() -> None:
    states_of = of(Policy(order="strict"), from_us=100)
    states_of.on_time(100)
    assert states_of.on_sample(0, Sample(125, 125, "late"), 125) == [
        State(125, 100, (NO_VALUE,)), State(126, 110, (NO_VALUE,)), State(127, 120, (NO_VALUE,)),
    ]  # fmt: skip
    assert states_of.on_sample(0, Sample(126, 130, "new"), 126) == [State(128, 130, ("new",))]


# how a missing value is approximated


def test_without_approximation_only_exact_samples_have_a_value() -> None:
    states_of = of(SAMPLED, SAMPLED, approximation="none", from_us=100)
    states_of.on_sample(0, Sample(100, 100, "a"), 100)
    states_of.on_sample(1, Sample(101, 100, "b"), 101)
    states_of.on_sample(0, Sample(112, 110, "a"), 112)
    assert states_of.categories == (EXACT, NOAPRX_MORE)
    assert states_of.on_sample(1, Sample(121, 120, "b"), 121) == [State(121, 110, ("a", NO_VALUE))], (
        "110 was lost: known at 120"
    )
    assert states_of.on_time(160) == [State(160, 120, (NO_VALUE, "b"))]


def test_a_line_needs_a_sample_before_and_one_after() -> None:
    linear = Policy("sample", 20, max_delay_us=30, approximation="linear")
    states_of = of(linear, from_us=100, max_delay_us=60)
    states_of.on_sample(0, Sample(95, 90, 1.0), 95)
    assert states_of.categories == (NOAPRX_MORE,)
    assert states_of.on_sample(0, Sample(115, 110, 3.0), 115) == [State(115, 100, (2.0,)), State(116, 110, (3.0,))]
    assert states_of.deadline_us == 120 + 30 + 20, "the sample after 120 is valid a period later at the latest"
    assert states_of.on_time(170) == [State(170, 120, (NO_VALUE,))]


def test_the_line_is_that_of_the_state_policy_for_inputs_that_name_none() -> None:
    states_of = of(Policy(order="strict"), from_us=100, approximation="linear")
    states_of.on_sample(0, Sample(95, 95, 1.0), 95)
    assert states_of.on_sample(0, Sample(106, 105, 3.0), 106) == [State(106, 100, (2.0,))]


@given(gridded_streams())
def test_on_a_line_every_approximated_value_lies_on_it(arrived: list[Sample]) -> None:
    states_of = of(Policy(order="any"), from_us=0, to_us=300, approximation="linear", max_delay_us=200)
    states = states_of.on_time(0)
    for s in arrived:
        states += states_of.on_sample(0, s._replace(value=2.0 * s.valid_us), s.available_us)
    for state in states:
        assert state.values[0] is NO_VALUE or state.values[0] == pytest.approx(2.0 * state.valid_us)


# bounds


def test_points_that_were_due_before_the_first_call_have_no_state() -> None:
    states_of = of(Policy(), from_us=0)
    now_us = 1_800_000_000_000_000
    assert states_of.on_sample(0, Sample(now_us, now_us - 5, "a"), now_us) == []
    assert states_of.sync_us == now_us - 40
    assert states_of.skipped == (now_us - 40) // 10


def test_after_a_silence_of_the_caller_the_last_points_are_caught_up_with() -> None:
    states_of = of(SAMPLED)
    states_of.on_sample(0, Sample(100, 100, "a"), 100)
    states = states_of.on_time(10**12)
    assert len(states) == CATCH_UP + 1
    assert states[-1].valid_us == 10**12 - 40
    assert {s.values for s in states} == {("a",)}
    assert states_of.skipped + len(states) == (10**12 - 40 - 110) // 10 + 1


def test_silent_inputs_still_give_a_state_for_every_point() -> None:
    states_of = of(SAMPLED, SAMPLED)
    states_of.on_sample(0, Sample(100, 100, "a"), 100)
    states = []
    while (due_us := states_of.deadline_us) is not None and due_us < 1_000:
        states += states_of.on_time(due_us)
    assert [s.valid_us for s in states] == list(range(100, 960, 10))
    assert all(s.available_us == s.valid_us + 40 for s in states)


def test_after_its_last_point_a_state_stream_is_silent() -> None:
    states_of = of(SAMPLED, from_us=0, to_us=10)
    assert [s.valid_us for t in (0, 10) for s in states_of.on_sample(0, Sample(t, t, "a"), t)] == [0, 10]
    assert states_of.deadline_us is None
    assert states_of.sync_us is None
    assert states_of.on_sample(0, Sample(20, 20, "a"), 20) == []
    assert states_of.on_time(10**9) == []
    over = of(SAMPLED, from_us=0, to_us=10)
    assert over.on_time(10**9) == []
    assert (over.deadline_us, over.skipped) == (None, 2)


def test_many_samples_for_one_point_fill_no_memory() -> None:
    states_of = of(Policy(), Policy(), from_us=0, sample_us=100)
    states_of.on_time(0)
    for n in range(2 * MAX_AHEAD):
        states_of.on_sample(0, Sample(1, 10_000 + n, "far"), 1)
    assert states_of.refused == MAX_AHEAD
    assert len(states_of._inputs[0].buffer.later) == MAX_AHEAD


@pytest.mark.parametrize(
    "wrong",
    [{"sample_us": 0}, {"sample_us": -5}, {"max_delay_us": -1}, {"delay_before_us": -1}, {"from_us": 5, "to_us": 4}],
)
def test_state_policies_that_cannot_hold_are_refused(wrong: dict[str, int]) -> None:
    with pytest.raises(PolicyError):
        of(SAMPLED, **wrong)


def test_a_state_of_nothing_is_refused() -> None:
    with pytest.raises(PolicyError):
        of()


@given(
    st.lists(st.tuples(st.integers(0, 1), st.integers(0, 50), st.integers(-100, 200)), max_size=40),
    st.sampled_from(["none", "most recent", "linear"]),
)
def test_states_come_in_order_one_for_each_point_whatever_arrives(
    steps: list[tuple[int, int, int]], approximation: str
) -> None:
    states_of = of(Policy(order="strict"), Policy(), from_us=0, approximation=approximation, delay_before_us=15)
    now_us, states = 0, states_of.on_time(0)
    for i, pause_us, delay_us in steps:
        now_us += pause_us
        states += states_of.on_sample(i, Sample(now_us, now_us - delay_us, 1.0), now_us)
        due_us = states_of.deadline_us
        if due_us is not None and due_us <= now_us:
            states += states_of.on_time(now_us)
        assert states_of.deadline_us is None or states_of.deadline_us > now_us or states_of.on_time(now_us) == []
    assert [s.valid_us for s in states] == list(range(0, 10 * len(states), 10))
    assert len(states) >= (now_us - 40) // 10
    times = [s.available_us for s in states]
    assert times == sorted(set(times))
