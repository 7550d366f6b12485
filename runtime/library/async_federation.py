"""A connection for a program with an event loop: `async with dyknow.connect() as fed`."""

from typing import TYPE_CHECKING, Any

from dyknow.federation.members.command_centre import PlatformView
from dyknow.federation.messages.contents import ActLog, MonitorEntry, TaskEntry
from dyknow.runtime.library import jobs, listings
from dyknow.runtime.library.calls import CallItem
from dyknow.runtime.library.connection_face import ConnectionFace, DelegatedTask, Time, name_of
from dyknow.runtime.library.feed import Feed
from dyknow.runtime.library.missions import AbortedMission, abort_mission, mission_of
from dyknow.runtime.library.pictures.saliency import FoundPerson, saliency_map
from dyknow.runtime.library.questions import Which
from dyknow.runtime.library.results import QueryResult, UnitSample

if TYPE_CHECKING:
    from dyknow.runtime.library.pictures.bands import BandsPicture  # numpy takes a tenth of a second


class AsyncDelegatedTask(DelegatedTask):
    """A delegated task, for an event loop."""

    async def cancel(self) -> None:  # type: ignore[override]  # the same, to be awaited
        """End the task and all that it set up; raises as `DelegatedTask.cancel`."""
        await self._face._done(self._cancel())  # noqa: SLF001


class AsyncFederationClient(ConnectionFace):
    """A federation, for a program with an event loop: the methods of `FederationClient`, to be awaited.

    Feeds (`watch`, `alarms`, the events of a task) are iterated by `async for`.
    """

    async def query(
        self,
        label: str,
        *,
        unit: str | int | None = None,
        at: Time | None = None,
        between: tuple[Time, Time] | None = None,
        last: int | None = None,
        nth: int | None = None,
        slice: tuple[int, int] | None = None,  # noqa: A002  (as the option of the command)
        within: str = "2s",
    ) -> QueryResult:
        """See `FederationClient.query`."""
        return await self._done(self._query(label, unit, Which(at, between, last, nth, slice), within))

    async def watch(
        self, label: str, *, unit: str | int | None = None, every: str = "200ms", max_delay: str = "1s"
    ) -> Feed[UnitSample]:
        """See `FederationClient.watch`."""
        return await self._done(self._watch(label, unit, every, max_delay))

    async def call(
        self, label: str, *, every: str = "200ms", max_delay: str = "1s", min_certainty: float = 0.0
    ) -> Feed[CallItem]:
        """See `FederationClient.call`."""
        return await self._done(self._call(label, every, max_delay, min_certainty))

    async def delegate(
        self,
        task: str,
        *,
        to: str | int | None = None,
        within: str = "3s",
        when: tuple[str, str] | None = None,
        **content: Any,
    ) -> AsyncDelegatedTask:
        """See `FederationClient.delegate`."""
        return AsyncDelegatedTask(self, *await self._done(self._delegate(task, to, content, within, when)))

    async def mission(self, domain: str, problem: str, *, to: str | int | None = None, **given: Any) -> DelegatedTask:
        """See `FederationClient.mission`."""
        return AsyncDelegatedTask(
            self, *await self._done(self._begun(mission_of(self._client, domain, problem, to, given)))
        )

    async def abort_mission(self, name: str | None = None) -> AbortedMission:
        """See `FederationClient.abort_mission`."""
        return await self._done(abort_mission(self._client, name))

    async def saliency(self, unit: str | int | None = None) -> list[FoundPerson]:
        """See `FederationClient.saliency`."""
        return list((await self._done(saliency_map(self._client, name_of(unit)))).persons)

    async def bands(self, unit: str | int, *, profile: str = "well-clear", lookahead_s: float = 30.0) -> "BandsPicture":
        """See `FederationClient.bands`."""
        return await self._done(self._bands(unit, profile, lookahead_s))

    async def monitors(self, *, explain: bool = False) -> list[MonitorEntry]:
        """See `FederationClient.monitors`."""
        return await self._done(jobs.monitors(self._client, explain=explain))

    async def ls(self) -> list[PlatformView]:
        """See `FederationClient.ls`."""
        return await self._done(jobs.all_platforms(self._client))

    async def tasks(self) -> list[TaskEntry]:
        """See `FederationClient.tasks`."""
        return await self._done(listings.tasks(self._client))

    async def cancel(self, conversation: str) -> None:
        """See `FederationClient.cancel`."""
        await self._done(listings.cancel(self._client, conversation))

    async def objects(self, type: str | None = None, *, unit: str | int | None = None) -> list[listings.ListedObject]:  # noqa: A002
        """See `FederationClient.objects`."""
        return await self._done(listings.objects(self._client, name_of(unit), type))

    async def acts(self, unit: str | int | None = None) -> list[ActLog]:
        """See `FederationClient.acts`."""
        return await self._done(listings.acts(self._client, name_of(unit)))
