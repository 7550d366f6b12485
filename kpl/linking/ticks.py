"""Percepts of several sensors in the order of their valid times, however late each of them comes.

The percepts of one sensor at one time are a tick. With one sensor it is complete at the end of the instant that brought
it. With several it waits until all have been heard of that time or a later one, but not longer than one of them has
been late, and `MOST_WAIT_US` at most.
"""

from collections.abc import Collection, Iterator
from typing import Final

from dyknow import US_PER_S
from dyknow.anchoring.links.structures import Percept

MOST_WAIT_US: Final = US_PER_S
_NEVER_US: Final = -(2**62)
LEAST_WAIT_US: Final = 20_000
"""With several sensors: samples of one time come one after the other."""


class PerceptTicks:
    """Ticks that are not complete.

    Args:
        sensors: their number.

    Attributes:
        delay_us: the longest time that percepts were late.
    """

    def __init__(self, sensors: int) -> None:
        self._heard_us: list[int | None] = [None] * sensors
        self._ticks: dict[int, dict[tuple[str, str], Percept]] = {}
        self.delay_us = 0

    @property
    def wait_us(self) -> int:
        """How long a tick is waited for."""
        return 0 if len(self._heard_us) < 2 else min(MOST_WAIT_US, self.delay_us) + LEAST_WAIT_US

    @property
    def behind_us(self) -> int:
        """No percept comes that was valid longer ago than this."""
        return max(self.delay_us, self.wait_us)

    def on_late(self, late_us: int) -> None:
        """A percept came too late: the next ones are waited for."""
        if len(self._heard_us) > 1:
            self.delay_us = max(self.delay_us, min(MOST_WAIT_US, late_us))

    def take(self, sensor: int, percept: Percept, valid_us: int, available_us: int) -> None:
        """A percept has a sample; of several of one time the last one counts."""
        self.delay_us = max(self.delay_us, available_us - valid_us)
        heard_us = self._heard_us[sensor]
        self._heard_us[sensor] = valid_us if heard_us is None else max(heard_us, valid_us)
        self._ticks.setdefault(valid_us, {})[percept.type, percept.symbol] = percept

    def complete(self, now_us: int) -> Iterator[tuple[int, Collection[Percept]]]:
        """The complete ticks, the earliest first; they are taken out."""
        heard_us = [_NEVER_US if each is None else each for each in self._heard_us]
        until_us = max(now_us - self.wait_us, min(heard_us))
        for valid_us in sorted(each for each in self._ticks if each <= until_us):
            yield valid_us, self._ticks.pop(valid_us).values()

    @property
    def deadline_us(self) -> int | None:
        """When the earliest is complete at the latest."""
        return min(self._ticks) + self.wait_us if self._ticks else None
