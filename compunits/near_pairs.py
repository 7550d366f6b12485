"""Pairs of cars that are near each other: of hundreds that are seen most have nothing to do with each other.

`Pairs` makes all pairs of a set of names; the cost of units over them grows with the square of their number.
`NearPairs` takes places.
"""

from collections.abc import Iterator
from math import hypot
from typing import Final

from dyknow import US_PER_S, Sample, Value, computational_unit
from dyknow.compunits.numeric import numbers_of, positive

_KEPT: Final = 1.2
"""A pair remains one until it is that much farther apart: units of pairs that come and go restart each time."""
_APART_US: Final = 2 * US_PER_S
"""It is a pair for so long while it is farther apart: of a car that was hidden it can still be seen what it has passed."""
_UNSEEN_US: Final = 5 * US_PER_S
_PLACED: Final = 3


@computational_unit("pairs", "?object")
class NearPairs:
    """Pairs of two different cars within `metres`, in both orders; an output whenever the set changes.

    Its input is the stream of all cars, `seen_cars`: a symbol, metres east and north, and further fields. A car is
    there until its last sample, one whose last field is true, as `end` is, or until it was not seen for 5 s.

    Args:
        metres: 100; it is a pair until it has been 1.2 times as far apart for 2 s.
    """

    def __init__(self, metres: float = 100.0) -> None:
        self._within_m = positive("metres", metres)
        self._places: dict[str, tuple[float, float]] = {}
        self._seen_us: dict[str, int] = {}
        self._near: dict[str, set[str]] = {}
        self._apart_us: dict[frozenset[str], int] = {}

    def __call__(self, _now_us: int, sample: Sample) -> Value:
        value = sample.value
        if not isinstance(value, tuple) or len(value) < _PLACED or not isinstance(value[0], str):
            return None
        name, now_us = value[0], sample.valid_us
        if now_us < self._seen_us.get(name, now_us):
            return None
        has_changed = sum(self._leave(each) for each in [*self._gone(now_us)]) > 0
        place = numbers_of(value[1:_PLACED], 2)
        if place is None or value[-1] is True:
            has_changed |= self._leave(name)
        else:
            has_changed |= self._move(name, now_us, (place[0], place[1]))
        return tuple((one, other) for one in self._near for other in self._near[one]) if has_changed else None

    def _gone(self, now_us: int) -> Iterator[str]:
        """The cars that were not seen for too long: cars are in the order in which they were seen last."""
        for name, seen_us in self._seen_us.items():
            if now_us - seen_us <= _UNSEEN_US:
                return
            yield name

    def _leave(self, name: str) -> bool:
        self._places.pop(name, None)
        self._seen_us.pop(name, None)
        others = self._near.pop(name, ())
        self._apart_us = {pair: since_us for pair, since_us in self._apart_us.items() if name not in pair}
        for other in others:
            self._near[other].discard(name)
        return bool(others)

    def _move(self, name: str, now_us: int, place: tuple[float, float]) -> bool:
        """A car is somewhere; whether that makes a pair or ends one."""
        self._seen_us.pop(name, None)
        self._places[name], self._seen_us[name] = place, now_us
        near, (x_m, y_m) = self._near.setdefault(name, set()), place
        has_changed = False
        for other, (other_x_m, other_y_m) in self._places.items():
            apart_m, is_pair = hypot(other_x_m - x_m, other_y_m - y_m), other in near
            if other == name or (apart_m <= self._within_m * (_KEPT if is_pair else 1.0)) == is_pair:
                if is_pair and self._apart_us:
                    self._apart_us.pop(frozenset((name, other)), None)
                continue
            if is_pair:
                pair = frozenset((name, other))
                if now_us - self._apart_us.setdefault(pair, now_us) < _APART_US:
                    continue
                del self._apart_us[pair]
            has_changed = True
            for ours, theirs in ((near, other), (self._near[other], name)):
                (ours.discard if is_pair else ours.add)(theirs)
        return has_changed
