"""The import proxy of a platform: remote streams come in as local sources (thesis 9.3.3)."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from dyknow import SURE, Label, Network, Policy, PolicyAdapter, Quality, Sample, Value, converted_quality
from dyknow.errors import SortError
from federation import keys
from federation.clock import FederationClock, Offset, Standing
from federation.codec import WireSample, decode_recovered, decode_samples
from federation.deadlines import Deadlines
from federation.ontology import Convert, Ontology, Translation
from federation.streams import ImportStream
from federation.transport import Answered, Arrived, AskEnded, Subscribe, Unsubscribe, WireEffect

MAX_STREAMS = 4096
_SKEWED, _CORRECTED = Standing.SKEWED, Standing.CORRECTED
Sink: TypeAlias = Callable[[int, Value, int, Quality], None]
"""Takes valid time, value and available time of a sample into the local instance."""

AHEAD_US = 60_000_000
"""How far in the future a sample may be valid: a prediction is legal, a sample that ends its stream is not."""


@dataclass(slots=True)
class Import:
    """One stream of one owner, and the policy it was promised under; `standing` is that of `offset`."""

    stream: ImportStream
    policy: Policy
    heard_us: int
    regrid: PolicyAdapter | None = None
    sink: Sink | None = None
    due_us: int | None = None
    offset: Offset | None = None
    standing: Standing = _SKEWED


class ImportProxy:
    """Takes samples off the wire, once each, and pushes them into the local instance. `changes` counts streams that
    began or ended; `told` has the tails that `on_tails` need not be told of again, by owner.

    What a peer sends whose clock is skewed, or not compared yet, is refused and counted: one valid time far ahead would
    end an ordered stream. Valid times of a peer whose clock is off by 50 ms to 1 s are shifted, and approximated linearly onto the grid of
    the stream, since shifted samples lie on none (semantics of offsets between platforms). Times: node clock, but
    for valid times.
    """

    def __init__(
        self,
        network: Network,
        ontology: Ontology,
        translation: Translation,
        clock: FederationClock,
        offset_of: Callable[[str], Offset | None],
        questions: Iterator[int],
        emit: Callable[[WireEffect], None],
        source: Callable[[str, str], tuple[Label, Convert]],
    ) -> None:
        self._network, self._ontology, self._translation = network, ontology, translation
        self._clock, self._offset_of, self._questions, self._emit, self._declare = (
            clock,
            offset_of,
            questions,
            emit,
            source,
        )
        self.imports: dict[tuple[str, str, str], Import] = {}
        self._listening: dict[str, Import] = {}
        self._asked: dict[int, Import] = {}
        self._sinks: dict[tuple[str, str], Sink] = {}
        self._due: Deadlines[tuple[str, str, str]] = Deadlines()
        self.changes = 0
        self.told: dict[str, Sequence[tuple[str, str, int]]] = {}
        self.refused: Counter[str] = Counter()

    def expect(self, owner: str, semantic_label: str, policy_hash: str, policy: Policy, now_us: int) -> None:
        """`owner` announced a stream for us: listen to it. Saying it twice is saying it once."""
        name = (owner, semantic_label, policy_hash)
        if name in self.imports or len(self.imports) >= MAX_STREAMS or semantic_label not in self._ontology:
            return
        stream = ImportStream(owner, semantic_label, policy_hash, self._questions)
        self.imports[name] = self._listening[keys.stream(*name)] = Import(stream, policy, now_us)
        self.told.pop(owner, None)
        self.changes += 1
        self._emit(Subscribe(keys.stream_expr(semantic_label, policy_hash)))

    def end(self, owner: str, semantic_label: str, policy_hash: str) -> None:
        """The stream ended; its source and history stay for queries."""
        if self.imports.pop((owner, semantic_label, policy_hash), None) is None:
            return
        del self._listening[keys.stream(owner, semantic_label, policy_hash)]
        self._due.set((owner, semantic_label, policy_hash), None)
        self.told.pop(owner, None)
        self.changes += 1
        if not any(name[1:] == (semantic_label, policy_hash) for name in self.imports):
            self._emit(Unsubscribe(keys.stream_expr(semantic_label, policy_hash)))

    def on_owner(self, owner: str, boot: int) -> None:
        """The directory says which life of `owner` is there: what an older one numbered counts no more."""
        self.told.pop(owner, None)
        for found in self.imports.values():
            if found.stream.owner == owner:
                found.stream.on_owner(boot)
                self._wake(found)

    def heard_us(self) -> dict[tuple[str, str], int]:
        """By owner and semantic label, when a stream that is expected was last heard of."""
        heard: dict[tuple[str, str], int] = {}
        for (owner, semantic_label, _), found in self.imports.items():
            name = owner, semantic_label
            heard[name] = max(found.heard_us, heard.get(name, found.heard_us))
        return heard

    def on_arrived(self, event: Arrived) -> bool:
        """Samples were put on a stream's key; False if it is no stream's.

        Raises:
            DecodeError: they are malformed.
        """
        key, at_us, payload = event
        found = self._listening.get(key)
        if found is None:
            return type(keys.parse_key(key)) is keys.StreamKey
        boot, entries = decode_samples(payload)
        found.heard_us = at_us
        self._deliver(found, found.stream.on_samples(boot, entries, at_us), at_us)
        return True

    def on_tails(self, owner: str, boot: int, tails: Sequence[tuple[str, str, int]], now_us: int) -> bool:
        """A heartbeat of `owner` says how far its streams have come: what was lost last shows, too.

        Returns whether anything is due because of it.
        """
        is_due = False
        for semantic_label, policy_hash, tail in tails:
            found = self.imports.get((owner, semantic_label, policy_hash))
            if found is None:
                continue
            self.told[owner] = tails
            if not found.stream.has(boot, tail):
                found.stream.on_tail(boot, tail, now_us)
                self._wake(found)
                is_due = is_due or found.stream.deadline_us is not None
        return is_due

    def on_answered(self, event: Answered) -> bool:
        """An answer to one of our questions; False when it is somebody else's."""
        found = self._asked.get(event.question)
        if found is None:
            return False
        self._deliver(found, found.stream.on_recovered(decode_recovered(event.payload), event.at_us), event.at_us)
        return True

    def on_ask_ended(self, event: AskEnded) -> bool:
        found = self._asked.pop(event.question, None)
        if found is not None:
            found.stream.on_ask_ended(event.question, event.at_us)
            self._wake(found)
        return found is not None

    def on_time(self, now_us: int) -> None:
        """Ask for what is missing."""
        for name in self._due.pop_due(now_us):
            found = self.imports.get(name)
            if found is None:
                continue
            found.due_us = None
            for ask in found.stream.on_time(now_us):
                self._asked[ask.question] = found
                self._emit(ask)
            self._wake(found)

    @property
    def deadline_us(self) -> int | None:
        return self._due.next_us

    def _wake(self, found: Import) -> None:
        stream = found.stream
        if (due_us := stream.deadline_us) != found.due_us:
            found.due_us = due_us
            self._due.set((stream.owner, stream.label, stream.policy_hash), due_us)

    def _deliver(self, found: Import, entries: Sequence[WireSample], at_us: int) -> None:
        self._wake(found)
        offset = self._offset_of(found.stream.owner)
        standing = found.standing
        if offset is not found.offset or offset is None:
            found.offset = offset
            standing = found.standing = _SKEWED if offset is None else offset.standing
        if offset is None or standing is _SKEWED:
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
                take(entry.valid_us, entry.value, now_us, entry.quality)

    def _shifted(self, found: Import, offset: Offset, take: Sink) -> Sink:
        """Valid times as our clock has them, approximated on the grid of the stream."""
        shift_us = round(offset.offset_us * self._clock.speed)
        if found.policy.sample_us is None:
            return lambda valid_us, value, now_us, quality: take(valid_us - shift_us, value, now_us, quality)
        if found.regrid is None:
            policy = Policy(change="sample", sample_us=found.policy.sample_us, from_us=0, approximation="linear")
            found.regrid = PolicyAdapter(policy)
        regrid = found.regrid

        def on_grid(valid_us: int, value: Value, now_us: int, quality: Quality) -> None:
            for sample in regrid.on_sample(Sample(now_us, valid_us - shift_us, value, quality), now_us):
                take(sample.valid_us, sample.value, sample.available_us, sample.quality)

        return on_grid

    def push(self, sender: str, semantic_label: str, sample: Sample) -> None:
        """`push(m, s, v)` of 9.3.3: add the sample to the local source, made at the first sample of the label.

        A value that is not of the label's sort is dropped and counted.
        """
        self._source(sender, semantic_label)(sample.valid_us, sample.value, sample.available_us, sample.quality)

    def _sink(self, found: Import) -> Sink:
        found.sink = self._source(found.stream.owner, found.stream.label)
        return found.sink

    def _source(self, sender: str, semantic_label: str) -> Sink:
        known = self._sinks.get((sender, semantic_label))
        if known is not None:
            return known
        local, _ = self._declare(semantic_label, sender)
        check, to_local, push = (
            self._ontology[semantic_label].sort.check,
            self._translation.to_local(semantic_label),
            self._network.generator(local).push,
        )

        def add(valid_us: int, value: Value, now_us: int, quality: Quality) -> None:
            try:
                check(value)
            except SortError:
                self.refused["sort"] += 1
                return
            local = to_local(value)
            if quality is not SURE and local is not value:
                quality = converted_quality(quality, value, local)
            push(valid_us, local, now_us, quality)

        self._sinks[sender, semantic_label] = add
        return add
