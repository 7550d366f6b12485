"""Looks from streams: percepts of one source at one time, and its view at that time.

A look of the only source, if that is the platform's own, is complete at the end of its instant. Others wait until every
source has reported something later, at most `PATIENCE_US`; then all looks up to it are taken in the order of time. A
percept for a time before the looks that were taken is left out and counted.
"""

from collections import Counter
from collections.abc import Sequence
from typing import Final, NamedTuple

from dyknow import US_PER_S
from dyknow.anchoring.belief.arrays import Floats
from dyknow.anchoring.links.structures import Percept

PATIENCE_US: Final = 400_000
VIEW_LASTS_US: Final = US_PER_S
"""How long a view counts for percepts that come without one."""
MOST_PERCEPTS: Final = 2_000
"""Limit of the percepts of one source and time; the others are left out."""
MOST_WAITING: Final = 256
"""Looks that wait; then the first is taken as it is."""


class SourceLook(NamedTuple):
    """The reports of one source for one time.

    Attributes:
        source: which, counted from 0.
        view_m: corners of its view; None: it is not known.
        certainty: the least with which a percept came: how far its deliverer trusts the source.
    """

    valid_us: int
    source: int
    percepts: list[Percept]
    view_m: Floats | None
    certainty: float = 1.0


class LookGatherer:
    """Looks of several sources.

    Args:
        is_own: of each source, whether all of one time comes at one instant.

    Attributes:
        left_out: counts of percepts that were not taken, by reason.
    """

    def __init__(self, is_own: Sequence[bool]) -> None:
        self._newest_us: list[int | None] = [None] * len(is_own)
        self._waits = len(is_own) > 1 or not all(is_own)
        self._looks: dict[tuple[int, int], SourceLook] = {}
        self._arrived_us: dict[tuple[int, int], int] = {}
        self._views: dict[int, tuple[int, Floats]] = {}
        self._taken_us: int | None = None
        self.left_out: Counter[str] = Counter()

    def on_percept(self, source: int, valid_us: int, percept: Percept, now_us: int, certainty: float = 1.0) -> None:
        """A percept that has a state, or has ended: then it says only that there was a look."""
        look = self._look(source, valid_us, now_us)
        if look is None or percept.state is None:
            return
        if len(look.percepts) >= MOST_PERCEPTS:
            self.left_out["percepts beyond the most of one time"] += 1
            return
        look.percepts.append(percept)
        self._looks[valid_us, source] = look._replace(certainty=min(look.certainty, certainty))

    def on_view(self, source: int, valid_us: int, view_m: Floats, now_us: int) -> None:
        """Note the view of a source."""
        look = self._look(source, valid_us, now_us)
        if look is not None:
            self._looks[valid_us, source] = look._replace(view_m=view_m)

    def ready(self, now_us: int) -> list[SourceLook]:
        """The looks that are complete, in the order of time."""
        if not self._looks:
            return []
        until_us = self._complete_until_us(now_us)
        keys = sorted(key for key in self._looks if key[0] <= until_us)
        found = []
        for key in keys:
            look = self._looks.pop(key)
            del self._arrived_us[key]
            self._taken_us = look.valid_us
            found.append(self._viewed(look))
        return found

    @property
    def deadline_us(self) -> int | None:
        """When the first look is taken as it is."""
        return min(self._arrived_us.values()) + PATIENCE_US if self._arrived_us else None

    def _look(self, source: int, valid_us: int, now_us: int) -> SourceLook | None:
        if self._taken_us is not None and valid_us <= self._taken_us:
            self.left_out["reports of a time that is over"] += 1
            return None
        newest_us = self._newest_us[source]
        self._newest_us[source] = valid_us if newest_us is None else max(newest_us, valid_us)
        self._arrived_us.setdefault((valid_us, source), now_us)
        return self._looks.setdefault((valid_us, source), SourceLook(valid_us, source, [], None))

    def _complete_until_us(self, now_us: int) -> int:
        newest_us = max(valid_us for valid_us, _ in self._looks)
        if not self._waits:
            return newest_us
        waited = [key[0] for key, arrived_us in self._arrived_us.items() if now_us >= arrived_us + PATIENCE_US]
        if len(self._looks) > MOST_WAITING:
            waited.append(min(valid_us for valid_us, _ in self._looks))
        heard = [each for each in self._newest_us if each is not None]
        later = min(heard) - 1 if len(heard) == len(self._newest_us) else -(2**80)
        return max([later, *waited])

    def _viewed(self, look: SourceLook) -> SourceLook:
        """With the view of shortly before, where its own is not known."""
        if look.view_m is not None:
            self._views[look.source] = look.valid_us, look.view_m
            return look
        known = self._views.get(look.source)
        if known is None or look.valid_us - known[0] > VIEW_LASTS_US:
            return look
        return look._replace(view_m=known[1])
