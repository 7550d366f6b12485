"""The source of turning.kpl: a car that drives from link l1 through a crossing to link l7, every six seconds."""

from collections.abc import Iterator

from dyknow import source

PERIOD_US = 1_000_000
DRIVEN = ("l1", "l1", "no_link", "no_link", "l7", "l7")


@source("link")
def on_link(from_us: int) -> Iterator[tuple[int, str]]:
    """The link that the car is on."""
    valid_us = -(-from_us // PERIOD_US) * PERIOD_US
    while True:
        yield valid_us, DRIVEN[valid_us // PERIOD_US % len(DRIVEN)]
        valid_us += PERIOD_US
