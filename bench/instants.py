"""Waiting for instants of the monotonic clock, which all processes of a machine share."""

import time
from collections.abc import Iterator

SPIN_US = 1000
"""So long before its end the waiting stops sleeping: the system's timers are not what is measured."""


def grid(period_us: int, phase_us: int = 0) -> Iterator[int]:
    """Instants of the monotonic clock at multiples of a period, each waited for."""
    due_us = (time.monotonic_ns() // 1000 // period_us + 1) * period_us + phase_us
    while True:
        wait_until(due_us)
        yield due_us
        due_us += period_us


def wait_until(due_us: int) -> None:
    time.sleep(max(0, due_us - SPIN_US - time.monotonic_ns() // 1000) / 1e6)
    while time.monotonic_ns() < due_us * 1000:
        pass
