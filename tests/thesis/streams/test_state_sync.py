"""Section 7.8: state streams. The pseudo-code is the law; the product computes the same states, in the same instants."""

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import NO_VALUE, Policy, Sample, State, StateInput, StatePolicy, Synchronizer
from tests.strategies import definition, gridded_streams, streams
from tests.thesis.streams.state_pseudocode import Wanted, sampled_synchronized_state_stream
from tests.thesis.streams.stream_definitions import DATA, most_recent_at, sample
from tests.thesis.streams.stream_definitions import run as adapted

CASES = json.loads((DATA / "state_synchronisation.json").read_text())["cases"]
Arrivals = list[tuple[int, Sample]]


def in_order(fs: list[list[Sample]]) -> Arrivals:
    return sorted(
        ((i, s) for i, f in enumerate(fs) for s in f), key=lambda arrival: (arrival[1].available_us, arrival[0])
    )


def synchronizer(policies: list[Policy], wanted: Wanted) -> Synchronizer:
    state_policy = StatePolicy(
        wanted.sample_us, wanted.max_delay_us, wanted.delay_before_us, wanted.from_us, wanted.to_us
    )
    return Synchronizer([StateInput(f"input {i}", p) for i, p in enumerate(policies)], state_policy)


def run(states_of: Synchronizer, arrivals: Arrivals, start_us: int = 0) -> tuple[list[State], list[tuple[Any, ...]]]:
    """All states, and what is known about the inputs after each event."""
    waiting, known = list(arrivals), []
    states = states_of.on_time(start_us)
    known.append((start_us, states_of.sync_us, states_of.categories))
    while True:
        due_us = states_of.deadline_us
        if waiting and (due_us is None or waiting[0][1].available_us <= due_us):
            i, s = waiting.pop(0)
            now_us = s.available_us
            states += states_of.on_sample(i, s, now_us)
        elif due_us is not None:
            now_us = due_us
            states += states_of.on_time(now_us)
        else:
            return states, known
        known.append((now_us, states_of.sync_us, states_of.categories))


def worked(case: dict[str, Any]) -> tuple[list[Policy], Arrivals, Wanted]:
    policy = Policy.parse(case["state"])
    assert None not in (policy.from_us, policy.to_us, policy.sample_us, policy.delay_before_us, policy.max_delay_us)
    wanted = Wanted(policy.from_us, policy.to_us, policy.sample_us, policy.delay_before_us, policy.max_delay_us)  # type: ignore[arg-type]
    fs = [[sample(s) for s in i["samples"]] for i in case["inputs"]]
    return [Policy.parse(i["policy"]) for i in case["inputs"]], in_order(fs), wanted


def shown(states: list[State]) -> list[list[Any]]:
    return [
        [s.available_us / 1_000, s.valid_us / 1_000, [None if v is NO_VALUE else v for v in s.values]] for s in states
    ]


def rows(steps: list[tuple[Any, ...]]) -> list[list[Any]]:
    """Repeated rows, as when a timer changes nothing, are one row."""
    found: list[list[Any]] = []
    for now_us, sync_us, categories in steps:
        row = [now_us / 1_000, sync_us / 1_000, [c.name for c in categories]]
        if not found or found[-1] != row:
            found.append(row)
    return found


@pytest.mark.parametrize("case", CASES, ids=lambda c: c["name"])
def test_the_worked_cases_of_7_8_2(case: dict[str, Any]) -> None:
    policies, arrivals, wanted = worked(case)
    states, known = run(synchronizer(policies, wanted), arrivals, case["started"] * 1_000)
    assert shown(states) == case["states"], case["why"]
    seen = rows([k for k in known if k[1] is not None])
    instants = {row[0] for row in case["categories"]}
    assert all(row in case["categories"] for row in seen if row[0] in instants), "what is known after each event"


@pytest.mark.parametrize("case", CASES, ids=lambda c: c["name"])
def test_table_7_2_the_pseudo_code_itself_goes_through_the_worked_steps(case: dict[str, Any]) -> None:
    policies, arrivals, wanted = worked(case)
    states, steps = sampled_synchronized_state_stream(policies, arrivals, wanted, case["started"] * 1_000)
    assert shown(states) == case["states"]
    found = rows([tuple(step) for step in steps])
    assert all(row in found for row in case["categories"])


@st.composite
def situations(draw: st.DrawFn) -> tuple[list[Policy], Arrivals, Wanted]:
    """Inputs that keep what their policies promise, and a state stream over them."""
    policies, fs = [], []
    for _ in range(draw(st.integers(1, 3))):
        policy = draw(
            st.sampled_from([
                Policy(), Policy(order="strict"), Policy(order="monotone"), Policy(max_delay_us=30), Policy(max_delay_us=80, order="strict"),
                Policy(change="sample", sample_us=20), Policy(change="sample", sample_us=40, max_delay_us=60),
            ])
        )  # fmt: skip
        policies.append(policy)
        fs.append(adapted(draw(gridded_streams() if draw(st.booleans()) else streams()), policy)[0])
    from_us = draw(st.integers(0, 100))
    delays = st.integers(0, 120)
    wanted = Wanted(
        from_us, from_us + draw(st.integers(0, 200)), draw(st.sampled_from([10, 20, 25])), draw(delays), draw(delays)
    )
    return policies, in_order(fs), wanted


@definition
@given(situations())
def test_section_7_8_2_the_states_are_those_of_the_pseudo_code(
    situation: tuple[list[Policy], Arrivals, Wanted],
) -> None:
    policies, arrivals, wanted = situation
    expected, _ = sampled_synchronized_state_stream(policies, arrivals, wanted, 0)
    states, _ = run(synchronizer(policies, wanted), arrivals)
    assert [(s.valid_us, s.values) for s in states] == [(s.valid_us, s.values) for s in expected]
    for state, other in zip(states, expected, strict=True):
        assert 0 <= state.available_us - other.available_us < len(states), "but for ties, which are moved by 1 us"
    times = [s.available_us for s in states]
    assert times == sorted(set(times))


@definition
@given(situations())
def test_section_7_8_2_categories_are_those_of_the_pseudo_code(
    situation: tuple[list[Policy], Arrivals, Wanted],
) -> None:
    policies, arrivals, wanted = situation
    _, steps = sampled_synchronized_state_stream(policies, arrivals, wanted, 0)
    _, known = run(synchronizer(policies, wanted), arrivals)
    instants = {(step.now_us, step.sync_us) for step in steps}
    for now_us, sync_us, categories in known:
        if (now_us, sync_us) in instants:
            assert (now_us, sync_us, categories) in steps


@definition
@given(st.lists(streams(max_delay_us=60), min_size=1, max_size=3))
def test_section_7_8_1_the_improved_algorithm_computes_the_states_of_the_basic_one_and_never_later(
    fs: list[list[Sample]],
) -> None:
    """Basic: the state at t is most_recent_at(f_i, t, t + d), where d is the maximum delay of every input."""
    wanted = Wanted(from_us=60, to_us=200, sample_us=20, delay_before_us=60, max_delay_us=60)
    kept = [[s for s in f if s.delay_us <= 60] for f in fs]
    states, _ = run(synchronizer([Policy(max_delay_us=60) for _ in fs], wanted), in_order(kept))
    for t, state in zip(range(60, 201, 20), states, strict=True):
        basic = [most_recent_at(f, t, t + 60) for f in kept]
        exact = all(s is not None and s.valid_us == t for s in basic)
        assert exact or state.values == tuple(NO_VALUE if s is None else s.value for s in basic)
        assert exact or state.available_us >= t + 60, "without order nothing but exact values can be early"
        assert state.available_us <= t + 60 + len(states)


def test_section_7_8_1_first_and_last_state_follow_from_the_durations_of_the_inputs() -> None:
    early, late = Policy.parse("sample every 10, from 0 to 30"), Policy.parse("sample every 10, from 20 to 50")
    states_of = Synchronizer([StateInput("a", early), StateInput("b", late)], StatePolicy(None, 5_000))
    states, _ = run(states_of, [])
    assert [s.valid_us for s in states] == [20_000, 30_000, 40_000, 50_000]


def test_section_7_8_2_a_delay_before_approximation_of_the_maximum_delay_never_approximates_what_still_comes() -> None:
    policies, arrivals, wanted = worked(CASES[0])
    patient, _ = run(synchronizer(policies, wanted._replace(delay_before_us=wanted.max_delay_us)), arrivals, 1_000_000)
    assert [s.values for s in patient] == [("s1", "w1"), ("s2", "w2"), ("s3", "w3")]
