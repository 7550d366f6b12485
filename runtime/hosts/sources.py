"""Sources that a host reads: each in a thread of its own, because a real sensor is waited for."""

import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from dyknow import Reading, Sample, SourcePrototype
from dyknow.agents.hosts.knowledge_host import Read, on_grid, reading
from dyknow.federation.hosts.messages import KEPT
from dyknow.policies.sampling import Grid


class SourceThread:
    """Reads one source until `rest`; while an earlier reader of the same source is still in it, it waits.

    Attributes:
        grid: the wanted valid times; None: all.

    Args:
        read: the source to read.
        after: threads that read the same source before; they have been ended, but may still be waiting for its sensor.
        now_us: federation time; `wall_s` seconds pass while so much of it does.
        post: takes what was read at one instant.
        fault: takes what is wrong with the source.
    """

    def __init__(
        self,
        read: Read,
        after: Sequence["SourceThread"],
        now_us: Callable[[], int],
        wall_s: Callable[[int], float],
        post: Callable[["SourceThread", Sequence[Sample]], None],
        fault: Callable[[int, str], None],
    ) -> None:
        self.process, self.source = read.process, read.source
        self.grid: Grid | None = read.grid
        self._from_us = read.from_us
        self._after: Sequence[SourceThread] = after
        self._now_us, self._wall_s, self._post, self._fault = now_us, wall_s, post, fault
        self._over = threading.Event()
        self._lock = threading.Lock()
        self._left: deque[Sequence[Sample]] = deque(maxlen=KEPT)
        self._thread = threading.Thread(target=self._run, name=f"source {read.source.name}", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def rest(self) -> None:
        """Read no more, as soon as the source lets go."""
        self._over.set()

    @property
    def is_at_rest(self) -> bool:
        """Whether the source has let go."""
        return not self._thread.is_alive()

    def leave(self, samples: Sequence[Sample]) -> bool:
        """Leave a reading for the thread that owns the processes, which must be notified if this is True; the newest are kept."""
        with self._lock:
            self._left.append(samples)
            return len(self._left) == 1

    def taken(self) -> list[Sequence[Sample]]:
        """Take the readings that wait for that thread."""
        with self._lock:
            left = list(self._left)
            self._left.clear()
        return left

    def _run(self) -> None:
        for before in self._after:
            before._thread.join()  # noqa: SLF001  (one of its own kind)
        self._after = ()
        if self._over.is_set():
            return
        name = self.source.name
        try:
            readings = _begun(self.source, self._from_us)
        except Exception as wrong:  # noqa: BLE001  (it is a user's code)
            self._fault(self.process, f"{name} cannot be read: {wrong!r}")
            return
        try:
            for valid_us, value in readings:
                now_us = self._now_us()
                samples = reading(valid_us, value, now_us)
                at_us = samples[0].valid_us if samples else now_us
                if self._over.wait(self._wall_s(max(0, at_us - now_us))):
                    break
                if samples and on_grid(at_us, self.grid):
                    self._post(self, samples)
        except Exception as wrong:  # noqa: BLE001  (it is a user's code)
            self._fault(self.process, f"{name} raised {wrong!r}; it is read no more")
        finally:
            _closed(readings)


def _begun(source: SourcePrototype, from_us: int) -> Iterator[Reading]:
    if source.read is None:
        raise TypeError("it has no function that reads it")
    return iter(source.read(from_us))


def _closed(readings: Any) -> None:
    if hasattr(readings, "close"):
        readings.close()
