"""The evaluations of an unlinked object, until it is linked."""

from bisect import bisect_left
from typing import Final, NamedTuple

from dyknow.anchoring.links.states import ObjectState
from dyknow.reasoning import Progressing

_MOST_TIMES: Final = 1024


class ReestablishPair(NamedTuple):
    """A reestablish condition for one object of B that became available at `available_us`; None: it has ended."""

    available_us: int
    evaluation: Progressing | None


class Unlinked:
    """The evaluations of one object of A.

    Attributes:
        from_us: no state before takes part.
        establish: None once it has ended.
        pairs: by the symbol of the object of B; those never near are not in it.
        estimate: the latest state of the object of B that it would be; None: it is not asked for.
    """

    def __init__(self, from_us: int, establish: Progressing) -> None:
        self.from_us = from_us
        self.establish: Progressing | None = establish
        self.pairs: dict[str, ReestablishPair] = {}
        self.estimate: ObjectState | None = None
        self._times: list[int] = []
        self._dropped_us = -1

    def on_state(self, valid_us: int, window_us: int | None) -> None:
        """Note a state; those before the window of a condition are dropped."""
        self._times.append(valid_us)
        least_us = valid_us - window_us if window_us is not None else self._times[0]
        count = max(bisect_left(self._times, least_us), len(self._times) - _MOST_TIMES)
        if count:
            self._dropped_us = self._times[count - 1]
            del self._times[:count]

    def start_us(self, available_us: int) -> int | None:
        """The first state in which an object was available; None: so long ago that its window is over."""
        if max(available_us, self.from_us) <= self._dropped_us:
            return None
        return self._times[bisect_left(self._times, available_us)]
