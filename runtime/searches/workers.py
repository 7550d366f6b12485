"""Searches for plans next to the node thread, each in a process of its own: it can be ended, and never delays the node."""

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, Final

from dyknow.agents.effects import EndSearch, RunSearch, SearchNews, SearchOver

MOST: Final = 4
"""Searches at a time."""
GRACE_S: Final = 15.0
"""How long after its limit a search may still be heard of."""


class SearchWorkers:
    """Performs `RunSearch` and `EndSearch`.

    Args:
        post: takes `SearchNews` and `SearchOver`; from any thread.
        now_us: the node clock.
    """

    def __init__(self, post: Callable[[SearchNews | SearchOver], None], now_us: Callable[[], int]) -> None:
        self._post, self._now_us = post, now_us
        self._lock = threading.Lock()
        self._running: dict[int, subprocess.Popen[str] | None] = {}

    def perform(self, effect: RunSearch | EndSearch) -> None:
        """Begin a search, or end one; returns at once."""
        if isinstance(effect, EndSearch):
            self.end(effect.number)
        else:
            self._begin(effect)

    def _begin(self, search: RunSearch) -> None:
        with self._lock:
            is_full = len(self._running) >= MOST
            if not is_full:
                self._running[search.number] = None
        if is_full:
            reason = f"{MOST} searches run on this platform already"
            self._post(SearchOver(self._now_us(), search.number, None, reason, False, 0, 0))
            return
        name = f"search {search.number}"
        threading.Thread(target=self._follow, args=(search,), name=name, daemon=True).start()

    def end(self, number: int) -> None:
        """Nothing more is to be heard of it."""
        with self._lock:
            process = self._running.pop(number, None)
        if process is not None:
            process.kill()

    def close(self) -> None:
        """End them all."""
        for number in list(self._running):
            self.end(number)

    def _follow(self, search: RunSearch) -> None:
        began_s = time.monotonic()
        process = subprocess.Popen(
            [sys.executable, "-m", "dyknow.runtime.searches.search"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        with self._lock:
            is_wanted = search.number in self._running
            if is_wanted:
                self._running[search.number] = process
        if not is_wanted:
            process.kill()
        over = threading.Timer(search.limit_us / 1e6 + GRACE_S, process.kill)
        over.daemon = True
        over.start()
        try:
            last = self._read(search, process)
        finally:
            over.cancel()
            process.kill()
            process.wait()
        with self._lock:
            is_wanted = self._running.pop(search.number, None) is not None
        if is_wanted:
            took_us = round((time.monotonic() - began_s) * 1e6)
            self._post(search_over(self._now_us(), search.number, last, took_us))

    def _read(self, search: RunSearch, process: "subprocess.Popen[str]") -> dict[str, Any]:
        """The result in its lines."""
        assert process.stdin is not None  # noqa: S101  (it has both pipes)
        assert process.stdout is not None  # noqa: S101
        with suppress(OSError):
            process.stdin.write(f"{json.dumps(search._asdict())}\n")
            process.stdin.flush()
        for line in process.stdout:
            said = json.loads(line)
            if "plan" in said:
                return dict(said)
            self._post(SearchNews(self._now_us(), search.number, said["nodes"]))
        return {"plan": None, "reason": "the search has ended without an answer", "is_certain": False, "nodes": 0}


def search_over(at_us: int, number: int, last: Mapping[str, Any], took_us: int) -> SearchOver:
    """The event of a search's last line."""
    return SearchOver(at_us, number, last["plan"], last["reason"], last["is_certain"], last["nodes"], took_us)
