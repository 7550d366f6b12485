"""Calls of a program for a stream that platforms offer at a cost."""

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

from dyknow.documents.durations import SHORTEST_US, duration_us
from dyknow.federation.calls.call import StreamCall
from dyknow.federation.calls.proposals import CallNews, WantedStream
from dyknow.federation.keys import label as label_name
from dyknow.federation.messages.codec import StreamSample
from dyknow.model.errors import WrongCall
from dyknow.runtime.client import Client, Job, Wait
from dyknow.runtime.library.jobs import platforms
from dyknow.runtime.library.results import UnitSample
from dyknow.runtime.library.watched import WatchedStreams

if TYPE_CHECKING:
    from dyknow.runtime.library.feed import Feed  # asyncio takes commands a tenth of a second

CallItem: TypeAlias = UnitSample | CallNews
_LOOK_S = 0.2


def wanted_of(label: str, every: str, max_delay: str, min_certainty: float) -> WantedStream:
    """The wanted stream, from typed arguments.

    Raises:
        WrongCall, NameRefused: an argument that is not right.
    """
    if not 0 <= min_certainty <= 1:
        raise WrongCall(f"min_certainty: {min_certainty:g} is no probability: it is between 0 and 1.")
    every_us = duration_us(every, option="every", least_us=SHORTEST_US)
    return WantedStream(
        label_name(label), every_us, duration_us(max_delay, option="max_delay", least_us=SHORTEST_US), min_certainty
    )


class OpenCall:
    """A call, and the samples of the platform whose proposal is taken; `take` is given both as they come."""

    def __init__(
        self, client: Client, streams: WatchedStreams, wanted: WantedStream, take: Callable[[CallItem], None]
    ) -> None:
        from dyknow.agents.exchange.gateway import stream_policy

        self._client, self._streams, self._take, self._wanted = client, streams, take, wanted
        member = client.centre.member
        self.call = StreamCall(wanted, member.unit, member.acts, member.directory, take, client.centre.clock.speed)
        policy_hash = stream_policy(wanted.period_us / 1e6, wanted.delay_us / 1e6).content_hash()
        self._remove = streams.add_taker((wanted.label, policy_hash), self._on_sample)
        client.begin(self.call)

    def _on_sample(self, owner: str, sample: StreamSample, at_us: int) -> None:
        clock, offset = self._client.centre.clock, self._client.centre.member.offsets.of(owner)
        ahead_us = 0 if offset is None else round(offset.offset_us * clock.speed)
        delay_us = clock.federation_us(at_us) - (sample.valid_us - ahead_us)
        if self.call.on_sample(owner, sample.quality.certainty, delay_us, at_us):
            self._take(self._streams.read(owner, self._wanted.label, sample, at_us))

    def end(self) -> None:
        """It is needed no longer."""
        self._remove()
        self._client.end(self.call)


def call_for(client: Client, streams: WatchedStreams, wanted: WantedStream, feed: "Feed[CallItem]") -> Job[Job[None]]:
    """Call for a stream; returns the job that ends the call when the feed is closed."""
    yield from platforms(client)
    client.pick(None)
    opened = OpenCall(client, streams, wanted, feed.put)

    def kept() -> Job[None]:
        try:
            while not feed.is_closed:
                yield Wait(lambda: feed.is_closed, _LOOK_S)
        finally:
            feed.close()
            opened.end()

    return kept()
