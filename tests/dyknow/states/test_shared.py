from collections.abc import Iterable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow import (
    NO_VALUE,
    Policy,
    PolicyError,
    Sample,
    SharedState,
    SharedSynchronizer,
    StateInput,
    StatePolicy,
    Strand,
    Synchronizer,
)
from dyknow.states.synchronization import CATCH_UP
from tests.strategies import examples

PERIOD_US, MAX_DELAY_US = 10, 40
SHARED, OWN = 2, {"a": 1, "b": 2, "c": 0}


class Apart:
    """A `Synchronizer` for each stream: what shared ones are compared with."""

    def __init__(self) -> None:
        self.streams: dict[str, Synchronizer] = {}

    def add(self, key: str) -> None:
        policy = Policy("sample", PERIOD_US, max_delay_us=MAX_DELAY_US)
        inputs = [StateInput(f"input {i}", policy) for i in range(SHARED + OWN[key])]
        self.streams[key] = Synchronizer(inputs, StatePolicy(PERIOD_US, MAX_DELAY_US, approximation="none"))

    def on_shared(self, i: int, sample: Sample, now_us: int) -> dict[str, Any]:
        return {key: _plain(one.on_sample(i, sample, now_us)) for key, one in self.streams.items()}

    def on_own(self, key: str, i: int, sample: Sample, now_us: int) -> dict[str, Any]:
        return {key: _plain(self.streams[key].on_sample(SHARED + i, sample, now_us))}

    def on_time(self, now_us: int) -> dict[str, Any]:
        return {key: _plain(one.on_time(now_us)) for key, one in self.streams.items()}

    @property
    def deadline_us(self) -> int | None:
        return min((due for one in self.streams.values() if (due := one.deadline_us) is not None), default=None)


def _plain(states: Iterable[Any]) -> list[Any]:
    return [(state.valid_us, list(state.values)) for state in states]


def by_key(states: Iterable[SharedState[str]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for state in states:
        found.setdefault(state.key, []).append((state.valid_us, state.values))
    return found


STEPS = st.lists(
    st.tuples(
        st.sampled_from(["shared", "own", "own", "time", "due", "add", "remove"]),
        st.sampled_from(sorted(OWN)),
        st.integers(0, 1),
        st.integers(-5, 2),
        st.one_of(st.integers(0, 12), st.sampled_from([0, 35, 60, 12_345])),
    ),
    max_size=60,
)


@settings(max_examples=examples(300))
@given(STEPS)
def test_each_of_many_streams_is_what_a_synchronizer_of_its_own_makes_of_it(steps: list[Any]) -> None:
    shared, apart, now_us = SharedSynchronizer[str](SHARED, PERIOD_US, MAX_DELAY_US), Apart(), 1_000_003
    strands: dict[str, Strand[str]] = {}
    latest_us = [-1] * SHARED
    for kind, key, i, ahead, later_us in steps:
        now_us += later_us
        sample = Sample(now_us, (now_us // PERIOD_US + ahead) * PERIOD_US, f"{kind}{now_us}")
        if kind == "shared":
            if sample.valid_us <= latest_us[i]:
                continue  # the policy of a sampled stream lets no such sample through
            latest_us[i] = sample.valid_us
        expected: dict[str, Any] = {}
        found: list[SharedState[str]] = []
        if kind == "shared":
            expected, found = apart.on_shared(i, sample, now_us), shared.on_shared(i, sample, now_us)
        elif kind == "own" and key in strands and i < OWN[key]:
            expected, found = apart.on_own(key, i, sample, now_us), shared.on_own(strands[key], i, sample, now_us)
        elif kind == "time" or (kind == "due" and (apart.deadline_us or now_us) <= now_us):
            expected, found = apart.on_time(now_us), shared.on_time(now_us)
        elif kind == "add" and key not in strands:
            strands[key] = shared.add(key, OWN[key])
            apart.add(key)
        elif kind == "remove" and key in strands:
            shared.remove(key)
            del strands[key], apart.streams[key]
        assert by_key(found) == {key: states for key, states in expected.items() if states}
        if apart.deadline_us is not None:
            assert shared.deadline_us is not None
            assert shared.deadline_us <= apart.deadline_us
    assert len(shared) == len(apart.streams)


def test_a_state_leaves_with_the_last_of_its_values_whoever_brings_it() -> None:
    pairs = SharedSynchronizer[str](1, 10, 40)
    one, other = pairs.add("one", 1), pairs.add("other", 1)
    assert pairs.deadline_us is None
    assert pairs.on_own(one, 0, Sample(101, 100, "one"), 101) == []
    assert pairs.on_shared(0, Sample(102, 100, "mine"), 102) == [SharedState("one", 100, ["mine", "one"])]
    assert pairs.on_own(other, 0, Sample(103, 100, "other"), 103) == [SharedState("other", 100, ["mine", "other"])]
    assert pairs.on_time(150) == [SharedState("one", 110, [NO_VALUE] * 2), SharedState("other", 110, [NO_VALUE] * 2)]


def test_what_is_shared_is_kept_no_longer_than_somebody_waits_for_it() -> None:
    pairs = SharedSynchronizer[str](1, 10, 40)
    pairs.add("silent", 1)
    for valid_us in range(0, 10_000, 10):
        pairs.on_shared(0, Sample(valid_us, valid_us, "mine"), valid_us)
    assert len(pairs._shared.rows) <= 6


def test_a_sample_from_the_far_future_is_refused() -> None:
    pairs = SharedSynchronizer[str](1, 10, 40)
    one = pairs.add("one", 1)
    assert pairs.on_own(one, 0, Sample(100, 10**15, "wrong"), 100) == []
    assert pairs.on_shared(0, Sample(100, 10**15, "wrong"), 100) == []
    assert pairs.refused == 2
    assert pairs.deadline_us is None


def test_after_a_long_silence_of_the_caller_older_points_are_skipped_and_counted() -> None:
    pairs = SharedSynchronizer[str](1, 10, 40)
    pairs.add("one", 0)
    pairs.on_shared(0, Sample(0, 0, "mine"), 0)
    assert len(pairs.on_time(1_000_001)) == CATCH_UP
    assert pairs.skipped == 1_000_000 // 10 - 4 - CATCH_UP


@pytest.mark.parametrize(("period_us", "max_delay_us"), [(0, 1), (-1, 1), (1, -1)])
def test_what_cannot_be_computed_is_refused(period_us: int, max_delay_us: int) -> None:
    with pytest.raises(PolicyError):
        SharedSynchronizer[str](1, period_us, max_delay_us)


@given(
    st.sampled_from([2, 4, 8]),
    st.lists(st.tuples(st.integers(0, 70), st.booleans(), st.integers(0, 45)), max_size=40),
    st.integers(0, 30),
)
def test_a_thinned_stream_has_the_states_of_the_coarser_grid_and_no_others(
    every: int, steps: list[tuple[int, bool, int]], begins: int
) -> None:
    """Whatever comes, late or not: at each point of the coarser grid it is what it would have been."""
    full, thin = (SharedSynchronizer[str](1, PERIOD_US, MAX_DELAY_US) for _ in range(2))
    strands = full.add("a", 1), thin.add("a", 1)
    arrivals = sorted(
        (number * PERIOD_US + late_us, number * PERIOD_US, is_shared)
        for number, is_shared, late_us in {(number, is_shared): (number, is_shared, late) for number, is_shared, late in steps}.values()
        if is_shared or number % every == 0
    )  # fmt: skip
    found: tuple[list[SharedState[str]], list[SharedState[str]]] = [], []
    newest_us, is_thinned = -1, False
    for i, (now_us, valid_us, is_shared) in enumerate(arrivals):
        if is_shared and valid_us <= newest_us:
            continue
        newest_us = valid_us if is_shared else newest_us
        if i >= begins and not is_thinned:
            thin.thin(strands[1], every)
            is_thinned, since_us = True, now_us
        sample = Sample(now_us, valid_us, f"{is_shared}{valid_us}")
        for one, strand, got in zip((full, thin), strands, found, strict=True):
            got.extend(one.on_time(now_us - 1))
            got.extend(one.on_shared(0, sample, now_us) if is_shared else one.on_own(strand, 0, sample, now_us))
    for one, got in zip((full, thin), found, strict=True):
        got.extend(one.on_time(1_000))
    if is_thinned:
        coarse = [state for state in found[1] if state.valid_us > since_us]
        assert all(state.valid_us % (every * PERIOD_US) == 0 for state in coarse)
        assert coarse == [
            state for state in found[0] if state.valid_us > since_us and not state.valid_us % (every * PERIOD_US)
        ]
