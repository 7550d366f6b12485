"""Many deadlines, cheaply: a heap whose stale entries are skipped when they surface."""

from collections.abc import Hashable
from heapq import heapify, heappop, heappush
from typing import Generic, TypeVar

K = TypeVar("K", bound=Hashable)


class Deadlines(Generic[K]):
    """When each of many things wants `on_time`. Ties come out in the order in which they were set."""

    def __init__(self) -> None:
        self._due: dict[K, int] = {}
        self._heap: list[tuple[int, int, K]] = []
        self._count = 0
        self._next_us: int | None = None
        self._is_known = True

    def set(self, key: K, due_us: int | None) -> None:
        """`key` is due at `due_us`, or (None) not at all."""
        before_us = self._due.get(key)
        if before_us == due_us:
            return
        if before_us is not None and before_us == self._next_us:
            self._is_known = False
        if due_us is None:
            del self._due[key]
            return
        self._due[key] = due_us
        self._count += 1
        heappush(self._heap, (due_us, self._count, key))
        if self._is_known and (self._next_us is None or due_us < self._next_us):
            self._next_us = due_us
        if len(self._heap) > 64 + 4 * len(self._due):
            self._heap = [entry for entry in self._heap if self._due.get(entry[2]) == entry[0]]
            heapify(self._heap)

    def pop_due(self, now_us: int) -> list[K]:
        """Everything due by `now_us`, earliest first; it has to be set again to be due again."""
        found: list[K] = []
        heap = self._heap
        while heap and heap[0][0] <= now_us:
            due_us, _, key = heappop(heap)
            if self._due.get(key) == due_us:
                del self._due[key]
                found.append(key)
                self._is_known = False
        return found

    @property
    def next_us(self) -> int | None:
        """The earliest deadline, or None."""
        if not self._is_known:
            self._is_known, self._next_us = True, self._earliest_us()
        return self._next_us

    def _earliest_us(self) -> int | None:
        heap, due = self._heap, self._due
        while heap:
            due_us, _, key = heap[0]
            if due.get(key) == due_us:
                return due_us
            heappop(heap)
        return None
