"""Items that arrive over time, handed from the node thread to the program that iterates them."""

import asyncio
import threading
from collections import deque
from typing import Generic, Self, TypeVar

T = TypeVar("T")
CAPACITY = 10_000


class Feed(Generic[T]):
    """Items in the order in which they arrived; iterate it with `for`, or with `async for` in an event loop.

    The iteration ends when the feed or its connection is closed. Also a context manager, which closes it.

    Attributes:
        dropped: how many items gave way to newer ones since more than 10 000 waited.

    Raises:
        FederationFailed: by the iteration: no more can come, for example because all platforms are gone.
    """

    def __init__(self) -> None:
        self.dropped = 0
        self._items: deque[T] = deque()
        self._changed = threading.Condition()
        self._waiters: list[tuple[asyncio.AbstractEventLoop, asyncio.Future[None]]] = []
        self._is_closed = False
        self._error: Exception | None = None

    @property
    def is_closed(self) -> bool:
        """Whether nothing new is taken."""
        return self._is_closed

    def put(self, item: T) -> None:
        """Add an item; from any thread."""
        with self._changed:
            if self._is_closed:
                return
            if len(self._items) >= CAPACITY:
                self._items.popleft()
                self.dropped += 1
            self._items.append(item)
            self._wake()

    def close(self, error: Exception | None = None) -> None:
        """Take no more; an iterator gets the remaining items, then `error`, if there is one. From any thread."""
        with self._changed:
            if not self._is_closed:
                self._is_closed, self._error = True, error
                self._wake()

    def get(self, timeout_s: float | None = None) -> T | None:
        """The next item, or None: none came within `timeout_s` seconds, or the feed is closed.

        Raises:
            FederationFailed: no more can come.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._items or self._is_closed, timeout_s)
            return self._next()

    def _next(self) -> T | None:
        if self._items:
            return self._items.popleft()
        if self._error is not None:
            raise self._error
        return None

    def _wake(self) -> None:
        self._changed.notify_all()
        for loop, waiter in self._waiters:
            loop.call_soon_threadsafe(_resolve, waiter)
        self._waiters.clear()

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> T:
        item = self.get()
        if item is None:
            raise StopIteration
        return item

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> T:
        loop = asyncio.get_running_loop()
        while True:
            with self._changed:
                if self._items or self._is_closed:
                    item = self._next()
                    break
                waiter = loop.create_future()
                self._waiters.append((loop, waiter))
            await waiter
        if item is None:
            raise StopAsyncIteration
        return item

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_raised: object) -> None:
        self.close()


def _resolve(waiter: "asyncio.Future[None]") -> None:
    if not waiter.done():
        waiter.set_result(None)
