import time

import pytest

from dyknow.runtime.clock import NodeClock


def test_the_node_clock_is_utc_and_does_not_go_back() -> None:
    clock = NodeClock()
    before_us = time.time_ns() // 1000
    shown = [clock.now_us() for _ in range(1000)]
    assert abs(shown[0] - before_us) < 50_000
    assert shown == sorted(shown)


def test_a_skewed_clock_is_wrong_by_what_was_asked_for() -> None:
    right, wrong = NodeClock(), NodeClock(skew_us=3_600_000_000)
    assert abs(wrong.now_us() - right.now_us() - 3_600_000_000) < 50_000


def test_a_process_that_is_interrupted_between_the_two_clocks_has_the_right_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """All but one of the readings are interrupted for 9 ms, before or after UTC is read."""
    monotonic_ns, interrupted = [0], iter([2, 1, 2, 0, 1, 1, 2, 2])

    def monotonic() -> int:
        monotonic_ns[0] += 100
        return monotonic_ns[0]

    def utc() -> int:
        at = next(interrupted)
        monotonic_ns[0] += 9_000_000 * (at == 1)
        now_ns = 1_700_000_000_000_000_000 + monotonic_ns[0]
        monotonic_ns[0] += 9_000_000 * (at == 2)
        return now_ns

    monkeypatch.setattr("time.monotonic_ns", monotonic)
    monkeypatch.setattr("time.time_ns", utc)
    assert abs(NodeClock().monotonic_offset_us - 1_700_000_000_000_000) <= 1
