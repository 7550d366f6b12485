"""Exported streams: numbered where they leave, mended where they arrive (thesis 9.3.3). Pure: knows no transport.

The owner numbers the samples of one (label, policy) from 1 on, puts each once for all receivers, keeps the last ones
in a ring and announces the newest number (the tail) in its heartbeat. A receiver delivers samples as they come,
once each, and asks for the numbers it misses while the owner still holds them. Order is restored by policies
downstream, which know about delay; here nothing is held back.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from dyknow.federation import keys
from dyknow.federation.messages import codec
from dyknow.federation.messages.unpacking import packer
from dyknow.federation.transport import Ask, Put, Urgency
from dyknow.model.sample import Sample

RING = 600
"""Samples an export keeps for recovery: 10 Hz through an outage of a minute."""
PAGE = 256
RANGES = 32
MISSING = 4096
REORDER_US = 30_000
RETRY_US = 50_000
RETRY_MOST_US = 2_000_000
ASK_TIMEOUT_US = 1_000_000


class ExportStream:
    """The owner's side of one stream: numbers, puts and remembers samples.

    Attributes:
        tail: number of the newest sample, 0 before the first.
    """

    __slots__ = ("_pack", "_ring", "boot", "key", "label", "owner", "policy_hash", "tail")

    def __init__(
        self, owner: str, label: str, policy_hash: str, boot: int, capacity: int = RING, *, tail: int = 0
    ) -> None:
        self.owner, self.label, self.policy_hash, self.boot = owner, label, policy_hash, boot
        self.key = keys.stream(owner, label, policy_hash)
        self.tail = tail
        self._ring: deque[codec.StreamSample] = deque(maxlen=capacity)
        self._pack = packer()

    def on_sample(self, sample: Sample) -> Put:
        """Number a sample and put it, for every receiver at once."""
        return self.put((self.number(sample),))

    def number(self, sample: Sample) -> codec.StreamSample:
        """Number a sample and keep it for receivers that lost it; it is still to be put."""
        self.tail += 1
        entry = codec.StreamSample(self.tail, sample.valid_us, sample.value, sample.quality)
        self._ring.append(entry)
        return entry

    def put(self, entries: Sequence[codec.StreamSample], riders: Sequence[codec.Rider] = (), every: int = 1) -> Put:
        """Put numbered samples in one go, in their order, and those of other streams that travel with them."""
        return Put(self.key, codec.encode_samples(self.boot, entries, self._pack, riders, every), Urgency.STREAM)

    def ride(self, entries: Sequence[codec.StreamSample]) -> codec.Rider:
        """Numbered samples that travel with those of another stream."""
        return codec.Rider(self.label, self.policy_hash, entries)

    @property
    def oldest(self) -> int:
        """The smallest number that is still held; one beyond the tail when nothing is."""
        return self._ring[0].seq if self._ring else self.tail + 1

    def held(self, first: int, last: int) -> Iterator[codec.StreamSample]:
        """The held samples of numbers first..last, both inclusive."""
        start = max(0, first - self.oldest)
        for at in range(start, min(len(self._ring), last - self.oldest + 1)):
            yield self._ring[at]

    def answer(self, ranges: Iterable[tuple[int, int]]) -> list[bytes]:
        """The samples of `ranges` that are still held, in payloads of a bounded number of samples; at least one.

        Each payload says which number is the oldest held, so that the receiver knows what is lost for good.
        """
        found = [entry for first, last in ranges for entry in self.held(first, last)]
        pages = [found[at : at + PAGE] for at in range(0, len(found), PAGE)] or [[]]
        return [codec.encode_recovered(codec.Recovered(self.boot, self.oldest, self.tail, page)) for page in pages]


@dataclass(slots=True)
class StreamCounts:
    """Counts of the samples of one imported stream.

    `received` counts deliveries, `recovered` those among them that came late or by asking, `duplicates` what was
    dropped because it had been delivered, `stale` what an earlier incarnation of the owner sent, `lost` the numbers
    that the owner says it holds no more.
    """

    received: int = 0
    recovered: int = 0
    duplicates: int = 0
    stale: int = 0
    lost: int = 0


class ImportStream:
    """The receiver's side of one stream of one owner.

    `first` is the number of the first sample that is wanted, when the contract names it; else the stream begins
    with whatever is heard of first. A new incarnation of the owner begins at its first number.
    """

    __slots__ = (
        "_asked", "_backoff_us", "_due_us", "_missing", "_next", "_progress", "_questions", "account", "boot",
        "label", "owner", "policy_hash",
    )  # fmt: skip

    def __init__(
        self,
        owner: str,
        label: str,
        policy_hash: str,
        questions: Iterator[int],
        *,
        boot: int | None = None,
        first: int | None = None,
    ) -> None:
        self.owner, self.label, self.policy_hash = owner, label, policy_hash
        self.boot = boot
        self.account = StreamCounts()
        self._questions = questions
        self._next = first
        self._missing: set[int] = set()
        self._asked: int | None = None
        self._due_us: int | None = None
        self._backoff_us = RETRY_US
        self._progress = False

    @property
    def missing(self) -> int:
        """How many numbers are known to exist and have not arrived."""
        return len(self._missing)

    @property
    def deadline_us(self) -> int | None:
        return None if self._asked is not None else self._due_us

    def on_samples(self, boot: int, entries: Sequence[codec.StreamSample], now_us: int) -> Sequence[codec.StreamSample]:
        """Take what was put on the stream's key; returns what is new, as it came."""
        if boot == self.boot and len(entries) == 1 and entries[0].seq == self._next:
            self._next += 1
            self.account.received += 1
            return entries
        if boot == self.boot and self._next is not None and self._is_next_run(entries):
            self._next += len(entries)
            self.account.received += len(entries)
            return entries
        if not self._is_current(boot):
            self.account.stale += len(entries)
            return ()
        return [entry for entry in entries if self._is_new(entry.seq, now_us)]

    def _is_next_run(self, entries: Sequence[codec.StreamSample]) -> bool:
        first = self._next or 0
        return [entry.seq for entry in entries] == list(range(first, first + len(entries)))

    def has(self, boot: int, tail: int) -> bool:
        """Whether `tail` of that life is known of already: most heartbeats tell nothing new."""
        return boot == self.boot and self._next is not None and tail < self._next

    def on_tail(self, boot: int, tail: int, now_us: int) -> None:
        """The owner's heartbeat says that `tail` is the newest number of this stream."""
        if tail < 1 or not self._is_current(boot):
            return
        if self._next is None:
            self._next = tail
        if tail >= self._next:
            self._miss(self._next, tail, now_us)
            self._next = tail + 1

    def on_recovered(self, answer: codec.Recovered, now_us: int) -> list[codec.StreamSample]:
        """Take one answer to our question; returns what is new."""
        if not self._is_current(answer.boot):
            self.account.stale += len(answer.samples)
            return []
        fresh = [entry for entry in answer.samples if self._is_new(entry.seq, now_us)]
        gone = [seq for seq in self._missing if seq < answer.oldest]
        self.account.lost += len(gone)
        self._missing.difference_update(gone)
        self._progress = self._progress or bool(fresh or gone)
        self.on_tail(answer.boot, answer.tail, now_us)
        return fresh

    def on_ask_ended(self, question: int, now_us: int) -> None:
        """No more answers will come: ask again for missing samples, later each time that nothing came."""
        if question != self._asked:
            return
        self._asked = None
        if not self._missing:
            self._due_us = None
            return
        self._backoff_us = RETRY_US if self._progress else min(2 * self._backoff_us, RETRY_MOST_US)
        self._due_us = now_us + (0 if self._progress else self._backoff_us)

    def on_time(self, now_us: int) -> list[Ask]:
        """Ask for missing samples when it is due."""
        if self._asked is not None or self._due_us is None or now_us < self._due_us:
            return []
        self._due_us = None
        if not self._missing or self.boot is None:
            return []
        self._asked, self._progress = next(self._questions), False
        question = codec.Range(self.policy_hash, self.boot, _ranges(self._missing)[:RANGES])
        return [Ask(self._asked, keys.history(self.owner, self.label), codec.encode_range(question), ASK_TIMEOUT_US)]

    def on_owner(self, boot: int) -> None:
        """The directory says which life of the owner is there. A new one restarts the stream."""
        if boot == self.boot:
            return
        self.account.lost += len(self._missing)
        self._missing.clear()
        if self.boot is not None:
            self._next = None
        self._asked, self._due_us, self._backoff_us = None, None, RETRY_US
        self.boot = boot

    def _is_current(self, boot: int) -> bool:
        """Whether something of life `boot` counts; a later life has a greater number."""
        if boot == self.boot:
            return True
        if self.boot is not None and boot < self.boot:
            return False
        self.on_owner(boot)
        return True

    def _is_new(self, seq: int, now_us: int) -> bool:
        expected = seq if self._next is None else self._next
        if seq >= expected:
            if seq > expected:
                self._miss(expected, seq - 1, now_us)
            self._next = seq + 1
        elif seq in self._missing:
            self._missing.remove(seq)
            self.account.recovered += 1
        else:
            self.account.duplicates += 1
            return False
        self.account.received += 1
        return True

    def _miss(self, first: int, last: int, now_us: int) -> None:
        """Numbers first..last exist and are not here. More than any owner keeps are lost at once: memory is bounded."""
        kept_from = max(first, last - MISSING + 1)
        self.account.lost += kept_from - first
        self._missing.update(range(kept_from, last + 1))
        excess = len(self._missing) - MISSING
        if excess > 0:
            self._missing.difference_update(sorted(self._missing)[:excess])
            self.account.lost += excess
        if self._due_us is None and self._asked is None:
            self._due_us = now_us + REORDER_US


def _ranges(numbers: Iterable[int]) -> list[tuple[int, int]]:
    """Consecutive numbers joined to (first, last), ascending."""
    found: list[tuple[int, int]] = []
    for number in sorted(numbers):
        if found and found[-1][1] == number - 1:
            found[-1] = (found[-1][0], number)
        else:
            found.append((number, number))
    return found
