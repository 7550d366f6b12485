"""When a host lets each of its knowledge processes work (thesis 5.3): by priority, in batches, along chains."""

from collections import deque
from collections.abc import Hashable, Iterable
from heapq import heapify, heappop, heappush, heapreplace
from typing import Generic, TypeVar

P = TypeVar("P", bound=Hashable)
I = TypeVar("I")  # noqa: E741  (an item that a process works on)


class Scheduler(Generic[P, I]):
    """Selects the process that works next, and its item. An action is the work on one batch; it is not interrupted.

    Of the processes for which a batch waits the one of the highest priority is next, of equals the one whose oldest
    item has waited longest. With `train` the outputs of an item are processed by other processes before anything
    else, from the start of the chain to its end: each item of a batch passes the whole chain before the next one does.

    Args:
        batch: how many items of a process must wait before it works, on all of them.
        train: whether chains are one action.
        bound: most items of a process that wait, the newest; older ones are dropped and counted in `dropped`.

    Raises:
        ValueError: a batch of less than 1 item, or of more than can wait.
    """

    __slots__ = ("_action", "_arrivals", "_batch", "_bound", "_priorities", "_ready", "_train", "_waiting", "dropped")

    def __init__(self, batch: int = 1, *, train: bool = False, bound: int = 4096) -> None:
        if not 1 <= batch <= bound:
            raise ValueError(f"batch: expected 1 to {bound} samples, got {batch}")
        self._batch, self._train, self._bound = batch, train, bound
        self._priorities: dict[P, int] = {}
        self._waiting: dict[P, deque[tuple[int, I]]] = {}
        self._ready: list[tuple[int, int, P]] = []  # per process with a batch: -priority, arrival of its oldest item
        self._action: deque[tuple[P, I]] = deque()
        self._arrivals = self.dropped = 0

    def __len__(self) -> int:
        """How many items wait, those of the current action included."""
        return len(self._action) + sum(map(len, self._waiting.values()))

    @property
    def acting(self) -> bool:
        """Whether an action has begun and is not over."""
        return bool(self._action)

    def add(self, process: P, priority: int = 0) -> None:
        """Add a process without waiting items; a process of higher priority works before others."""
        self.remove(process)
        self._priorities[process] = priority
        self._waiting[process] = deque()

    def remove(self, process: P) -> None:
        """Remove a process and its waiting items, if it is there."""
        self._priorities.pop(process, None)
        self._waiting.pop(process, None)
        self._ready = [each for each in self._ready if each[2] != process]
        heapify(self._ready)
        self._action = deque(each for each in self._action if each[0] != process)

    def put(self, process: P, item: I) -> None:
        """Add an item for a process, from outside; it is dropped if the process does not exist."""
        waiting = self._waiting.get(process)
        if waiting is None:
            return
        self._arrivals += 1
        waiting.append((self._arrivals, item))
        if len(waiting) == self._batch:
            heappush(self._ready, (-self._priorities[process], waiting[0][0], process))
        if len(waiting) > self._bound:
            waiting.popleft()
            self.dropped += 1

    def follow(self, items: Iterable[tuple[P, I]]) -> None:
        """Add the outputs of the last item for other processes, in the order of their turns."""
        if self._train:
            self._action.extendleft(reversed([each for each in items if each[0] in self._priorities]))
        else:
            for process, item in items:
                self.put(process, item)

    def next(self) -> tuple[P, I] | None:
        """Which process is to work on which item now; None: there is no batch to begin."""
        if not self._action:
            waiting = self._first()
            if waiting is None:
                return None
            _, _, process = heappop(self._ready)
            self._action.extend((process, waiting.popleft()[1]) for _ in range(self._batch))
            if len(waiting) >= self._batch:
                heappush(self._ready, (-self._priorities[process], waiting[0][0], process))
        return self._action.popleft()

    def _first(self) -> deque[tuple[int, I]] | None:
        """The waiting items of the first process; a dropped item keeps no place."""
        while self._ready:
            priority, oldest, process = self._ready[0]
            waiting = self._waiting[process]
            if waiting[0][0] == oldest:
                return waiting
            heapreplace(self._ready, (priority, waiting[0][0], process))
        return None
