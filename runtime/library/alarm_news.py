"""Alarms of a federation, and changes that make them unknown: monitors without inputs, platforms that go."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, TypeAlias

from dyknow.federation.members.liveness import SUSPECT_US, PeerState
from dyknow.federation.messages.contents import Alarm, Alarms, MonitorChange, MonitorChanges
from dyknow.runtime.client import Client, Job
from dyknow.runtime.library.jobs import Subscriptions, all_platforms
from dyknow.runtime.library.results import PlatformChange

if TYPE_CHECKING:
    from dyknow.runtime.library.feed import Feed  # asyncio takes commands a tenth of a second

REMEMBERED = 10_000
"""Alarms by which repetitions are known: each is reported by every platform that it is about."""
_LOOK_S = 0.2
AlarmItem: TypeAlias = Alarm | MonitorChange | PlatformChange


class AlarmNews:
    """Alarms of all platforms, and whether there may be any: monitors that become unknown, platforms that go.

    The first news are the monitors that are unknown and the platforms that are gone already.
    """

    def __init__(self, client: Client) -> None:
        self._client = client
        self._alarms, self._changes = Subscriptions(client, Alarms()), Subscriptions(client, MonitorChanges())
        self._reported: dict[tuple[str, str], None] = {}
        self._platforms: dict[str, str] = {}
        self._is_first = True

    def next(self, within_s: float) -> Job[list[AlarmItem]]:
        """Wait a moment; returns the news since the last call, each alarm once though several platforms report it."""
        found: list[AlarmItem] = []
        if self._is_first:
            self._is_first = False
            for view in (yield from all_platforms(self._client)):
                if view.state == PeerState.GONE.value:
                    found.append(self._platform_change("gone", view.unit))
                self._platforms[view.unit] = view.state
        for _, content in (yield from self._changes.news(0)):
            if isinstance(content, MonitorChange):
                found.append(content)
        for _, content in (yield from self._alarms.news(0 if found else within_s)):
            if isinstance(content, Alarm) and (content.id, content.event) not in self._reported:
                self._reported[content.id, content.event] = None
                if len(self._reported) > REMEMBERED:
                    del self._reported[next(iter(self._reported))]
                found.append(content)
        return [*found, *self._platform_changes()]

    def cancel(self) -> None:
        """End the subscriptions."""
        self._alarms.cancel()
        self._changes.cancel()

    def _platform_changes(self) -> Iterator[PlatformChange]:
        directory, silent_us = self._client.centre.member.directory, self._client.now_us() - SUSPECT_US
        for entry in directory.entries(gone=True):
            if entry.kind != "uav":
                continue
            is_silent = entry.state is PeerState.SUSPECT and entry.heard_us <= silent_us
            state = "left" if entry.left else "silent" if is_silent else entry.state.value
            before = self._platforms.setdefault(entry.unit, state)
            if state in {before, PeerState.SUSPECT.value}:
                continue
            self._platforms[entry.unit] = state
            event = "back" if state == PeerState.ALIVE.value else state
            if event in {"silent", "gone", "left"} or (event == "back" and before != PeerState.ALIVE.value):
                yield self._platform_change(event, entry.unit)

    def _platform_change(self, event: Any, unit: str) -> PlatformChange:
        return PlatformChange(event, unit, self._client.federation_us())


def follow_alarms(client: Client, feed: "Feed[AlarmItem]") -> Job[None]:
    """Feed the alarms of every platform, and changes that make them unknown, until the feed is closed."""
    news = AlarmNews(client)
    try:
        while not feed.is_closed:
            for each in (yield from news.next(_LOOK_S)):
                feed.put(each)
    finally:
        feed.close()
        news.cancel()
