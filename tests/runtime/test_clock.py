import time

from runtime.clock import NodeClock


def test_the_node_clock_is_utc_and_does_not_go_back() -> None:
    clock = NodeClock()
    before_us = time.time_ns() // 1000
    shown = [clock.now_us() for _ in range(1000)]
    assert abs(shown[0] - before_us) < 50_000
    assert shown == sorted(shown)


def test_a_skewed_clock_is_wrong_by_what_was_asked_for() -> None:
    right, wrong = NodeClock(), NodeClock(skew_us=3_600_000_000)
    assert abs(wrong.now_us() - right.now_us() - 3_600_000_000) < 50_000
