"""Acts made reliable on a wire that drops: acknowledgement, retransmission, duplicate suppression.

An act is put again three times until it is acknowledged, by a list of numbers that any act of the receiver carries or
by a receipt: every 200 ms, or later where the receiver takes longer to acknowledge (`round_trip.py`). An act that ends
or answers something is worth more patience than a question, which is of no use after its reply-by: it is put again
every second after that, or later, ten times. Acts to all are put once. A platform that hears an act twice acknowledges
it twice and acts once.
"""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from dyknow.federation import keys
from dyknow.federation.messages.acts import Act
from dyknow.federation.messages.codec import MAX_ACKS
from dyknow.federation.messages.receipts import Receipt, encode_receipt, receipt_key
from dyknow.federation.messages.round_trip import LEAST_US, RoundTrip
from dyknow.federation.transport import Put, Urgency
from dyknow.model.errors import ContentError

RETRANSMISSIONS = 3
SLOW_US = 1_000_000
SLOW_RETRANSMISSIONS = 10
REPEATS, REPEATS_PER_S = 64, 16
"""Limits of the puts that are repeated, at once and in a second; each acknowledgement allows another one. More would be
late, too: an act whose turn it is then waits for its next turn."""
UNACKNOWLEDGED, OF_ONE = 4096, 1024
"""Acts that are not acknowledged, in all and by one receiver: one more, and the oldest to the receiver of most is given up."""
WINDOW = 1024
SENDERS = 512
SUSPENDED = 256

_MASK = (1 << WINDOW) - 1


class SeenActs:
    """Which acts of one life of a sender have arrived: the greatest number, and a bitmap below it."""

    __slots__ = ("bitmap", "boot", "greatest")

    def __init__(self, boot: int) -> None:
        self.boot, self.greatest, self.bitmap = boot, -1, 0

    def is_new(self, boot: int, seq: int) -> bool:
        """Whether this act was not seen before; from now on it was. Earlier lives and very old numbers count as seen."""
        if boot != self.boot:
            if boot < self.boot:
                return False
            self.boot, self.greatest, self.bitmap = boot, -1, 0
        if seq > self.greatest:
            ahead = seq - self.greatest
            self.bitmap = ((self.bitmap << ahead) & _MASK if ahead < WINDOW else 0) | 1
            self.greatest = seq
            return True
        behind = self.greatest - seq
        if behind >= WINDOW or self.bitmap >> behind & 1:
            return False
        self.bitmap |= 1 << behind
        return True


@dataclass(slots=True)
class _Pending:
    act: Act
    put: Put
    put_us: int
    due_us: int
    is_patient: bool
    quick: int = RETRANSMISSIONS
    slow: int = SLOW_RETRANSMISSIONS
    is_repeated: bool = False

    def again(self, now_us: int, peer: RoundTrip) -> bool:
        """Whether it is put again; then it is due later."""
        if not self.is_patient and self.act.reply_by_us is not None and now_us >= self.act.reply_by_us:
            return False
        if self.quick:
            self.quick, self.due_us = self.quick - 1, now_us + peer.pause_us
            return True
        if self.slow == SLOW_RETRANSMISSIONS:
            peer.on_silence(now_us)
        if self.slow and self.is_patient:
            self.slow, self.due_us = self.slow - 1, now_us + max(SLOW_US, peer.pause_us)
            return True
        return False


class Delivery:
    """Numbers, puts and repeats own acts, and acknowledges those of others. Times are the node clock."""

    def __init__(
        self,
        unit: str,
        boot: int,
        encode: Callable[[Act], bytes],
        receipt_bytes: Callable[[str, Receipt], bytes] = lambda _receiver, receipt: encode_receipt(receipt),
    ) -> None:
        self.unit, self.boot, self._receipt_bytes = unit, boot, receipt_bytes
        self.counts: Counter[str] = Counter()
        self._encode = encode
        self._seq = 0
        self._pending: dict[tuple[str, int], _Pending] = {}
        self._waiting: Counter[str] = Counter()
        self._peers: dict[str, RoundTrip] = {}
        self._repeats: float = REPEATS
        self._refilled_us = 0
        self._due_us: int | None = None
        self._seen: dict[str, SeenActs] = {}
        self._owed: dict[str, tuple[int, list[int]]] = {}
        self._suspended: dict[str, tuple[int | None, list[Act]]] = {}

    @property
    def next_seq(self) -> int:
        """The number that the next act gets."""
        return self._seq + 1

    @property
    def deadline_us(self) -> int | None:
        return self._due_us

    @property
    def unacknowledged(self) -> int:
        """How many acts are not acknowledged yet."""
        return len(self._pending)

    def send(self, act: Act, now_us: int, *, patient: bool = True) -> tuple[Act, Put]:
        """Return the numbered act and its first put. Raises ContentError when it cannot be encoded.

        Its number is taken first: while it is encoded another act may be sent, to a subscriber of the message log.
        """
        receiver = act.receiver.unit
        acks = tuple(self._owed.get(receiver, (0, ()))[1])
        self._seq += 1
        numbered = act._replace(boot=self.boot, seq=self._seq, created_us=now_us, acks=acks)
        try:
            put = self._put(numbered, now_us, patient=patient)
        except ContentError:
            self._seq -= self._seq == numbered.seq
            raise
        self._owed.pop(receiver, None)
        self.counts["sent"] += 1
        return numbered, put

    def _put(self, act: Act, now_us: int, *, patient: bool) -> Put:
        put = Put(act.key, self._encode(act), Urgency.ACT)
        if act.receiver.unit != keys.EVERYBODY:
            receiver = act.receiver.unit
            if self._waiting.get(receiver, 0) >= OF_ONE:
                self._give_up(receiver, now_us)
            elif len(self._pending) >= UNACKNOWLEDGED:
                self._give_up(self._waiting.most_common(1)[0][0], now_us)
            pause_us = self._peer(receiver).pause_us
            if not patient and act.reply_by_us is not None:  # it is put twice while it is of use
                pause_us = min(pause_us, max(LEAST_US, (act.reply_by_us - now_us) // 2))
            due_us = now_us + pause_us
            self._pending[receiver, act.seq] = _Pending(act, put, now_us, due_us, patient)
            self._waiting[receiver] += 1
            self._wake(due_us)
        return put

    def on_act(self, act: Act, now_us: int) -> bool:
        """Note an act that arrived and the acknowledgements it carries; False if it was seen before."""
        sender = act.sender.unit
        self._acknowledged(sender, act.acks, now_us)
        seen = self._seen.pop(sender, None) or SeenActs(act.boot)
        self._seen[sender] = seen
        if len(self._seen) > SENDERS:
            del self._seen[next(iter(self._seen))]
        is_new = seen.is_new(act.boot, act.seq)
        if act.boot == seen.boot and act.receiver.unit != keys.EVERYBODY:
            self._owe(sender, act.boot, act.seq)
        self.counts["received" if is_new else "duplicate"] += 1
        return is_new

    def forgo(self, sender: str) -> None:
        """Acknowledge nothing of it in this step."""
        self._owed.pop(sender, None)

    def on_receipt(self, sender: str, receipt: Receipt, now_us: int) -> None:
        """A bare acknowledgement of `sender`; one of acts of an earlier life of ours is ignored."""
        if receipt.boot == self.boot:
            self._acknowledged(sender, receipt.seqs, now_us)

    def flush(self) -> list[Put]:
        """Receipts for acts that no act of this step acknowledged. Call at the end of a step."""
        if not self._owed:
            return []
        puts = [
            Put(receipt_key(unit, self.unit), self._receipt_bytes(unit, Receipt(boot, seqs)), Urgency.ACT)
            for unit, (boot, seqs) in self._owed.items()
        ]
        self._owed.clear()
        return puts

    def on_time(self, now_us: int) -> tuple[list[Put], list[Act]]:
        """The puts to repeat, and the acts that are given up as undelivered."""
        if self._due_us is None or now_us < self._due_us:
            return [], []
        self._due_us = None
        puts: list[Put] = []
        undelivered: list[Act] = []
        self._repeats = min(REPEATS, self._repeats + (now_us - self._refilled_us) * REPEATS_PER_S / 1e6)
        self._refilled_us = now_us
        for name, pending in list(self._pending.items()):
            if now_us >= pending.due_us:
                if not pending.again(now_us, self._peer(name[0])):
                    self._taken(name)
                    undelivered.append(pending.act)
                    continue
                if len(puts) < self._repeats:
                    puts.append(pending.put)
                    pending.is_repeated = True
                    self._pending[name] = self._pending.pop(name)  # the next time others come first
            self._wake(pending.due_us)
        self._repeats -= len(puts)
        self.counts["retransmitted"] += len(puts)
        self.counts["undelivered"] += len(undelivered)
        return puts, undelivered

    def peer_gone(self, unit: str) -> None:
        """Nothing more is put to it; answers and ends that it may lack wait for its return."""
        self._owed.pop(unit, None)
        self._peers.pop(unit, None)
        waiting = [name for name in self._pending if name[0] == unit]
        acts = [pending.act for name in waiting if (pending := self._taken(name)) is not None and pending.is_patient]
        if acts:
            self._suspended[unit] = (self.boot_of(unit), acts[-SUSPENDED:])
            while len(self._suspended) > SENDERS:
                del self._suspended[next(iter(self._suspended))]

    def peer_appeared(self, unit: str, boot: int, now_us: int) -> list[Put]:
        """Life `boot` of a platform is there: if it is the one that went, what it may lack is put again.

        The directory knows which life is there, should its number be less than that of the last.
        """
        seen = self._seen.get(unit)
        if seen is not None and seen.boot != boot:
            self._seen[unit] = SeenActs(boot)
        went, acts = self._suspended.pop(unit, (boot, []))
        return [
            self._put(act._replace(created_us=now_us, acks=()), now_us, patient=True) for act in acts if went == boot
        ]

    def boot_of(self, unit: str) -> int | None:
        """Which life of `unit` spoke last, if any was heard."""
        seen = self._seen.get(unit)
        return None if seen is None else seen.boot

    def waiting(self, unit: str) -> int:
        """How many acts to `unit` are not acknowledged yet."""
        return self._waiting.get(unit, 0)

    def _taken(self, name: tuple[str, int]) -> _Pending | None:
        """Take an act off those that are not acknowledged."""
        pending = self._pending.pop(name, None)
        if pending is not None:
            self._waiting[name[0]] -= 1
            if not self._waiting[name[0]]:
                del self._waiting[name[0]]
        return pending

    def _give_up(self, receiver: str, now_us: int) -> None:
        """Too much is unacknowledged: the oldest act to a receiver is not put again, and reported as undelivered."""
        for (unit, _), pending in self._pending.items():
            if unit == receiver and (pending.quick or pending.slow):
                pending.quick, pending.slow, pending.due_us = 0, 0, now_us
                self._wake(now_us)
                return

    def _acknowledged(self, sender: str, seqs: Iterable[int], now_us: int) -> None:
        for seq in seqs:
            pending = self._taken((sender, seq))
            self._repeats += pending is not None
            if pending is not None and pending.is_repeated:
                self._peer(sender).on_late(now_us)
            elif pending is not None:
                self._peer(sender).on_measured(now_us - pending.put_us)

    def _peer(self, unit: str) -> RoundTrip:
        peer = self._peers.get(unit)
        if peer is None:
            if len(self._peers) >= SENDERS:
                del self._peers[next(iter(self._peers))]
            peer = self._peers[unit] = RoundTrip()
        return peer

    def _owe(self, sender: str, boot: int, seq: int) -> None:
        owed = self._owed.get(sender)
        if owed is None or owed[0] != boot:
            owed = self._owed[sender] = (boot, [])
        if len(owed[1]) < MAX_ACKS and seq not in owed[1]:
            owed[1].append(seq)

    def _wake(self, due_us: int) -> None:
        if self._due_us is None or due_us < self._due_us:
            self._due_us = due_us
