"""The common part of both faces of a connection, for programs that wait and for event loops; and its tasks."""

import asyncio
from collections.abc import Generator
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypeVar

from dyknow.federation.messages.contents import Content
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.runtime.client import Job
from dyknow.runtime.library import jobs
from dyknow.runtime.library.alarm_news import AlarmItem, follow_alarms
from dyknow.runtime.library.calls import CallItem, call_for, wanted_of
from dyknow.runtime.library.feed import Feed
from dyknow.runtime.library.member_thread import MemberThread
from dyknow.runtime.library.questions import Which
from dyknow.runtime.library.results import QueryResult, UnitSample
from dyknow.runtime.library.watched import WatchedStreams

if TYPE_CHECKING:
    from dyknow.runtime.library.pictures.bands import BandsPicture  # numpy takes a tenth of a second

T = TypeVar("T")
Time: TypeAlias = str | int
"""An instant of federation time: microseconds since 1970, or a text: `-5s` (ago), `now`, ISO 8601."""
TaskState: TypeAlias = Literal["running", "done", "failed", "cancelled"]


class ConnectionFace:
    """The common part of both faces of a connection."""

    def __init__(self, thread: MemberThread) -> None:
        self._thread, self._client = thread, thread.client
        self._streams = WatchedStreams(thread.client)

    def _do(self, job: Job[T]) -> T:
        return self._thread.post(job).result()

    async def _done(self, job: Job[T]) -> T:
        return await asyncio.wrap_future(self._thread.post(job))

    def _query(self, label: str, unit: str | int | None, which: Which, within: str) -> Job[QueryResult]:
        return jobs.query(self._client, label, name_of(unit), which, within)

    def _watch(
        self, label: str, unit: str | int | None, every: str, max_delay: str
    ) -> Generator[Any, bool, Feed[UnitSample]]:
        feed: Feed[UnitSample] = Feed()
        keep = yield from jobs.watch(self._client, self._streams, label, name_of(unit), every, max_delay, feed)
        self._thread.post(keep)
        return feed

    def _call(
        self, label: str, every: str, max_delay: str, min_certainty: float
    ) -> Generator[Any, bool, Feed[CallItem]]:
        feed: Feed[CallItem] = Feed()
        wanted = wanted_of(label, every, max_delay, min_certainty)
        keep = yield from call_for(self._client, self._streams, wanted, feed)
        self._thread.post(keep)
        return feed

    def _bands(self, unit: str | int, profile: str, lookahead_s: float) -> Job["BandsPicture"]:
        from dyknow.runtime.library.pictures.bands import bands

        return bands(self._client, str(unit), profile, lookahead_s)

    def _delegate(
        self, task: str, to: str | int | None, given: dict[str, Any], within: str, when: tuple[str, str] | None
    ) -> Generator[Any, bool, tuple[Dialogue, Feed[Content]]]:
        return self._begun(jobs.delegate(self._client, task, name_of(to), given, within, when))

    def _begun(self, begin: Job[Dialogue]) -> Generator[Any, bool, tuple[Dialogue, Feed[Content]]]:
        dialogue = yield from begin
        feed: Feed[Content] = Feed()
        self._thread.post(jobs.follow_task(dialogue, feed))
        return dialogue, feed

    def alarms(self) -> Feed[AlarmItem]:
        """Alarms as they open and close, on every platform, those that appear later included.

        Among them is what makes it unknown whether there are any, each told within two seconds: a `MonitorChange` for
        a monitor that is `unknown` (`.which` inputs lack), `known` again or `ended`, a `PlatformChange` for a platform
        that is `silent`, `gone`, has `left` or is `back`. They have the attributes of alarms, empty where they have none.

        Each alarm has `.event` (`opened`, `closed`, or `ended` with its monitor), `.monitor`, `.by` (the platform that raised it), `.units` (which it is
        about), `.valid_us`, `.detected_us` and `.values`.
        """
        feed: Feed[AlarmItem] = Feed()
        self._thread.post(follow_alarms(self._client, feed))
        return feed


class DelegatedTask:
    """A delegated task. It continues when the connection is closed, until it is done or cancelled.

    Attributes:
        unit: the platform that it was delegated to.
        conversation: its name everywhere: `dyknow cancel CONVERSATION` ends it.
        events: the platform's reports: `Progress`, `Alarm`, `Verdict`, `Done`; the iteration ends with the task.
    """

    def __init__(self, face: ConnectionFace, dialogue: Dialogue, events: Feed[Content]) -> None:
        self._face, self._dialogue, self.events = face, dialogue, events
        self.unit, self.conversation = dialogue.unit, dialogue.conversation
        self._is_cancelled = False

    def __repr__(self) -> str:
        return f"<DelegatedTask {self.conversation} on {self.unit}: {self.state}>"

    @property
    def state(self) -> TaskState:
        """`running`, `done`, `failed` or `cancelled`."""
        found: Any = "cancelled" if self._is_cancelled else jobs.state_of(self._dialogue)
        state: TaskState = found
        return state

    def _cancel(self) -> Job[None]:
        yield from jobs.cancel(self._face._client, self.unit, self.conversation)  # noqa: SLF001  (its own)
        self._is_cancelled = True
        self.events.close()

    def cancel(self) -> None:
        """End the task and all that it set up.

        Raises:
            Refused: another member delegated it.
            FederationFailed: it is over already, or the platform does not answer.
        """
        self._face._do(self._cancel())  # noqa: SLF001


def name_of(unit: str | int | None) -> str | None:
    """Of a unit, which a program may give as a number."""
    return None if unit is None else str(unit)
