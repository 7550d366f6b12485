"""One mailbox, one thread: the only place that waits. Edges post; this thread alone touches node state."""

import gc
from collections.abc import Callable, Iterable
from pathlib import Path
from queue import Empty
from typing import Final, Protocol, TypeVar

E_contra = TypeVar("E_contra", contravariant=True)
E_co = TypeVar("E_co", covariant=True)
E = TypeVar("E")  # event
F = TypeVar("F")  # effect
F_co = TypeVar("F_co", covariant=True)

BATCH = 64
"""How many events may go before timers are looked at: at 50 us each that is one sleep of 3 ms at most."""


_LOOK_US: Final = 500_000
_TOLERATED, _CROWDED = 0.01, 0.10
"""Parts of the time that a thread waits for a processor: below the one nothing changes, at the other a pause is 20 ms."""
NOTEWORTHY: Final = 0.05
_PAUSE_S, _LONGEST_PAUSE_S = 0.020, 0.060
_STATISTICS: Final = Path("/proc/thread-self/schedstat")


class EventSource(Protocol[E_co]):
    """Bounded by conflation; `get` raises queue.Empty when `timeout` seconds pass without an event."""

    def get(self, timeout: float | None) -> E_co: ...


class SteppedNode(Protocol[E_contra, F_co]):
    """A value that is stepped. `deadline_us` is the next instant at which `on_time` has work."""

    @property
    def deadline_us(self) -> int | None: ...
    def on_event(self, event: E_contra, now_us: int) -> Iterable[F_co]: ...
    def on_time(self, now_us: int) -> Iterable[F_co]: ...


def leave_alone_what_is_loaded() -> None:
    """Let garbage collections pass over what is there now: modules, models and grammars stay as long as the process.

    A full collection would look at them mostly, and stop the node for 40 to 70 ms.
    """
    gc.freeze()


def step(
    node: SteppedNode[E, F],
    mailbox: EventSource[E],
    now_us: Callable[[], int],
    perform: Callable[[F], None],
    timeout_s: float | None = None,
) -> None:
    """Wait for the next event or deadline, at most `timeout_s`; then act: inputs first, timers even under load.

    `now_us` and deadlines are the node clock, which runs as fast as the waiting. Events that wait already are taken in
    one go, at most `BATCH`; the effects of one event are performed before the next is looked at.
    """
    due_us = node.deadline_us
    wait_s = timeout_s if due_us is None else max(0, due_us - now_us()) / 1e6
    if timeout_s is not None and wait_s is not None and timeout_s < wait_s:
        wait_s = timeout_s
    try:
        for _ in range(BATCH):
            for effect in node.on_event(mailbox.get(wait_s), now_us()):
                perform(effect)
            wait_s = 0
    except Empty:
        pass
    due_us = node.deadline_us
    if due_us is not None and due_us <= now_us():
        for effect in node.on_time(now_us()):
            perform(effect)


class Pressure:
    """How busy the machine is, as the thread that asks feels it, and how long its loop should pause for more events.

    A loop that wakes for each sample pays for each with cold caches and two switches of threads. On an idle machine
    that is the quickest way; where threads wait for a processor it is work that makes others late. So the loop takes
    more in one go, the more it has had to wait, and still more where there is too much to do. On systems other than Linux it never pauses.

    Attributes:
        part: of the last half second, waiting for a processor: 0 to 1, smoothed.
        is_news: whether `part` was measured since `reported` was called, and is or was above `NOTEWORTHY`.
    """

    def __init__(self, statistics: Path = _STATISTICS) -> None:
        self._statistics = statistics
        self._looked_us: int | None = None
        self._waited_ns = 0
        self.part = 0.0
        self.is_news = self._was_noteworthy = False

    def reported(self) -> float:
        """Return `part`; it is news no longer."""
        self.is_news, self._was_noteworthy = False, self.part >= NOTEWORTHY
        return self.part

    def pause_s(self, now_us: int) -> float:
        """Return how long to wait for further events after one, in seconds; the load is measured twice a second."""
        if self._looked_us is None or now_us >= self._looked_us + _LOOK_US:
            self._look(now_us)
        if self.part > _CROWDED:
            return min(_LONGEST_PAUSE_S, _PAUSE_S * self.part / _CROWDED)
        return _PAUSE_S * max(0.0, (self.part - _TOLERATED) / (_CROWDED - _TOLERATED))

    def _look(self, now_us: int) -> None:
        try:
            waited_ns = int(self._statistics.read_text().split()[1])
        except (OSError, ValueError, IndexError):
            waited_ns = self._waited_ns
        if self._looked_us is not None:
            part = (waited_ns - self._waited_ns) / 1000 / (now_us - self._looked_us)
            self.part += 0.3 * (min(1.0, part) - self.part)
            self.is_news = self._was_noteworthy or self.part >= NOTEWORTHY
        self._looked_us, self._waited_ns = now_us, waited_ns
