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

    def set(self, key: K, due_us: int | None) -> None:
        """`key` is due at `due_us`, or (None) not at all."""
        if due_us is None:
            self._due.pop(key, None)
            return
        if self._due.get(key) == due_us:
            return
        self._due[key] = due_us
        self._count += 1
        heappush(self._heap, (due_us, self._count, key))
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
        return found

    @property
    def next_us(self) -> int | None:
        """The earliest deadline, or None."""
        heap = self._heap
        while heap and self._due.get(heap[0][2]) != heap[0][0]:
            heappop(heap)
        return heap[0][0] if heap else None
