"""The export proxy of a platform: local streams go out under semantic labels (thesis 9.3.3)."""

from collections import Counter
from collections.abc import Callable, Iterable

from dyknow import Label, Network, Policy, Sample
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.federation.messages.codec import MAX_EVERY, MAX_RIDERS, Rider, StreamSample
from dyknow.federation.sharing.exports import ContractEnded, ExportEvent, Exports, StreamEnded, StreamName
from dyknow.federation.sharing.streams import ExportStream
from dyknow.federation.sharing.translation import Translation
from dyknow.federation.transport import Put
from dyknow.model.errors import UnknownLabel
from dyknow.model.values import without_nan
from dyknow.network.stream_proxy import StreamProxy

BATCH = 64
"""Samples that are put together at most: a payload stays far below 64 KiB."""


class ExportProxy:
    """Subscribes locally once per (semantic label, policy), whatever the number of receivers.

    A receiver that is slow or dead cannot be noticed here: a sample is put once, for all, and never waited for.
    Samples of one batch of events are put in one go by `flush`, when `pending` is true: position, altitude and velocity
    of one instant, for the same receivers, are one message, not three.

    Attributes:
        shed: how much less often than its period a stream of importance 1 is sent; more important ones suffer less.
        omitted: by semantic label, how many samples were not sent because of it.
    """

    def __init__(
        self, exports: Exports, network: Network, translation: Translation, put: Callable[[Put], None]
    ) -> None:
        self.exports = exports
        self._network, self._translation, self._put = network, translation, put
        self._subscriptions: dict[StreamName, StreamProxy] = {}
        self._waiting: dict[ExportStream, list[StreamSample]] = {}
        self._importance: dict[str, float] = {}
        self.shed = 1
        self.omitted = Counter[str]()

    @classmethod
    def of(cls, ports: Ports, _parts: PartRegistry) -> "ExportProxy":
        """Build it from the ports and parts of a platform."""
        return cls(ports.exports, ports.network, ports.translation, ports.emit)

    def start_exporting(
        self, local: Label, semantic_label: str, receivers: Iterable[str], policy: Policy, contract: str
    ) -> str:
        """`start exporting(l, s, w)` of 9.3.3 for each w; returns the hash that names the stream.

        Raises:
            UnknownLabel: no generator of this instance carries `local`.
            Refused: the platform exports as many streams as it may.
        """
        if local not in self._network.labels():
            raise UnknownLabel(semantic_label, tuple(str(label) for label in self._network.labels()))
        stream, is_new = self.exports.open(contract, semantic_label, policy, receivers)
        if is_new:
            is_of_objects = self._translation.ontology[semantic_label].sort.is_of_objects
            waiting, number = self._waiting, stream.number

            def export(sample: Sample) -> None:
                if self.shed > 1 and self._is_omitted(semantic_label, policy, sample.valid_us):
                    return
                if is_of_objects:
                    sample = sample._replace(value=without_nan(sample.value))
                batch = waiting.setdefault(stream, [])
                batch.append(number(sample))
                if len(batch) >= BATCH:
                    self.flush()

            consumer = self._translation.to_semantic(semantic_label).into(export)
            self._subscriptions[semantic_label, stream.policy_hash] = self._network.connect(local, policy, consumer)
        return stream.policy_hash

    @property
    def pending(self) -> bool:
        """Whether samples wait to be put."""
        return bool(self._waiting)

    def flush(self) -> None:
        """Put the waiting samples; streams with the same receivers share a message."""
        if not self._waiting:
            return
        loads: dict[tuple[int, frozenset[str]], list[ExportStream]] = {}
        for stream in self._waiting:
            receivers = self.exports.receivers(stream.label, stream.policy_hash)
            loads.setdefault((self._every(stream), receivers), []).append(stream)
        for (every, _), (first, *others) in loads.items():
            entries, riders = self._waiting[first], list[Rider]()
            room = BATCH - len(entries)
            for other in others:
                carried = self._waiting[other]
                if len(carried) > room or len(riders) == MAX_RIDERS:
                    self._put(other.put(carried, every=every))
                else:
                    riders.append(other.ride(carried))
                    room -= len(carried)
            self._put(first.put(entries, riders, every))
        self._waiting.clear()

    def rank(self, semantic_label: str, importance: float) -> None:
        """How important the owner holds a stream to be; 1 by default."""
        self._importance[semantic_label] = importance

    def every(self, semantic_label: str, policy: Policy) -> int:
        """Of how many samples of its period a stream is sent one: a power of two. States of objects are always sent."""
        if self.shed == 1 or policy.sample_us is None or self._translation.ontology[semantic_label].sort.is_of_objects:
            return 1
        wanted = self.shed / self._importance.get(semantic_label, 1.0)
        return min(MAX_EVERY, 1 << max(0, int(wanted).bit_length() - 1))

    def _every(self, stream: ExportStream) -> int:
        subscription = self._subscriptions.get((stream.label, stream.policy_hash))
        return 1 if subscription is None else self.every(stream.label, subscription.policy)

    def _is_omitted(self, semantic_label: str, policy: Policy, valid_us: int) -> bool:
        every_us = (policy.sample_us or 1) * self.every(semantic_label, policy)
        if not (valid_us - (policy.from_us or 0)) % every_us:
            return False
        self.omitted[semantic_label] += 1
        return True

    def on_events(self, events: Iterable[ExportEvent]) -> list[ContractEnded]:
        """End the local subscriptions of ended streams; returns the contracts whose receivers are to be notified."""
        ended: list[ContractEnded] = []
        for event in events:
            if isinstance(event, StreamEnded):
                subscription = self._subscriptions.pop((event.label, event.policy_hash), None)
                if subscription is not None:
                    subscription.cancel()
            else:
                ended.append(event)
        return ended
