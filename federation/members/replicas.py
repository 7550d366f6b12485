"""Copies of other platforms' descriptions, and the questions that bring them."""

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from dyknow.federation import keys
from dyknow.federation.members.clock import FederationClock
from dyknow.federation.members.deadlines import Deadlines
from dyknow.federation.members.liveness import Peer, PeerState
from dyknow.federation.members.offers import NO_OFFERS, Offers, Service, Visibility
from dyknow.federation.messages.codec import decode_description
from dyknow.federation.messages.descriptions import Description
from dyknow.federation.messages.newest import Newest
from dyknow.federation.transport import Answered, Ask, AskEnded
from dyknow.model.errors import DecodeError

CONFIRM_US = 10_000_000
UNASKED_US = 300_000
"""The time for a platform to send its description, or a change, unasked."""
RETRY_US = 50_000
RETRY_MOST_US = 2_000_000
ASK_TIMEOUT_US = 1_000_000
NEW_PER_S, NEW_BURST = 4.0, 16.0
"""New descriptions of one platform that are read; faster ones are asked for later."""
MOST_BYTES = 4 << 20
"""Of all descriptions that one directory holds, as they are sent: a hundred platforms have a quarter of it."""


class PlatformRefused(NamedTuple):
    """A platform is there with which this one cannot federate; its services and labels are not listed.

    `code` is `clock` or `roster`, `why` the same as a phrase.
    """

    unit: str
    boot: int
    code: str
    why: str


class Replica:
    """The description of one incarnation of a platform; version 0 before the first answer."""

    __slots__ = (
        "asked",
        "backoff_us",
        "boot",
        "due_us",
        "found",
        "offers",
        "read_us",
        "refusal",
        "size",
        "tokens",
        "unit",
        "version",
    )

    def __init__(self, unit: str, boot: int, now_us: int) -> None:
        self.unit, self.boot = unit, boot
        self.version = self.size = 0
        self.found: Description | None = None
        self.offers = NO_OFFERS
        self.refusal: tuple[str, str] | None = None
        self.asked: int | None = None
        self.due_us = now_us
        self.backoff_us = RETRY_US
        self.tokens, self.read_us = NEW_BURST, now_us

    def may_be_read(self, at_us: int) -> bool:
        """Whether one more description of it is read now."""
        gained = max(0, at_us - self.read_us) * NEW_PER_S / 1e6
        self.tokens, self.read_us = min(NEW_BURST, self.tokens + gained), at_us
        if self.tokens < 1.0:
            return False
        self.tokens -= 1.0
        return True


class Replicas:
    """A replica of each platform that is heard, kept at the version that its heartbeats announce.

    A platform says what it is when others come and when that changes. A missing description is asked for until it is
    had, and confirmed once in 10 s in any case. `peers` is the view of `Liveness`, `questions` numbers the questions of
    the whole node.
    """

    def __init__(
        self, peers: Mapping[str, Peer], questions: Iterator[int], clock: FederationClock, roster: str | None
    ) -> None:
        self.refused: Counter[str] = Counter()
        self._peers, self._questions, self._clock, self._roster = peers, questions, clock, roster
        self._replicas: dict[str, Replica] = {}
        self._asking: dict[int, str] = {}
        self._due: Deadlines[str] = Deadlines()
        self.bytes = 0

    @property
    def deadline_us(self) -> int | None:
        return self._due.next_us

    def of(self, unit: str) -> Replica | None:
        return self._replicas.get(unit)

    def drop(self, unit: str) -> Offers:
        """The platform is gone; returns what it offered."""
        replica = self._replicas.pop(unit, None)
        if replica is None:
            return NO_OFFERS
        self._due.set(unit, None)
        self._describe(unit, 0)
        self.bytes -= replica.size
        if replica.asked is not None:
            self._asking.pop(replica.asked, None)
        return replica.offers

    def want(self, unit: str, now_us: int) -> None:
        """See to it that the announced version of a platform that is heard is had."""
        peer = self._peers.get(unit)
        if peer is None or peer.seq < 0 or peer.state is PeerState.GONE:
            return
        replica = self._replicas.get(unit)
        if replica is None or replica.boot != peer.boot:
            self.drop(unit)
            self._replicas[unit] = Replica(unit, peer.boot, now_us + UNASKED_US)
            self._due.set(unit, now_us + UNASKED_US)
        elif not self._is_current(replica) and replica.backoff_us == RETRY_US and replica.asked is None:
            replica.due_us = min(replica.due_us, now_us + UNASKED_US)
            self._due.set(unit, replica.due_us)

    def on_announced(self, unit: str, payload: bytes, at_us: int) -> tuple[Replica, Description] | None:
        """A platform says unasked what it is; the description if it fits and says something new, for `learn`."""
        replica = self._replicas.get(unit)
        return None if replica is None else self._read(replica, payload, at_us)

    def on_answered(self, answered: Answered) -> tuple[Replica, Description] | None:
        """The same in answer to one of our questions."""
        unit = self._asking.get(answered.question)
        replica = self._replicas.get(unit) if unit is not None else None
        return None if replica is None else self._read(replica, answered.payload, answered.at_us)

    def _read(self, replica: Replica, payload: bytes, at_us: int) -> tuple[Replica, Description] | None:
        if not _described.has(replica.unit, payload) and not replica.may_be_read(at_us):
            self.refused["descriptions too often"] += 1
            return None
        try:
            found = _described(replica.unit, payload)
        except DecodeError as error:
            self.refused[error.reason] += 1
            return None
        if found.unit != replica.unit or found.boot != replica.boot or found.version < replica.version:
            self.refused["description of another"] += 1
            return None
        if found is replica.found:
            self._confirmed(replica, at_us)
            return None
        if self.bytes - replica.size + len(payload) > MOST_BYTES:
            self.refused["too much is described"] += 1
            return None
        self.bytes += len(payload) - replica.size
        replica.size = len(payload)
        return replica, found

    def learn(self, replica: Replica, found: Description, at_us: int) -> None:
        """Take a description over. Offers of a platform with which we cannot federate are not listed."""
        replica.found, replica.version, replica.refusal = found, found.version, self._refusal(found)
        replica.offers = NO_OFFERS if replica.refusal is not None else _offered(replica.unit, found)
        self._describe(replica.unit, replica.version)
        self._confirmed(replica, at_us)

    def _describe(self, unit: str, version: int) -> None:
        """Note the version at its heartbeats: one that announces this version needs no look here."""
        peer = self._peers.get(unit)
        if peer is not None:
            peer.described = version

    def _confirmed(self, replica: Replica, at_us: int) -> None:
        """The replica was compared with its platform: if it is current there is nothing to ask for a while."""
        if replica.asked is None and self._is_current(replica):
            replica.due_us, replica.backoff_us = at_us + CONFIRM_US, RETRY_US
            self._due.set(replica.unit, replica.due_us)

    def on_ask_ended(self, ended: AskEnded) -> None:
        """A question is over; missing descriptions are requested again, ever later."""
        unit = self._asking.pop(ended.question, None)
        replica = self._replicas.get(unit) if unit is not None else None
        if replica is None or replica.asked != ended.question:
            return
        replica.asked = None
        replica.due_us = ended.at_us + replica.backoff_us
        replica.backoff_us = min(2 * replica.backoff_us, RETRY_MOST_US)
        self._due.set(replica.unit, replica.due_us)
        self._confirmed(replica, ended.at_us)

    def on_time(self, now_us: int) -> list[Ask]:
        """Ask what is due."""
        asks = []
        for unit in self._due.pop_due(now_us):
            replica = self._replicas[unit]
            if unit not in self._peers:  # its name has given way to others
                self.drop(unit)
                continue
            if replica.asked is not None:
                del self._asking[replica.asked]
            asks.append(self._ask(replica, now_us))
        return asks

    def _is_current(self, replica: Replica) -> bool:
        peer = self._peers.get(replica.unit)
        return peer is not None and peer.boot == replica.boot and replica.version >= max(1, peer.version)

    def _ask(self, replica: Replica, now_us: int) -> Ask:
        replica.asked = next(self._questions)
        replica.due_us = now_us + 2 * ASK_TIMEOUT_US
        self._asking[replica.asked] = replica.unit
        self._due.set(replica.unit, replica.due_us)
        return Ask(replica.asked, keys.describe(replica.unit), b"", ASK_TIMEOUT_US)

    def _refusal(self, found: Description) -> tuple[str, str] | None:
        if not self._clock.agrees(found.clock_epoch_us, found.clock_speed):
            return "clock", f"its federation clock runs at speed {found.clock_speed} from {found.clock_epoch_us}"
        if found.roster != self._roster:
            if self._roster is None:
                return "roster", "its federation has a roster: give it with --roster"
            return (
                "roster",
                f"it goes by {'another' if found.roster else 'no'} roster: start all with the same --roster",
            )
        return None


def _offers_of(found: Description) -> Offers:
    return Offers(
        {s.service: Service(s.service, s.agent, Visibility(s.visibility), s.version) for s in found.services},
        {entry.label: entry for entry in found.labels},
        {entry.label: entry.definition for entry in found.definitions},
    )


_described = Newest(decode_description, len)
_offered = Newest(_offers_of, lambda found: 64 * (1 + len(found.services) + len(found.labels) + len(found.definitions)))
