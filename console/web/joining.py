"""The thread in which the page's member joins the federation: the page is served meanwhile."""

import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from contextlib import AbstractContextManager
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any, TypeAlias

from dyknow.console.web.actions import Done, PageAction
from dyknow.console.web.views import LiveFeed
from dyknow.model.errors import DyknowError, SessionFailed

if TYPE_CHECKING:
    from dyknow.runtime.client import Client

Connect: TypeAlias = Callable[[], "AbstractContextManager[Client]"]


class PageMember:
    """Joins, fills the feed and carries out what users do, until it is closed.

    Args:
        connect: joins the federation.
        feed: the feed of the page.
        labels: streams that are taken besides those of the map.
        every_us: one period for all streams.
        origin: the origin of metres, if a user gave it.
        tasks: names of the tasks that can be delegated, found when the federation has been joined.

    Attributes:
        failure: why it has ended, if that is an error; `on_failure` is called then.
    """

    def __init__(
        self,
        connect: Connect,
        feed: LiveFeed,
        labels: tuple[str, ...],
        every_us: int | None,
        origin: tuple[float, float] | None,
        tasks: Callable[[], list[str]],
    ) -> None:
        self._connect, self._feed, self._labels, self._every_us = connect, feed, labels, every_us
        self._origin, self._tasks = origin, tasks
        self._actions: SimpleQueue[PageAction] = SimpleQueue()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="web", daemon=True)
        self.failure: DyknowError | None = None
        self.on_failure: Callable[[], None] = lambda: None

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def act(self, given: Mapping[str, Any]) -> "Future[Done]":
        """Have something done."""
        done: Future[Done] = Future()
        if self._over.is_set():
            done.set_exception(SessionFailed("the page is being closed."))
        else:
            self._actions.put(PageAction(given, done))
        return done

    def close(self) -> None:
        """End the member, and the users' actions under way."""
        self._over.set()
        if self._thread.ident is not None:
            self._thread.join(5.0)

    def _run(self) -> None:
        from dyknow.console.picture.picture import Picture
        from dyknow.console.web.member import feed_from

        try:
            with self._connect() as client:
                more = {"unit": client.centre.unit, "tasks": self._tasks()}
                self._feed.begin(Picture(self._origin), more)
                feed_from(client, self._feed, self._actions, self._over, self._labels, self._every_us)
        except DyknowError as error:
            self.failure = error
            self._over.set()
            self.on_failure()
