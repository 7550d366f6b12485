"""A session is exchanged for a new one on a thread of its own: closing one whose peers are out of reach takes seconds."""

import contextlib
import threading
from collections.abc import Callable, Iterable

import zenoh

Step = Callable[[], object]


def leave(steps: Iterable[Step]) -> None:
    """Take every step of leaving a session, whatever becomes of the others."""
    for step in steps:
        with contextlib.suppress(zenoh.ZError):  # peers that cannot be told any more find out by themselves
            step()


def leave_within(seconds: float, steps: Iterable[Step]) -> None:
    """As `leave`, but wait at most so long; the end of the process does the rest."""
    leaving = threading.Thread(target=leave, args=(list(steps),), daemon=True)
    leaving.start()
    leaving.join(seconds)


class Exchange:
    """Leaves a session by `steps`, then opens one by `config`; an endpoint that is listened on is free in between."""

    def __init__(self, steps: Iterable[Step], config: str) -> None:
        self._steps, self._config = list(steps), config
        self._opened: zenoh.Session | zenoh.ZError | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        leave(self._steps)
        try:
            self._opened = zenoh.open(zenoh.Config.from_json5(self._config))
        except zenoh.ZError as failed:
            self._opened = failed

    @property
    def is_over(self) -> bool:
        return not self._thread.is_alive()

    def result(self, within_s: float | None = None) -> zenoh.Session | None:
        """The new session; None if it has not been opened `within_s`. Raises ZError when it cannot be."""
        self._thread.join(within_s)
        if isinstance(self._opened, zenoh.ZError):
            raise self._opened
        return self._opened
