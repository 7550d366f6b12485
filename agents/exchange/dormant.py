"""Queries on streams without a sample: a query activates the stream for 30 s; its first sample is the answer.

An exported stream is computed only while it has a subscriber (thesis 3.3.6). If it has no history, such as that of a
camera that is read on demand or of a vehicle that has only started, a query would otherwise never be answered. Times
are the node clock.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

from dyknow import US_PER_S, Label, Policy, Sample
from dyknow.agents.exchange.gateway import Gateway
from dyknow.federation.members.clock import FederationClock
from dyknow.federation.members.deadlines import Deadlines
from dyknow.federation.messages.contents import Query, QueryStream
from dyknow.federation.shares import MemberShare
from dyknow.model.errors import DyknowError
from dyknow.network.stream_proxy import StreamProxy

StreamQuery: TypeAlias = Query | QueryStream
"""By a semantic label, or by the label that the instance has for the stream."""

AWAKE_US = 30 * US_PER_S
"""How long after the last query a stream is kept, so that the next one finds its past, too."""
PATIENCE_US = 1_000_000
MOST, MOST_OF_ONE = 64, 16
"""Queries that wait for a stream, and streams kept: of all members, and of one."""


class PendingQuery(NamedTuple):
    """A query that the first sample answers: `answered` is called when it is there, `failed` with why it did not come.

    `by` is whose it is.
    """

    answered: Callable[[int], None]
    failed: Callable[[str, int], None]
    by: MemberShare


@dataclass(slots=True)
class ActivatedStream:
    """One stream that is kept for queries, and the queries that its first sample answers."""

    stream: StreamProxy
    waiting: list[PendingQuery] = field(default_factory=list)
    due_us: int = 0
    owner: str = ""


def _has_room(owners: list[str], by: MemberShare) -> bool:
    return len(owners) < MOST and owners.count(by.owner) < MOST_OF_ONE * by.shares


class DormantStreams:
    """The streams that queries activated on one platform.

    A stream whose samples all lie off the grid of its subscribers is dormant to a query, too.
    """

    def __init__(self, clock: FederationClock, gateway: Gateway) -> None:
        self._clock, self._gateway = clock, gateway
        self._kept: dict[str | Label, ActivatedStream] = {}
        self._due: Deadlines[str | Label] = Deadlines()

    @property
    def deadline_us(self) -> int | None:
        return self._due.next_us

    def activate(self, query: StreamQuery, label: str | Label, waiting: PendingQuery, now_us: int) -> bool:
        """Subscribe to the stream if it has no sample; returns whether its first sample will answer the query."""
        kept = self._kept.get(label)
        if kept is None or not kept.stream.linked:
            network, local = self._gateway.network, self._gateway.local(label)
            generator = network.find(local)
            if generator is None or not _has_room([each.owner for each in self._kept.values()], waiting.by):
                return False
            if (generator.subscriptions or generator.owner is None) and generator.history.get_size():
                return False
            kept = self._kept[label] = ActivatedStream(
                network.connect(local, Policy(), lambda sample: self._take(label, sample)), owner=waiting.by.owner
            )
        kept.due_us = now_us + AWAKE_US
        waits = query.op == "latest" and _has_room([each.by.owner for each in kept.waiting], waiting.by)
        if waits:
            kept.waiting.append(waiting)
        self._due.set(label, now_us + PATIENCE_US if kept.waiting else kept.due_us)
        return waits

    def on_time(self, now_us: int) -> None:
        """Fail queries whose time is over; streams without recent queries are dormant again."""
        for label in self._due.pop_due(now_us):
            kept = self._kept[label]
            waiting, kept.waiting = kept.waiting, []
            for each in waiting:
                each.failed(f"{label} had no sample, and none came within {PATIENCE_US / US_PER_S:g} s", now_us)
            if now_us >= kept.due_us or not kept.stream.linked:
                del self._kept[label]
                kept.stream.cancel()
            else:
                self._due.set(label, kept.due_us)

    def _take(self, label: str | Label, sample: Sample) -> None:
        kept = self._kept[label]
        if not kept.waiting:
            return
        now_us = self._clock.wall_us(sample.available_us)
        waiting, kept.waiting = kept.waiting, []
        self._due.set(label, kept.due_us)
        for each in waiting:
            try:
                each.answered(now_us)
            except DyknowError as refused:
                each.failed(str(refused), now_us)
