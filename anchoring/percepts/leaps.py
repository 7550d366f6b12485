"""Samples of a percept that lie farther from the one before than anything gets in the time between."""

from itertools import islice
from typing import Final

from dyknow import US_PER_S
from dyknow.anchoring.links.states import ObjectState
from dyknow.anchoring.links.structures import Percept

REACH_M_S: Final = 1000.0
REACH_M: Final = 100.0
"""A sample is no leap if it is within this, ten standard deviations, and what `REACH_M_S` allows for."""
_REMEMBERED_US: Final = 10 * US_PER_S


class PerceptLeaps:
    """The latest place of each percept. After two leaps to one place the percept is there."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, str], tuple[ObjectState, ObjectState | None]] = {}

    def leap_m(self, percept: Percept) -> float | None:
        """How far the percept is from where it was, if it cannot be there."""
        key, state = (percept.type, percept.symbol), percept.state
        before, doubted = self._known.pop(key, (None, None))
        if state is None:
            return None
        is_leap = before is not None and not any(_reaches(one, state) for one in (before, doubted) if one is not None)
        self._known[key] = (before, state) if before is not None and is_leap else (state, None)
        for old, (last, _) in list(islice(self._known.items(), 2)):
            if state.valid_us - last.valid_us > _REMEMBERED_US:
                del self._known[old]
        return before.distance_m(state) if before is not None and is_leap else None


def _reaches(one: ObjectState, other: ObjectState) -> bool:
    seconds = abs(other.valid_us - one.valid_us) / US_PER_S
    reach_m = REACH_M + REACH_M_S * seconds + 10.0 * (one.deviation_m + other.deviation_m)
    return one.distance_m(other) <= reach_m
