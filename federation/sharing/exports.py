"""The exports that a platform has promised, to whom, and until when (thesis 9.3.3: the export proxy)."""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple, TypeAlias

from dyknow.federation.messages.beats import MAX_TAILS
from dyknow.federation.messages.codec import Recovered, decode_range, encode_recovered
from dyknow.federation.sharing.streams import RING, ExportStream
from dyknow.federation.transport import Answer, AnswerEnd, Asked
from dyknow.model.errors import DecodeError, Refused
from dyknow.policies.policy import Policy

STREAMS = 256
LINGER_US = 30_000_000
"""How long a receiver may be out of reach before its contract ends, and an ended stream's ring is kept."""


class EndReason(StrEnum):
    """Why a contract or a stream ended, in words for users."""

    STOPPED = "stopped"
    DURATION = "end of its duration"
    RECEIVERS = "last receiver gone"


class ContractEnded(NamedTuple):
    """A contract is over for all its receivers."""

    contract: str
    label: str
    policy_hash: str
    receivers: tuple[str, ...]
    why: EndReason


class StreamEnded(NamedTuple):
    """The stream has no receiver: its local subscription can end."""

    label: str
    policy_hash: str
    why: EndReason


ExportEvent: TypeAlias = ContractEnded | StreamEnded
StreamName: TypeAlias = tuple[str, str]
"""Semantic label and policy hash."""


@dataclass(slots=True)
class _Contract:
    stream: StreamName
    receivers: set[str]


@dataclass(slots=True)
class _Export:
    stream: ExportStream
    policy: Policy
    ends_us: int | None
    contracts: set[str] = field(default_factory=set)
    retired_us: int | None = None


class Exports:
    """The contracts of one platform. A (label, policy) is one stream, whatever the number of its receivers.

    A contract ends when it is stopped, at `to` plus the maximum delay of its policy, or when its last receiver has
    been gone for `linger_us` (a cut that heals sooner costs no sample that the ring holds) or was restarted. Times
    are the node clock; the duration of a policy is federation time, which `wall_us` turns into the node clock.
    """

    def __init__(
        self,
        owner: str,
        boot: int,
        wall_us: Callable[[int], int] = lambda federation_us: federation_us,
        *,
        capacity: int = RING,
        linger_us: int = LINGER_US,
        streams: int = STREAMS,
    ) -> None:
        self.owner, self.boot = owner, boot
        self.refused: Counter[str] = Counter()
        self._wall_us = wall_us
        self._capacity, self._linger_us, self._streams = capacity, linger_us, streams
        self._exports: dict[StreamName, _Export] = {}
        self._contracts: dict[str, _Contract] = {}
        self._absent: dict[str, tuple[int, int | None]] = {}
        self._tails: dict[StreamName, int] = {}
        self._turn = 0
        self._receivers: dict[StreamName, frozenset[str]] = {}
        self._due_us: int | None = None

    def open(self, contract: str, label: str, policy: Policy, receivers: Iterable[str]) -> tuple[ExportStream, bool]:
        """Promise a stream to receivers; returns it and whether it is new, that is, needs a local subscription.

        Raises:
            Refused: the platform exports as many streams as it may, no receiver is named, or the contract is taken.
        """
        wanted = set(receivers)
        if not wanted:
            raise Refused("a stream needs a receiver", "no-receiver")
        name = (label, policy.content_hash())
        if contract in self._contracts and self._contracts[contract].stream != name:
            raise Refused(f"contract {contract} is about another stream", "other-task")
        export = self._exports.get(name)
        is_new = export is None or export.retired_us is not None
        if export is None:
            self._make_room()
            tail = self._tails.get(name, 0)
            stream = ExportStream(self.owner, label, name[1], self.boot, self._capacity, tail=tail)
            export = self._exports[name] = _Export(stream, policy, self._end_of(policy))
            self._hasten(None if export.ends_us is None else export.ends_us + 1)
        export.retired_us = None
        export.contracts.add(contract)
        self._contracts.setdefault(contract, _Contract(name, set())).receivers |= wanted
        self._receivers.clear()
        return export.stream, is_new

    def stop(self, contract: str, now_us: int, receivers: Iterable[str] | None = None) -> list[ExportEvent]:
        """End a contract, or only for some of its receivers; others for the same stream continue."""
        held = self._contracts.get(contract)
        if held is not None and receivers is not None and (stay := held.receivers.difference(receivers)):
            gone, held.receivers = held.receivers - stay, stay
            self._receivers.clear()
            return [ContractEnded(contract, *held.stream, tuple(sorted(gone)), EndReason.STOPPED)] if gone else []
        return self._end(contract, EndReason.STOPPED, now_us)

    def has(self, contract: str) -> bool:
        """Whether the contract is open."""
        return contract in self._contracts

    def receiver_gone(self, unit: str, now_us: int, boot: int | None = None) -> None:
        """The directory calls a receiver gone; its contracts end unless this life of it is back in time."""
        self._absent.setdefault(unit, (now_us, boot))
        self._hasten(now_us + self._linger_us)

    def receiver_back(self, unit: str) -> None:
        """The same incarnation is back."""
        self._absent.pop(unit, None)

    def receiver_appeared(self, unit: str, boot: int, now_us: int) -> list[ExportEvent]:
        """A receiver is there again; its contracts continue if it is the life that went."""
        _, known = self._absent.pop(unit, (0, boot))
        return [] if known in (None, boot) else self._drop(unit, now_us)

    def receiver_restarted(self, unit: str, now_us: int) -> list[ExportEvent]:
        """A new incarnation knows nothing of the contracts of the old one."""
        self._absent.pop(unit, None)
        return self._drop(unit, now_us)

    def stream(self, label: str, policy_hash: str) -> ExportStream | None:
        """The living stream of that name."""
        export = self._exports.get((label, policy_hash))
        return None if export is None or export.retired_us is not None else export.stream

    def receivers(self, label: str, policy_hash: str) -> frozenset[str]:
        """Receivers of the stream of that name, by any contract."""
        found = self._receivers.get((label, policy_hash))
        if found is None:
            export = self._exports.get((label, policy_hash))
            contracts = () if export is None else export.contracts
            found = frozenset[str]().union(*(self._contracts[c].receivers for c in contracts))
            self._receivers[label, policy_hash] = found
        return found

    def is_shared(self, prefix: str) -> bool:
        """Whether all receivers of the contracts whose names begin with `prefix` get the same streams by others, too."""
        named = {name for name in self._contracts if name.startswith(prefix)}
        for name in named:
            held = self._contracts[name]
            others = self._exports[held.stream].contracts - named
            if not held.receivers <= set().union(*(self._contracts[other].receivers for other in others)):
                return False
        return True

    def streams(self) -> list[tuple[ExportStream, tuple[str, ...]]]:
        """The living streams, and the receivers of each."""
        return [
            (export.stream, tuple(sorted({u for c in export.contracts for u in self._contracts[c].receivers})))
            for export in self._exports.values()
            if export.retired_us is None
        ]

    def tails(self) -> list[tuple[str, str, int]]:
        """(label, policy hash, newest number) of each stream whose ring is held, for the heartbeat; of many, some in turn."""
        tails = [(*name, export.stream.tail) for name, export in self._exports.items() if export.stream.tail]
        if len(tails) <= MAX_TAILS:
            return tails
        self._turn = (self._turn + MAX_TAILS) % len(tails)
        return (tails[self._turn :] + tails[: self._turn])[:MAX_TAILS]

    def on_asked(self, asked: Asked, label: str) -> list[Answer | AnswerEnd]:
        """Answer a receiver that misses samples of `label`."""
        try:
            question = decode_range(asked.payload)
        except DecodeError as error:
            self.refused[error.reason] += 1
            return [AnswerEnd(asked.ask)]
        export = self._exports.get((label, question.policy_hash))
        asked_now = question.boot == self.boot
        if export is not None:
            pages = export.stream.answer(question.ranges if asked_now else ())
        else:
            beyond = max((last for _, last in question.ranges), default=0) + 1 if asked_now else 1
            pages = [encode_recovered(Recovered(self.boot, beyond, 0, []))]
        return [*(Answer(asked.ask, asked.key, page) for page in pages), AnswerEnd(asked.ask)]

    def _hasten(self, due_us: int | None) -> None:
        if due_us is not None and (self._due_us is None or due_us < self._due_us):
            self._due_us = due_us

    def _earliest_us(self) -> int | None:
        due = [since_us + self._linger_us for since_us, _ in self._absent.values()]
        for export in self._exports.values():
            if export.retired_us is not None:
                due.append(export.retired_us + self._linger_us)
            elif export.ends_us is not None:
                due.append(export.ends_us + 1)
        return min(due, default=None)

    @property
    def deadline_us(self) -> int | None:
        """When something may be over; that it has come back meanwhile is seen then."""
        return self._due_us

    def on_time(self, now_us: int) -> list[ExportEvent]:
        """End what is over by now."""
        events: list[ExportEvent] = []
        if self._due_us is None or now_us < self._due_us:
            return events
        for unit in [unit for unit, (since_us, _) in self._absent.items() if now_us >= since_us + self._linger_us]:
            del self._absent[unit]
            events += self._drop(unit, now_us)
        for name, export in list(self._exports.items()):
            if export.retired_us is None and export.ends_us is not None and now_us > export.ends_us:
                for contract in sorted(export.contracts):
                    events += self._end(contract, EndReason.DURATION, now_us)
            elif export.retired_us is not None and now_us >= export.retired_us + self._linger_us:
                self._forget(name)
        self._due_us = self._earliest_us()
        return events

    def _drop(self, unit: str, now_us: int) -> list[ExportEvent]:
        events: list[ExportEvent] = []
        self._receivers.clear()
        for contract, held in list(self._contracts.items()):
            held.receivers.discard(unit)
            if not held.receivers:
                events += self._end(contract, EndReason.RECEIVERS, now_us)
        return events

    def _end(self, contract: str, why: EndReason, now_us: int) -> list[ExportEvent]:
        held = self._contracts.pop(contract, None)
        if held is None:
            return []
        export = self._exports[held.stream]
        export.contracts.discard(contract)
        self._receivers.clear()
        events: list[ExportEvent] = [ContractEnded(contract, *held.stream, tuple(sorted(held.receivers)), why)]
        if not export.contracts:
            export.retired_us = now_us
            self._hasten(now_us + self._linger_us)
            events.append(StreamEnded(*held.stream, why))
        return events

    def _end_of(self, policy: Policy) -> int | None:
        if policy.to_us is None:
            return None
        return self._wall_us(policy.to_us + (policy.max_delay_us or 0))

    def _make_room(self) -> None:
        if len(self._exports) < self._streams:
            return
        retired = [(e.retired_us, name) for name, e in self._exports.items() if e.retired_us is not None]
        if not retired:
            raise Refused(f"this platform exports {self._streams} streams already", "too-many")
        self._forget(min(retired)[1])

    def _forget(self, name: StreamName) -> None:
        """Drop the ring; the number continues from here if the stream is opened again, for receivers that remember."""
        self._tails[name] = self._exports.pop(name).stream.tail
        while len(self._tails) > 4 * self._streams:
            del self._tails[next(iter(self._tails))]
