"""The member whose federation the page shows: it fills the feed, and carries out what users do."""

from concurrent.futures import Future
from dataclasses import dataclass, field
from queue import SimpleQueue
from threading import Event
from typing import Final

from dyknow.console.picture.picture import MAP_LABELS
from dyknow.console.web.acting import job_of
from dyknow.console.web.actions import Done, PageAction
from dyknow.console.web.views import LOOKING, LiveFeed
from dyknow.model.errors import DyknowError
from dyknow.runtime.client import Client, Job, Wait
from dyknow.runtime.recorder.recorder import Recorder

LIST_US: Final = 1_000_000
LIST_US_A_PLATFORM: Final = 60_000
"""How often monitors and tasks are listed: every second, and less often the more platforms there are."""
_STEP_S: Final = 0.04
_AGAIN_S: Final = 2.0
NONE_THERE: Final = "no platform is there"


@dataclass(slots=True)
class _UnderWay:
    """A user's action, between two steps of it."""

    job: Job[Done]
    done: "Future[Done]"
    wait: Wait = field(default_factory=lambda: Wait(lambda: True, 0.0))
    until_us: int = 0
    is_begun: bool = False


def feed_from(
    client: Client,
    feed: LiveFeed,
    actions: "SimpleQueue[PageAction]",
    over: Event,
    labels: tuple[str, ...],
    every_us: int | None,
) -> None:
    """Step a recorder for the page until `over` is set; users' actions are carried out in between."""
    client.on_trouble = lambda _unit, _why: None
    recorder = Recorder(client, feed, (*MAP_LABELS, *labels), every_us, list_us=LIST_US, is_watched=True)
    under_way = _Actions(client, actions)
    while not over.is_set():
        try:
            recorder.list_us = max(LIST_US, LIST_US_A_PLATFORM * len(recorder.units))
            recorder.step(_STEP_S)
            feed.trouble = "" if recorder.units else NONE_THERE if client.is_settled() else LOOKING
        except DyknowError as error:
            feed.trouble = str(error)
            over.wait(_AGAIN_S)
        feed.now_us = client.federation_us()
        under_way.step()
    recorder.close()


class _Actions:
    """The users' actions, step by step among samples and alarms."""

    def __init__(self, client: Client, actions: "SimpleQueue[PageAction]") -> None:
        self._client, self._actions = client, actions
        self._under_way: list[_UnderWay] = []

    def step(self) -> None:
        """Begin what was asked for, and continue what waits for answers."""
        while not self._actions.empty():
            action = self._actions.get_nowait()
            try:
                self._under_way.append(_UnderWay(job_of(self._client, action.given), action.done))
            except DyknowError as error:
                action.done.set_exception(error)
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
