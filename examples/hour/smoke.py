"""A smoke sensor that is carried around, and how fast what it measures rises."""

import math
from collections.abc import Iterator

from dyknow import Sample, computational_unit, source

PERIOD_US = 200_000


@source("smoke")
def nose(from_us: int) -> Iterator[tuple[int, float]]:
    """Milligrams of particles in a cubic metre of air, five times a second: 30 s from one cloud to the next."""
    valid_us = -(-from_us // PERIOD_US) * PERIOD_US
    while True:
        yield valid_us, 12.0 + 10.0 * math.sin(2 * math.pi * valid_us / 30e6)
        valid_us += PERIOD_US


@computational_unit("rise", "smoke")
class Trend:
    """Milligrams in a cubic metre, and second, between the last two samples; nothing before there are two."""

    def __init__(self) -> None:
        self._last: Sample | None = None

    def __call__(self, _now_us: int, smoke: Sample) -> float | None:
        last, self._last = self._last, smoke
        if last is None or smoke.valid_us <= last.valid_us:
            return None
        return (smoke.value - last.value) / (smoke.valid_us - last.valid_us) * 1e6
