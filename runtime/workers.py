"""Threads next to the node thread, in which slow computational units are called.

A call that never returns keeps its thread, and delays neither the node nor its end: the threads are daemons. Python runs
one thread at a time: a unit that computes for long without releasing the interpreter still costs the node up to 5 ms
whenever it wants to continue; such a unit is better off in a process of its own, `dyknow host`.
"""

import threading
import time
from collections.abc import Callable
from queue import SimpleQueue
from typing import Final

from dyknow.agents.effects import Compute, Computed
from dyknow.network.process import Outcome

MOST: Final = 32


class WorkerThreads:
    """Performs `Compute`, each in the next thread that is free; there are as many as there are calls at a time.

    Args:
        post: takes `Computed`; from any thread.
        now_us: the node clock.
        note: takes notes for the user.
    """

    def __init__(
        self, post: Callable[[Computed], None], now_us: Callable[[], int], note: Callable[[str], None]
    ) -> None:
        self._post, self._now_us, self._note = post, now_us, note
        self._queue: SimpleQueue[Compute | None] = SimpleQueue()
        self._lock = threading.Lock()
        self._threads = self._idle = 0
        self._is_told = False

    def perform(self, compute: Compute) -> None:
        """Do it soon; returns at once."""
        with self._lock:
            self._queue.put(compute)
            if self._idle:
                self._idle -= 1
            elif self._threads < MOST:
                self._threads += 1
                threading.Thread(target=self._work, name=f"worker {self._threads}", daemon=True).start()
            elif not self._is_told:
                self._is_told = True
                self._note(
                    f"{MOST} units are being called at a time, which is the most: further ones wait for one to end"
                )

    def close(self) -> None:
        """Take no more; a call under way is left alone."""
        for _ in range(self._threads):
            self._queue.put(None)

    def _work(self) -> None:
        while (compute := self._queue.get()) is not None:
            began_us = time.monotonic_ns() // 1000
            try:
                outcome = compute.work()
            except BaseException as wrong:  # noqa: BLE001  (it is a user's code, which may even exit)
                outcome = Outcome((), (f"the unit ended its thread: {wrong!r}",))
            took_us = time.monotonic_ns() // 1000 - began_us
            with self._lock:
                self._idle += 1
            self._post(Computed(self._now_us(), compute.number, outcome, took_us))
