"""The thread of the member whose federation the page shows: it fills the feed, and carries out what users do."""

import threading
from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from queue import SimpleQueue
from typing import Any, Final, NamedTuple

from console.web.acting import Done, job_of
from console.web.feeds import LiveFeed
from console.web.picture import MAP_LABELS
from dyknow.model.errors import DyknowError, SessionFailed
from runtime.client import Client, Job, Wait
from runtime.recorder.recorder import Recorder

LIST_US: Final = 1_000_000
LIST_US_A_PLATFORM: Final = 60_000
"""How often monitors and tasks are listed: every second, and less often the more platforms there are."""
_STEP_S: Final = 0.04
_AGAIN_S: Final = 2.0


class _Wish(NamedTuple):
    given: Mapping[str, Any]
    done: "Future[Done]"


@dataclass(slots=True)
class _UnderWay:
    """What a user has asked for, between two steps of it."""

    job: Job[Done]
    done: "Future[Done]"
    wait: Wait = field(default_factory=lambda: Wait(lambda: True, 0.0))
    until_us: int = 0
    is_begun: bool = False


class FeedingMember:
    """Steps a recorder for the page until it is closed; what users do is done in between."""

    def __init__(self, client: Client, feed: LiveFeed, labels: tuple[str, ...], every_us: int | None) -> None:
        self._client, self._feed = client, feed
        self._labels, self._every_us = (*MAP_LABELS, *labels), every_us
        self._wishes: SimpleQueue[_Wish] = SimpleQueue()
        self._under_way: list[_UnderWay] = []
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
        """Begin what was asked for, and continue what waits for answers; samples and alarms are taken in between."""
        while not self._wishes.empty():
            wish = self._wishes.get_nowait()
            try:
                self._under_way.append(_UnderWay(job_of(self._client, wish.given), wish.done))
            except DyknowError as error:
                wish.done.set_exception(error)
        self._under_way = [one for one in self._under_way if self._continues(one)]

    def _continues(self, one: _UnderWay) -> bool:
        """Take as many steps as can be taken now; whether more are to come."""
        client = self._client
        while (holds := one.wait.condition()) or client.now_us() >= one.until_us:
            try:
                one.wait = one.job.send(holds) if one.is_begun else next(one.job)
            except StopIteration as over:
                one.done.set_result(over.value)
                return False
            except DyknowError as error:
                one.done.set_exception(error)
                return False
            one.is_begun, one.until_us = True, client.now_us() + round(one.wait.within_s * 1e6)
        return True
