"""Events that are remembered: by pattern, by the values of its bound variables, in the order of time."""

from bisect import bisect_left, bisect_right, insort
from collections.abc import Callable, Sequence
from itertools import compress
from operator import itemgetter
from typing import Any, Final, TypeAlias

Key: TypeAlias = Any
"""Values of some variables: a text for one, a tuple for several, () for none."""

Values: TypeAlias = tuple[str | None, ...]
"""An event's arguments, and of a change the old value (None: unknown) and the new one."""

MINUS_INFINITY: Final = -(1 << 60)
"""The time of an initial value (thesis 8.4), in milliseconds."""

SINCE_EVER: Final = -(1 << 59)
"""Instants that an initial value fixes lie before this, and nothing else does."""

FIRST_LIMIT: Final = 16
"""Events of one key that are remembered before it is computed which of them matter."""


def getter(places: Sequence[int]) -> Callable[[Sequence[Any]], Key]:
    """Picks a key from values."""
    return itemgetter(*places) if places else _nothing


def _nothing(_values: Sequence[Any]) -> Key:
    return ()


class Bucket:
    """Events of one pattern and key: `times` ascend, with their `values` in parallel if the pattern distinguishes events.

    Attributes:
        limit: when there are more it is time to forget.
    """

    __slots__ = ("limit", "times", "values")

    def __init__(self) -> None:
        self.times: list[int] = []
        self.values: list[Values] = []
        self.limit = FIRST_LIMIT

    def forget(self, kept: Sequence[bool]) -> None:
        self.times = list(compress(self.times, kept))
        self.values = list(compress(self.values, kept))


class Store:
    """Events of one pattern.

    Attributes:
        buckets: by the values of the pattern's variables.
        latest_ms: time of the event that came last, initial values apart.
        size: events that are remembered.
        initial: whether an initial value has ever come.
    """

    __slots__ = ("_by_places", "_indexes", "buckets", "initial", "latest_ms", "plural", "size")

    def __init__(self, plural: bool) -> None:
        self.buckets: dict[Key, Bucket] = {}
        self.plural = plural
        self._indexes: list[tuple[Callable[[Any], Key], dict[Key, dict[Key, None]]]] = []
        self._by_places: dict[tuple[int, ...], dict[Key, dict[Key, None]]] = {}
        self.latest_ms: int | None = None
        self.size = 0
        self.initial = False

    def index(self, places: Sequence[int]) -> dict[Key, dict[Key, None]]:
        """Keys by some of their values, kept up to date from now on. `places`: which, among several in the key."""
        found = self._by_places.get(tuple(places))
        if found is None:
            found = self._by_places[tuple(places)] = {}
            self._indexes.append((getter(places), found))
        return found

    def insert(self, key: Key, time_ms: int, values: Values) -> int:
        """Remember an event: 0 if it was known already, 1 if another one of its key and time was, else 2."""
        bucket = self.buckets.get(key)
        if bucket is None:
            bucket = self.buckets[key] = Bucket()
            for project, index in self._indexes:
                index.setdefault(project(key), {})[key] = None
        times = bucket.times
        found = 2
        if self.plural:
            found = _insert_plural(bucket, time_ms, values)
        elif not times or times[-1] < time_ms:
            times.append(time_ms)
        elif times[-1] == time_ms or time_ms in times:
            return 0
        else:
            insort(times, time_ms)
        if found:
            if time_ms == MINUS_INFINITY:
                self.initial = True
            else:
                self.latest_ms = time_ms
            self.size += 1
        return found

    def keep(self, key: Key, kept: Sequence[bool]) -> None:
        """Forget the events of a key that are not kept; a key without events is forgotten, too."""
        bucket = self.buckets[key]
        before = len(bucket.times)
        if not all(kept):
            bucket.forget(kept)
            self.size -= before - len(bucket.times)
        bucket.limit = max(FIRST_LIMIT, 2 * len(bucket.times))
        if not bucket.times:
            self._remove(key)

    def drop(self, key: Key, until_ms: int) -> None:
        """Forget the events of a key until a time."""
        bucket = self.buckets.get(key)
        if bucket is not None and bucket.times[0] <= until_ms:
            last = bisect_right(bucket.times, until_ms)
            del bucket.times[:last], bucket.values[:last]
            self.size -= last
            if not bucket.times:
                self._remove(key)

    @property
    def oldest_ms(self) -> int | None:
        """Time of the oldest event of any key."""
        return min((bucket.times[0] for bucket in self.buckets.values()), default=None)

    def _remove(self, key: Key) -> None:
        del self.buckets[key]
        for project, index in self._indexes:
            part = project(key)
            keys = index[part]
            del keys[key]
            if not keys:
                del index[part]


def _insert_plural(bucket: Bucket, time_ms: int, values: Values) -> int:
    times = bucket.times
    at = first = bisect_left(times, time_ms)
    while at < len(times) and times[at] == time_ms:
        if bucket.values[at] == values:
            return 0
        at += 1
    times.insert(at, time_ms)
    bucket.values.insert(at, values)
    return 2 if at == first else 1
