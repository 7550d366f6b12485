"""Which of the imported samples of a connection go where."""

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, TypeAlias

from dyknow.federation.members.imports import ImportName
from dyknow.federation.messages.codec import StreamSample
from dyknow.runtime.client import Client
from dyknow.runtime.library.meanings import record_of
from dyknow.runtime.library.results import UnitSample, sample_of_wire

if TYPE_CHECKING:
    from dyknow.runtime.library.feed import Feed  # asyncio takes commands a tenth of a second

TakeSample: TypeAlias = Callable[[str, StreamSample, int], None]
"""Takes the owner of a sample, the sample, and its arrival (node clock)."""


class WatchedStreams:
    """The consumers of imported samples, by semantic label and policy hash."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._takers: dict[tuple[str, str], list[TakeSample]] = {}
        client.centre.on_sample = self._on_sample

    def add(self, stream: tuple[str, str], units: Iterable[str], feed: "Feed[UnitSample]") -> Callable[[], None]:
        """Have a feed take the samples of these units; returns how to take it off."""
        wanted = frozenset(units)

        def take(owner: str, sample: StreamSample, at_us: int) -> None:
            if owner in wanted:
                feed.put(self.read(owner, stream[0], sample, at_us))

        return self.add_taker(stream, take)

    def add_taker(self, stream: tuple[str, str], take: TakeSample) -> Callable[[], None]:
        """Have `take` given the samples of all units; returns how to take it off."""
        self._takers.setdefault(stream, []).append(take)
        return lambda: self._takers[stream].remove(take)

    def read(self, owner: str, label: str, sample: StreamSample, at_us: int) -> UnitSample:
        """A sample as a program reads it."""
        value = record_of(self._client, owner, label, sample.value)
        return sample_of_wire(value, owner, label, sample, self._client.centre.clock.federation_us(at_us))

    def _on_sample(self, name: ImportName, sample: StreamSample, at_us: int) -> None:
        owner, label, policy_hash = name
        for take in self._takers.get((label, policy_hash), ()):
            take(owner, sample, at_us)
