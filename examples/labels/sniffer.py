"""A gas sensor that is carried around: what it says rises and falls within 20 s."""

import math
from collections.abc import Iterator

from dyknow import source

PERIOD_US = 500_000


@source("gas")
def sniffer(from_us: int) -> Iterator[tuple[int, float]]:
    """Parts per million, twice a second."""
    valid_us = -(-from_us // PERIOD_US) * PERIOD_US
    while True:
        yield valid_us, 40.0 + 25.0 * math.sin(2 * math.pi * valid_us / 20e6)
        valid_us += PERIOD_US
