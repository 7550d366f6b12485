"""The thread of the member whose federation the page shows: it fills the feed, and carries out what users do."""

import threading
from collections.abc import Mapping
from concurrent.futures import Future
from queue import Empty, SimpleQueue
from typing import Any, Final, NamedTuple

from console.web.acting import Done, job_of
from console.web.feeds import LiveFeed
from console.web.picture import MAP_LABELS
from dyknow.model.errors import DyknowError, SessionFailed
from runtime.client import Client
from runtime.recorder.recorder import Recorder

LIST_US: Final = 1_000_000
LIST_US_A_PLATFORM: Final = 60_000
"""How often monitors and tasks are listed: every second, and less often the more platforms there are."""
_STEP_S: Final = 0.04
_AGAIN_S: Final = 2.0


class _Wish(NamedTuple):
    given: Mapping[str, Any]
    done: "Future[Done]"


class FeedingMember:
    """Steps a recorder for the page until it is closed; one after another, what users do in between."""

    def __init__(self, client: Client, feed: LiveFeed, labels: tuple[str, ...], every_us: int | None) -> None:
        self._client, self._feed = client, feed
        self._labels, self._every_us = (*MAP_LABELS, *labels), every_us
        self._wishes: SimpleQueue[_Wish] = SimpleQueue()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="web", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def act(self, given: Mapping[str, Any]) -> "Future[Done]":
        """Have something done."""
        done: Future[Done] = Future()
        if self._over.is_set():
            done.set_exception(SessionFailed("the page is being closed."))
        else:
            self._wishes.put(_Wish(given, done))
        return done

    def close(self) -> None:
        """End, and what was asked for."""
        self._over.set()
        self._thread.join(5.0)

    def _run(self) -> None:
        client, feed = self._client, self._feed
        client.on_trouble = lambda _unit, _why: None
        recorder = Recorder(client, feed, self._labels, self._every_us, list_us=LIST_US, is_watched=True)
        while not self._over.is_set():
            try:
                recorder.list_us = max(LIST_US, LIST_US_A_PLATFORM * len(recorder.units))
                recorder.step(_STEP_S)
                feed.trouble = "" if recorder.units else "no platform is there"
            except DyknowError as error:
                feed.trouble = str(error)
                self._over.wait(_AGAIN_S)
            feed.now_us = client.federation_us()
            self._grant()
        recorder.close()

    def _grant(self) -> None:
        while True:
            try:
                wish = self._wishes.get_nowait()
            except Empty:
                return
            try:
                wish.done.set_result(self._client.run(job_of(self._client, wish.given)))
            except DyknowError as error:
                wish.done.set_exception(error)
