"""The Gateway Agent: the only way from the agents to the local instance (thesis 9.3.3, the DyKnow Gateway).

Semantic labels and their units end here; below, the instance knows its own labels and units only.
"""

from collections.abc import Callable, Iterable
from difflib import SequenceMatcher

from dyknow import US_PER_S, Label, Network, Policy, Sample, Sort, print_span
from dyknow.agents.exchange.export_proxy import ExportProxy
from dyknow.agents.exchange.import_proxy import ImportProxy
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.federation.sharing.ontology import Ontology
from dyknow.federation.sharing.translation import Translation
from dyknow.model.errors import Refused, UnknownLabel, ValueNotAvailable

PAGE = 256


def stream_policy(period_s: float, delay_s: float, from_us: int | None = None, to_us: int | None = None) -> Policy:
    """The policy of an exported stream: `from f [to t], sample every p, max delay d`.

    Without `from` the grid is aligned to the epoch (the thesis' f = 0), so that streams of several platforms meet.
    """
    return Policy(
        change="sample",
        sample_us=round(period_s * US_PER_S),
        max_delay_us=round(delay_s * US_PER_S),
        from_us=0 if from_us is None else from_us,
        to_us=to_us,
    )


def _same(sample: Sample) -> Sample:
    return sample


def _too_early(semantic_label: str | Label, start_us: int, at_us: int, now_us: int) -> ValueNotAvailable:
    """For users: how long before, and how long ago (to be asked for again), say more than instants."""
    before, ago_s = print_span(start_us - at_us), (now_us - start_us) / US_PER_S
    return ValueNotAvailable(f"{before} before the first {semantic_label} that is held, {ago_s:.1f} s ago")


class Gateway:
    """The local instance as the agents of one platform see it. Times are federation time."""

    def __init__(
        self,
        unit: str,
        network: Network,
        ontology: Ontology,
        translation: Translation,
        exporter: ExportProxy,
        importer: ImportProxy,
    ) -> None:
        self.unit, self.network, self.ontology, self.translation = unit, network, ontology, translation
        self.exporter, self.importer = exporter, importer

    @classmethod
    def of(cls, ports: Ports, parts: PartRegistry) -> "Gateway":
        """Build it from the ports and parts of a platform."""
        exporter, importer = parts[ExportProxy.of], parts[ImportProxy]
        return cls(ports.unit, ports.network, ports.ontology, ports.translation, exporter, importer)

    def local(self, semantic_label: str | Label, unit: str | None = None) -> Label:
        """The local label for a semantic label of a unit (its own by default); a local label is returned unchanged.

        Raises:
            UnknownLabel: the ontology does not know the label, or it has no producer here.
        """
        if isinstance(semantic_label, Label):
            return semantic_label
        known = semantic_label in self.ontology
        label = self.translation.local_label(semantic_label, unit or self.unit) if known else None
        if label not in self.network.labels():
            raise self._unknown(semantic_label)
        return label

    def offered(self, unit: str | None = None) -> tuple[str, ...]:
        """The semantic labels this instance has of a unit."""
        have = set(self.network.labels())
        return tuple(name for name in self.ontology if self.translation.local_label(name, unit or self.unit) in have)

    def _unknown(self, semantic_label: str) -> UnknownLabel:
        """The error, with the available labels, the most similarly spelt first."""
        alike = {name: SequenceMatcher(None, semantic_label, name).ratio() for name in self.offered()}
        return UnknownLabel(semantic_label, tuple(sorted(alike, key=alike.__getitem__, reverse=True)))

    def create_stream_multicast(
        self, semantic_label: str, policy: Policy, receivers: Iterable[str], contract: str
    ) -> str:
        """`create stream multicast(s, f, t, p, d, u)`: export to each of the receivers; returns the stream's hash.

        Raises:
            UnknownLabel, Refused
        """
        return self.exporter.start_exporting(self.local(semantic_label), semantic_label, receivers, policy, contract)

    def latest(self, semantic_label: str | Label, unit: str | None = None) -> Sample:
        """The sample with the highest valid time, in semantic units.

        Raises:
            UnknownLabel, ValueNotAvailable
        """
        found = self.network.snapshot(self.local(semantic_label, unit)).get_latest_vtime()
        return self._to_semantic(semantic_label)(found)

    def at(self, semantic_label: str | Label, at_us: int, now_us: int, unit: str | None = None) -> Sample:
        """The sample most recent at a time, of those available now (Def. 4.3.11), in semantic units.

        Raises:
            UnknownLabel
            Refused: `at_us` is in the future.
            ValueNotAvailable: it lies before the history, whose start the message names.
        """
        if at_us > now_us:
            raise Refused(f"not yet: {print_span(at_us - now_us)} in the future", "not-yet")
        history = self.network.snapshot(self.local(semantic_label, unit))
        start_us = history.starts_us
        if start_us is not None and at_us < start_us:
            raise _too_early(semantic_label, start_us, at_us, now_us)
        try:
            found = history.most_recent_at(at_us, now_us)
        except ValueNotAvailable:
            later = history.get_between(at_us, now_us)
            if not later:
                raise
            raise _too_early(semantic_label, later[0].valid_us, at_us, now_us) from None
        return self._to_semantic(semantic_label)(found)

    def between(
        self, semantic_label: str | Label, from_us: int, to_us: int, now_us: int, unit: str | None = None
    ) -> list[Sample]:
        """All samples valid in [from, to], ordered by (valid, available), corrections included."""
        if from_us > to_us:
            raise Refused(
                f"the interval is empty: it ends {print_span(from_us - to_us)} before it begins", "empty-interval"
            )
        history = self.network.snapshot(self.local(semantic_label, unit))
        start_us = history.starts_us
        if start_us is not None and from_us < start_us:
            raise _too_early(semantic_label, start_us, from_us, now_us)
        return list(map(self._to_semantic(semantic_label), history.get_between(from_us, to_us)))

    def nth_latest(self, semantic_label: str | Label, n: int) -> Sample:
        """The n-th sample before the latest by available time, in semantic units; the 0-th is the latest.

        Raises:
            UnknownLabel, ValueNotAvailable
        """
        return self._to_semantic(semantic_label)(self.network.snapshot(self.local(semantic_label)).get_nth_latest(n))

    def last(self, semantic_label: str | Label, n: int) -> list[Sample]:
        """The last `n` samples as they became available, oldest first; fewer if fewer are held."""
        size = self.network.snapshot(self.local(semantic_label)).get_size()
        return self.slice(semantic_label, max(0, size - n), size - 1)

    def slice(self, semantic_label: str | Label, i: int, j: int) -> list[Sample]:
        """The i-th to the j-th sample as they became available, both included; the oldest that is held is the 0-th.

        Raises:
            UnknownLabel, ValueNotAvailable
        """
        history = self.network.snapshot(self.local(semantic_label))
        return list(map(self._to_semantic(semantic_label), history.get_slice(i, j)))

    def sort(self, semantic_label: str | Label) -> Sort:
        """Of its values, as they are reported."""
        if isinstance(semantic_label, Label):
            return self.network.generator(semantic_label).sort
        if semantic_label not in self.ontology:
            raise self._unknown(semantic_label)
        return self.ontology[semantic_label].sort

    def _to_semantic(self, semantic_label: str | Label) -> Callable[[Sample], Sample]:
        if isinstance(semantic_label, Label):
            return _same
        return self.translation.to_semantic(semantic_label).sample
