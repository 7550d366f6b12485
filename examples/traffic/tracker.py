"""What a tracker and a dispatcher would say of streets.kpl: a car stands on the main road, others drive past it."""

from collections.abc import Iterator

from dyknow import Value, source

PERIOD_US = 500_000


@source("seen-object")
def tracker(from_us: int) -> Iterator[tuple[int, Value]]:
    """One car stands, and each 25 s another one drives past it in the other lane."""
    valid_us = -(-from_us // PERIOD_US) * PERIOD_US
    while True:
        yield valid_us, ("car1", 150.0, -1.75)
        number, at_s = divmod(valid_us / 1e6, 25.0)
        yield valid_us, (f"other{int(number)}", 290.0 - 11.0 * at_s, 1.75)
        valid_us += PERIOD_US


@source("wanted-route")
def dispatcher(from_us: int) -> Iterator[tuple[int, Value]]:
    """An ambulance and a crane want to get from the station to the hospital."""
    yield from_us, ("ambulance", "station", "hospital", 2.6)
    yield from_us, ("crane", "station", "hospital", 6.0)
