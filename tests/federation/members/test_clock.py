"""The federation's clock, and the offsets of its peers."""

from itertools import count
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.federation.members.clock import PERIOD_US, TOGETHER_US, FederationClock, Offset, OffsetEstimator, Standing
from dyknow.federation.members.offsets import SETTLE_US, ClockOffsets
from dyknow.federation.transport import Answer, Answered, Ask, Asked, AskEnded
from dyknow.model.errors import PolicyError

SPEEDS = st.sampled_from([0.1, 0.5, 1.0, 2.0, 3.0, 10.0, 1 / 3]) | st.floats(0.01, 1000)
INSTANTS = st.integers(-(10**16), 10**16)


@given(INSTANTS, SPEEDS, INSTANTS)
def test_a_timer_set_for_a_federation_instant_fires_at_the_first_node_time_that_reaches_it(
    epoch_us: int, speed: float, instant_us: int
) -> None:
    clock = FederationClock(epoch_us, speed)
    wall_us = clock.wall_us(instant_us)
    assert clock.federation_us(wall_us) >= instant_us
    assert clock.federation_us(wall_us - 1) < instant_us


@given(INSTANTS, INSTANTS)
def test_at_speed_one_federation_time_is_the_node_clock(epoch_us: int, wall_us: int) -> None:
    clock = FederationClock(epoch_us)
    assert clock.federation_us(wall_us) == wall_us == clock.wall_us(wall_us)


@given(INSTANTS, SPEEDS, INSTANTS, st.integers(0, 10**12))
def test_federation_time_never_goes_back(epoch_us: int, speed: float, wall_us: int, later_us: int) -> None:
    clock = FederationClock(epoch_us, speed)
    assert clock.federation_us(wall_us) <= clock.federation_us(wall_us + later_us)
    assert clock.federation_us(epoch_us) == epoch_us


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan"), float("inf")])
def test_a_clock_that_stands_or_runs_backwards_is_refused(speed: float) -> None:
    with pytest.raises(PolicyError):
        FederationClock(0, speed)


def test_who_runs_at_another_speed_or_from_another_epoch_does_not_agree() -> None:
    fast = FederationClock(1_000, 10.0)
    assert fast.agrees(1_000, 10.0)
    assert not fast.agrees(1_001, 10.0)
    assert not fast.agrees(1_000, 1.0)
    assert FederationClock(5).agrees(7, 1.0), "at speed 1 every epoch is the node clock"
    assert FederationClock(5) == FederationClock(7)


def exchange(
    estimator: OffsetEstimator, now_us: int, offset_us: int, there_us: int, back_us: int, *, boot: int = 1
) -> int:
    """One exchange with a peer whose clock is `offset_us` ahead; returns when it was over."""
    seen_us = now_us + there_us + offset_us
    estimator.on_stamps(boot, now_us, seen_us, seen_us + 40, now_us + there_us + 40 + back_us)
    return now_us + there_us + 40 + back_us


DELAYS = st.tuples(st.integers(0, 200_000), st.integers(0, 200_000))


@given(st.integers(-(10**10), 10**10), st.lists(DELAYS, min_size=2, max_size=40))
def test_the_true_offset_is_within_the_bound_whatever_the_delays(offset_us: int, delays: list[tuple[int, int]]) -> None:
    estimator, now_us = OffsetEstimator(0), 0
    for there_us, back_us in delays:
        now_us = exchange(estimator, now_us, offset_us, there_us, back_us) + 1_000
    assert estimator.offset is not None
    assert abs(estimator.offset.offset_us - offset_us) <= estimator.offset.bound_us


@given(st.integers(-(10**7), 10**7), st.integers(0, 2**32))
def test_the_bound_holds_between_clocks_that_drift_apart(offset_us: int, seed: int) -> None:
    random, estimator, now_us, drift = Random(seed), OffsetEstimator(0), 0, 100e-6
    for _ in range(20):
        true_us = offset_us + round(now_us * drift)
        end_us = exchange(estimator, now_us, true_us, random.randrange(50_000), random.randrange(50_000))
        if estimator.offset is not None:
            error_us = abs(estimator.offset.offset_us - (offset_us + round(end_us * drift)))
            assert error_us <= estimator.offset.bound_us + 1, "the stamps of this test are rounded, both ways"
        now_us += PERIOD_US


def test_the_tightest_of_the_last_eight_counts() -> None:
    estimator, now_us = OffsetEstimator(0), 0
    for there_us in (90_000, 400, 70_000, 80_000):
        now_us = exchange(estimator, now_us, 12_345, there_us, 300)
    assert estimator.offset is not None
    assert estimator.offset.bound_us < 500
    assert abs(estimator.offset.offset_us - 12_345) <= 50
    for _ in range(8):
        now_us = exchange(estimator, now_us, 12_345, 60_000, 300)
    assert estimator.offset.bound_us > 30_000, "the good one is not among the last eight any more"


@pytest.mark.parametrize(
    ("offset", "standing"),
    [
        (Offset(0, 0), Standing.SYNCHRONISED),
        (Offset(-49_000, 1_000), Standing.SYNCHRONISED),
        (Offset(49_001, 1_000), Standing.CORRECTED),
        (Offset(-999_000, 1_000), Standing.CORRECTED),
        (Offset(999_001, 1_000), Standing.SKEWED),
        (Offset(0, 1_000_001), Standing.SKEWED),
        (Offset(3_600_000_000, 100), Standing.SKEWED),
    ],
)
def test_a_peer_is_classed_by_offset_and_bound_together(offset: Offset, standing: Standing) -> None:
    assert offset.standing is standing


def test_nothing_is_known_before_two_exchanges_agree() -> None:
    estimator = OffsetEstimator(0)
    assert estimator.standing is Standing.UNKNOWN
    exchange(estimator, 0, 5_000_000, 100, 100)
    assert estimator.standing is Standing.UNKNOWN, "one exchange may be a bad one"
    exchange(estimator, 1_000, 0, 100, 100)
    assert estimator.standing is Standing.UNKNOWN, "they contradict each other"
    exchange(estimator, 2_000, 0, 100, 100)
    assert estimator.standing is Standing.SYNCHRONISED


@given(st.integers(0, 7), st.integers(60_000, 10**9), st.sampled_from([1, -1]))
def test_no_single_bad_exchange_moves_the_estimate(position: int, wrong_us: int, sign: int) -> None:
    estimator, now_us = OffsetEstimator(0), 0
    for number in range(8):
        error_us = sign * wrong_us if number == position else 0
        now_us = exchange(estimator, now_us, error_us, 300, 300) + 1_000
        assert estimator.standing in (Standing.SYNCHRONISED, Standing.UNKNOWN)
    assert estimator.standing is Standing.SYNCHRONISED


@given(st.integers(0, 1), st.integers(2, 3))
def test_a_clock_that_was_set_is_followed_once_three_exchanges_in_a_row_say_so(bad: int, agreeing: int) -> None:
    estimator, now_us = OffsetEstimator(0), 0
    for _ in range(8 + bad):
        now_us = exchange(estimator, now_us, 0, 300, 300) + 1_000
    for _ in range(agreeing):
        now_us = exchange(estimator, now_us + PERIOD_US, 400_000, 300, 300)
    assert estimator.standing is (Standing.CORRECTED if agreeing == 3 else Standing.SYNCHRONISED)


def test_impossible_stamps_are_refused() -> None:
    estimator = OffsetEstimator(0)
    estimator.on_stamps(1, 1_000, 500, 2_000_500, 2_000)  # the peer says it thought for longer than we waited
    estimator.on_stamps(1, 1_000, 500, 400, 2_000)
    estimator.on_stamps(1, 1_000, 500, 600, 900)
    assert (estimator.refused, estimator.standing) == (3, Standing.UNKNOWN)


def test_a_restarted_peer_is_measured_anew() -> None:
    estimator, now_us = OffsetEstimator(0), 0
    for _ in range(8):
        now_us = exchange(estimator, now_us, 0, 300, 300)
    assert estimator.due(now_us) == 0
    exchange(estimator, now_us, 700_000, 300, 300, boot=2)
    assert estimator.standing is Standing.UNKNOWN
    assert estimator.due(now_us + 1_000) == 7, "what is missing of eight, at once"


def test_eight_exchanges_at_once_then_one_every_five_seconds() -> None:
    estimator = OffsetEstimator(0)
    assert estimator.due(0) == 8
    assert estimator.due(0) == 0
    for number in range(6):
        exchange(estimator, number, 0, 300, 300)
    assert estimator.due(1_000_000) == 2, "two were lost"
    for _ in range(2):
        end_us = exchange(estimator, 1_000_000, 0, 300, 300)
    assert estimator.deadline_us == end_us + PERIOD_US
    assert estimator.due(end_us + PERIOD_US - TOGETHER_US - 1) == 0
    assert estimator.due(end_us + PERIOD_US - TOGETHER_US) == 1, "with those of others"


def asked_after(offsets: ClockOffsets, unit: str, boot: int, at_us: int) -> list[Ask]:
    """What is asked at an instant of a peer that appeared when the rush of meeting had still to pass."""
    offsets.on_appeared(unit, boot, at_us - SETTLE_US)
    assert offsets.deadline_us == at_us
    assert offsets.on_time(at_us - 1) == []
    return offsets.on_time(at_us)


def test_two_nodes_measure_each_other_over_the_wire() -> None:
    mine, theirs = ClockOffsets(1, count(1)), ClockOffsets(2, count(1))
    asks = asked_after(mine, "b", 2, 1_000_000)
    assert len(asks) == 8
    for ask in asks[:5]:
        answer, _end = theirs.on_asked(Asked(ask.question, ask.key, 1_250_100, ask.payload), 1_250_120)
        assert isinstance(answer, Answer)
        assert mine.on_answered(Answered(ask.question, answer.key, 1_000_220, answer.payload))
        assert not mine.on_answered(Answered(ask.question, answer.key, 9_000_220, answer.payload)), "once only"
    offset = mine.of("b")
    assert offset is not None
    assert abs(offset.offset_us - 250_000) <= offset.bound_us <= 200
    assert mine.standing("b") is Standing.CORRECTED
    assert all(mine.on_ask_ended(AskEnded(ask.question, 2_000_000)) for ask in asks[5:])
    mine.on_gone("b")
    assert (mine.of("b"), mine.on_time(60_000_000)) == (None, [])
    assert len(asked_after(mine, "b", 2, 60_000_000)) == 8
    assert mine.of("b") == offset, "the same incarnation is known already"
    mine.on_gone("b")
    mine.on_appeared("b", 3, 70_000_000)
    assert mine.of("b") is None


def test_an_answer_that_is_malformed_or_to_another_question_teaches_nothing() -> None:
    mine, theirs = ClockOffsets(1, count(1)), ClockOffsets(2, count(1))
    first, *rest = asked_after(mine, "b", 2, 1_000_000)
    other = asked_after(ClockOffsets(1, count(1)), "b", 2, 5)[0]
    answer, _end = theirs.on_asked(Asked(1, first.key, 1_000_100, other.payload), 1_000_100)
    assert isinstance(answer, Answer)
    mine.on_answered(Answered(first.question, answer.key, 1_000_200, answer.payload))
    mine.on_answered(Answered(rest[0].question, answer.key, 1_000_200, b"\xc1"))
    assert (mine.refused, mine.of("b")) == (2, None)
