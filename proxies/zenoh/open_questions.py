"""Questions that reached us and wait for their answers: bounded in number and in time."""

import threading
from typing import Generic, Protocol, TypeVar

LIMIT = 256
PATIENCE_US = 5_000_000


class OpenQuestion(Protocol):
    """Dropping it ends the question for the requester, which else waits for the whole timeout."""

    def drop(self) -> None: ...


Q = TypeVar("Q", bound=OpenQuestion)


class OpenAsks(Generic[Q]):
    """Questions by number, oldest first. The edge's callbacks add, the node thread takes; hence the lock."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._open: dict[int, tuple[Q, int]] = {}
        self._last = 0
        self.given_up = 0

    def __len__(self) -> int:
        return len(self._open)

    def add(self, question: Q, now_us: int) -> int:
        """The number of `question`. Too old ones, and beyond `LIMIT` the oldest, are ended unanswered and counted."""
        with self._lock:
            while self._open and (len(self._open) >= LIMIT or self._expired(now_us)):
                oldest, _ = self._open.pop(next(iter(self._open)))
                oldest.drop()
                self.given_up += 1
            self._last += 1
            self._open[self._last] = (question, now_us + PATIENCE_US)
            return self._last

    def get(self, number: int) -> Q | None:
        """The question, unless it ended."""
        found = self._open.get(number)
        return None if found is None else found[0]

    def end(self, number: int) -> None:
        """No more answers; does nothing the second time."""
        with self._lock:
            found = self._open.pop(number, None)
        if found is not None:
            found[0].drop()

    def end_all(self) -> None:
        for number in list(self._open):
            self.end(number)

    def _expired(self, now_us: int) -> bool:
        return next(iter(self._open.values()))[1] <= now_us
