"""The import proxy of a platform: remote streams come in as local sources (thesis 9.3.3)."""

from collections import Counter
from collections.abc import Callable, Container, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final, TypeAlias

from dyknow import Policy, PolicyAdapter, Sample
from dyknow.agents.admission.trusted import PlatformTrust
from dyknow.agents.exchange.label_agreements import LabelAgreements
from dyknow.agents.exchange.peer_motion import JUDGED, PeerMotion
from dyknow.agents.part import Part, PeerChange
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.federation.members.clock import Offset, Standing
from dyknow.federation.members.imports import ImportName
from dyknow.federation.members.offers import DefinitionsChanged
from dyknow.federation.messages.codec import StreamSample
from dyknow.federation.messages.descriptions import ConditionEntry
from dyknow.federation.sharing.ranges import in_range
from dyknow.model.errors import SortError

MAX_STREAMS, STREAMS_OF_ONE = 4096, 64
"""Streams that are imported, in all and of one owner."""
MOST_SHOWN = 4
_SKEWED, _CORRECTED = Standing.SKEWED, Standing.CORRECTED
Sink: TypeAlias = Callable[[Sample], None]
"""Takes a sample, in semantic units, into the local instance, or looks at it."""

AHEAD_US = 60_000_000
"""How far in the future a sample may be valid: a prediction is legal, a sample that ends its stream is not."""


AS_THEY_COME: Final = frozenset({"intent"})
"""Labels whose samples describe the present: from a member whose clock is wrong they are valid on arrival."""


@dataclass(slots=True)
class ImportedStream:
    """Adapter, sink and clock offset for one stream of one owner; `standing` is that of `offset`."""

    owner: str
    label: str
    policy: Policy
    regrid: PolicyAdapter | None = None
    sink: Sink | None = None
    offset: Offset | None = None
    standing: Standing = _SKEWED


class ImportProxy(Part):
    """Pushes the samples of imported streams into the local instance.

    Samples of a peer whose clock is skewed, or not compared yet, are refused and counted: one valid time far ahead
    would end an ordered stream; an intent is valid when it comes. Valid times of a peer whose clock is off by 50 ms to
    1 s are shifted, and the samples approximated linearly onto the grid of the stream (semantics of offsets between
    platforms). Times: node clock, but for valid times.

    Args:
        disagreement: (unit, semantic label) -> why the label is not shared with the unit, or nothing.
        source: (semantic label, unit) -> its local label, declared if it was not, and how its values become semantic.

    Attributes:
        policies: of the streams that are expected, as their owners announced them.
        has_news: whether `conditions` has changed since this was reset.
        on_every: called with (unit, semantic label, period, every): only each `every`-th sample comes from now on.
    """

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._network, self._ontology, self._translation = ports.network, ports.ontology, ports.translation
        self._clock, self._offset_of, self._emit = ports.clock, ports.offset_of, ports.emit
        self._declare = ports.source()
        self.imports, self._disagreement = ports.imports, parts[LabelAgreements].disagreement
        self._trust = parts[PlatformTrust]
        self._motion = parts[PeerMotion]
        self._sinks: dict[tuple[str, str], Sink] = {}
        self._note = ports.note
        self._crowded: dict[str, int] = {}
        self.has_news = False
        self.refused: Counter[str] = Counter()
        self.policies: dict[ImportName, Policy] = {}
        self.on_every: list[Callable[[str, str, int, int], None]] = []

    def expect(self, owner: str, semantic_label: str, policy_hash: str, policy: Policy, now_us: int) -> None:
        """`owner` announced a stream for us: listen to it. Saying it twice is saying it once."""
        if semantic_label not in self._ontology:
            return
        name = owner, semantic_label, policy_hash
        if name not in self.imports.streams and not self._has_room(owner, now_us):
            return
        if self._disagreement(owner, semantic_label):
            self.refused["label conflict"] += 1
            return
        imported = ImportedStream(owner, semantic_label, policy)
        self.policies[owner, semantic_label, policy_hash] = policy
        for effect in self.imports.begin(name, partial(self._deliver, imported), now_us, partial(self._thinned, name)):
            self._emit(effect)

    def _has_room(self, owner: str, now_us: int) -> bool:
        """Whether one more stream of it is taken; a refused one is counted, shown, and noted once for each owner."""
        of_owner = sum(name[0] == owner for name in self.imports.streams)
        if of_owner < STREAMS_OF_ONE and len(self.imports.streams) < MAX_STREAMS:
            return True
        self.refused["too many streams"] += 1
        if owner not in self._crowded:
            self._crowded[owner], self.has_news = now_us, True
            if len(self._crowded) > STREAMS_OF_ONE:
                del self._crowded[next(iter(self._crowded))]
            self._note(
                f"import: {owner} announces more than the {of_owner} streams that are taken from it; they are refused"
            )
        return False

    def conditions(self) -> Iterable[ConditionEntry]:
        """Owners whose streams are refused: values that depend on these streams stay unknown."""
        for owner, since_us in list(self._crowded.items())[:MOST_SHOWN]:
            text = f"{owner} announces more than {STREAMS_OF_ONE} streams: further ones are refused, their values stay unknown"
            yield ConditionEntry(text=text, since_us=max(0, since_us))

    def on_peer(self, change: PeerChange, _now_us: int) -> None:
        """End the imports of labels that a platform has redefined and so no longer shares."""
        if isinstance(change, DefinitionsChanged):
            for name in [name for name in self.imports.streams if name[0] == change.unit]:
                if self._disagreement(*name[:2]):
                    self.refused["label conflict"] += 1
                    self.end(*name)

    def forget(self, semantic_label: str) -> None:
        """The label means something else from now on, or nothing."""
        self._sinks = {name: sink for name, sink in self._sinks.items() if name[1] != semantic_label}
        for name in [name for name in self.imports.streams if name[1] == semantic_label]:
            self.end(*name)

    def end(self, owner: str, semantic_label: str, policy_hash: str) -> None:
        """The stream ended; its source and history stay for queries."""
        self._thinned((owner, semantic_label, policy_hash), 1)
        self.policies.pop((owner, semantic_label, policy_hash), None)
        if self._crowded.pop(owner, None) is not None:
            self.has_news = True
        for effect in self.imports.end((owner, semantic_label, policy_hash)):
            self._emit(effect)

    def heard_us(self, owners: Container[str]) -> dict[tuple[str, str], int]:
        """By owner, of these, and semantic label, when a stream that is expected was last heard of.

        A stream that its owner sends less often, because of its load, counts as heard so much later.
        """
        heard: dict[tuple[str, str], int] = {}
        for name, found in self.imports.streams.items():
            if name[0] not in owners:
                continue
            policy, key = self.policies.get(name), name[:2]
            longer_us = 0 if policy is None else 2 * (found.every - 1) * (policy.sample_us or 0)
            heard[key] = max(found.heard_us + longer_us, heard.get(key, found.heard_us))
        return heard

    def is_of_objects(self, semantic_label: str) -> bool:
        """Whether samples are states of objects, which are seen at times of their own."""
        return semantic_label in self._ontology and self._ontology[semantic_label].sort.is_of_objects

    def _thinned(self, name: ImportName, every: int) -> None:
        policy = self.policies.get(name)
        if policy is not None and policy.sample_us is not None:
            for on_every in self.on_every:
                on_every(*name[:2], policy.sample_us, every)

    def _deliver(self, found: ImportedStream, entries: Sequence[StreamSample], at_us: int) -> None:
        offset = self._offset_of(found.owner)
        standing = found.standing
        if offset is not found.offset or offset is None:
            found.offset = offset
            standing = found.standing = _SKEWED if offset is None else offset.standing
        if offset is None or standing is _SKEWED:
            if found.label in AS_THEY_COME and entries:
                now_us = self._clock.federation_us(at_us)
                (found.sink or self._sink(found))(Sample(now_us, now_us, entries[-1].value, entries[-1].quality))
                return
            self.refused["clock"] += len(entries)
            return
        now_us = self._clock.federation_us(at_us)
        beyond_us = now_us + AHEAD_US
        take = found.sink or self._sink(found)
        if standing is _CORRECTED:
            take = self._shifted(found, offset, take)
        else:
            found.regrid = None
        for entry in entries:
            if entry.valid_us > beyond_us:
                self.refused["future"] += 1
            else:
                take(Sample(now_us, entry.valid_us, entry.value, entry.quality))

    def _shifted(self, found: ImportedStream, offset: Offset, take: Sink) -> Sink:
        """Valid times as our clock has them, approximated on the grid of the stream."""
        shift_us = round(offset.offset_us * self._clock.speed)
        if found.policy.sample_us is None or self.is_of_objects(found.label) or not self._is_linear(found.label):
            return lambda sample: take(_earlier(sample, shift_us))
        if found.regrid is None:
            policy = Policy(change="sample", sample_us=found.policy.sample_us, from_us=0, approximation="linear")
            found.regrid = PolicyAdapter(policy)
        regrid = found.regrid

        def on_grid(sample: Sample) -> None:
            for shifted in regrid.on_sample(_earlier(sample, shift_us), sample.available_us):
                take(shifted)

        return on_grid

    def _is_linear(self, semantic_label: str) -> bool:
        """Whether something lies between two of its values: not between two texts."""
        fields = self._ontology[semantic_label].sort.fields if semantic_label in self._ontology else ()
        return not any(field.unit in {"text", "bool"} for field in fields)

    def _sink(self, found: ImportedStream) -> Sink:
        found.sink = self._source(found.owner, found.label)
        return found.sink

    def _source(self, sender: str, semantic_label: str) -> Sink:
        """`push(m, s, v)` of 9.3.3 for one (m, s): adds to the local source, which is made at the first sample.

        A value that is not of the label's sort, or not in the range of its units, is dropped and counted.
        """
        known = self._sinks.get((sender, semantic_label))
        if known is not None:
            return known
        local, _ = self._declare(semantic_label, sender)
        sort, to_local = self._ontology[semantic_label].sort, self._translation.to_local(semantic_label)
        trust = self._trust.declared(sender)
        judge = partial(self._motion.take, sender, semantic_label) if semantic_label in JUDGED else None
        push, is_in_range = to_local.into(self._network.generator(local).push), in_range(sort)

        def add(sample: Sample) -> None:
            try:
                sort.check(sample.value)
            except SortError:
                self.refused["sort"] += 1
                return
            if not is_in_range(sample.value):
                self.refused["range"] += 1
                return
            if judge is not None:
                judge(sample)
            if trust < 1.0:
                quality = sample.quality
                sample = sample._replace(quality=quality._replace(certainty=trust * quality.certainty))
            push(sample)

        self._sinks[sender, semantic_label] = add
        return add


def _earlier(sample: Sample, shift_us: int) -> Sample:
    """The sample with its times shifted, also that of a prediction."""
    quality, made = sample.quality, sample.quality.prediction
    if made is not None:
        quality = quality._replace(prediction=made._replace(made_us=made.made_us - shift_us))
    return sample._replace(valid_us=sample.valid_us - shift_us, quality=quality)
