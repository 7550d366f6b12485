"""Which platforms do not keep what they propose, over all calls of one member. Times are the node clock."""

from collections import deque
from collections.abc import Iterator
from typing import Final, NamedTuple

WITHIN_US: Final = 600_000_000
FAILURES: Final = 2
"""Two proposals that were taken and not kept, within that time, are no accident: others are taken first."""
MOST: Final = 256


class Unkept(NamedTuple):
    """The condition of a unit, in words, since when and until when."""

    text: str
    since_us: int
    until_us: int


class KeptRecord:
    """The proposals taken of each unit, and those that failed while its platform was there to keep them."""

    def __init__(self) -> None:
        self._failed_us: dict[str, deque[int]] = {}
        self._taken_us: dict[str, deque[int]] = {}
        self._misstated: dict[str, Unkept] = {}

    def on_taken(self, unit: str, now_us: int) -> None:
        """A proposal of the unit was taken."""
        _add(self._taken_us, unit, now_us)

    def on_failed(self, unit: str, now_us: int) -> None:
        """It was not kept."""
        _add(self._failed_us, unit, now_us)

    def on_misstated(self, unit: str, what: str, now_us: int) -> None:
        """The unit proposed something else than it announces."""
        before = self._misstated.pop(unit, None)
        since_us = now_us if before is None or now_us >= before.until_us else before.since_us
        self._misstated[unit] = Unkept(f"platform {unit} proposes {what}", since_us, now_us + WITHIN_US)
        if len(self._misstated) > MOST:
            del self._misstated[next(iter(self._misstated))]

    def forgive(self, unit: str) -> None:
        """The last one that failed did so since its platform was cut off, or died."""
        if failed_us := self._failed_us.get(unit):
            failed_us.pop()

    def is_unreliable(self, unit: str, now_us: int) -> bool:
        """Whether it has not kept several lately."""
        return len(_recent(self._failed_us, unit, now_us)) >= FAILURES

    def shown(self, now_us: int) -> Iterator[Unkept]:
        """The conditions of units."""
        for unit in self._failed_us:
            failed_us = _recent(self._failed_us, unit, now_us)
            if len(failed_us) >= FAILURES:
                taken = len(_recent(self._taken_us, unit, now_us))
                text = f"platform {unit} has not kept {len(failed_us)} of {taken} proposals that were taken"
                yield Unkept(text, failed_us[FAILURES - 1], failed_us[-FAILURES] + WITHIN_US)
        yield from (each for each in self._misstated.values() if now_us < each.until_us)


def _recent(times: dict[str, deque[int]], unit: str, now_us: int) -> list[int]:
    return [at_us for at_us in times.get(unit, ()) if now_us < at_us + WITHIN_US]


def _add(times: dict[str, deque[int]], unit: str, now_us: int) -> None:
    times.setdefault(unit, deque(maxlen=MOST)).append(now_us)
    if len(times) > MOST:
        del times[next(iter(times))]
