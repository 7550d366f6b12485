"""The Directory Facilitator, without a server: every platform holds a replica (thesis 9.3.2).

Registering is declaring tokens, crashing is deregistering, searching is a local look-up. Tokens and heartbeats say which
platforms there are and the version of their descriptions; a description is requested from its platform until it comes.
Private services leave their platform neither as tokens nor in the description.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import count
from typing import Literal, NamedTuple, TypeAlias

from dyknow.federation import keys, transport
from dyknow.federation.members.clock import FederationClock
from dyknow.federation.members.deafness import Contradicted, DeafnessWatchdog
from dyknow.federation.members.liveness import Liveness, LivenessEvent, Peer, PeerState, PlatformAppeared, PlatformGone
from dyknow.federation.members.offers import NO_OFFERS, OfferEvent, Offers, Service, changes
from dyknow.federation.members.replicas import PlatformRefused, Replica, Replicas
from dyknow.federation.messages.codec import Heartbeat, encode_description, encode_heartbeat
from dyknow.federation.messages.descriptions import (
    ConditionEntry,
    DefinitionEntry,
    Description,
    LabelEntry,
    ServiceEntry,
)
from dyknow.model.semantic_labels import SemanticLabel

HEARTBEAT_US, SLOWEST_BEAT_US = 200_000, 500_000
PER_MEMBER_US = 25_000
"""Heartbeats come at 5 Hz among up to eight members, among more at 40 a second to hear in all, though not below 2 Hz:
a member that hears a hundred others five times a second has no time for anything else."""
GREETING_US = 20_000
BETWEEN_GREETINGS_US = 50_000
LEAVING = 0
"""The description version that a heartbeat carries as good-bye."""

Kind: TypeAlias = Literal["uav", "command-centre"]
DirectoryEvent: TypeAlias = LivenessEvent | OfferEvent | PlatformRefused
Outcome: TypeAlias = transport.WireEffect | DirectoryEvent
"""The result of a step: effects for the wire and events for the agents, in order."""

Tails: TypeAlias = Sequence[tuple[str, str, int]]


class DirectoryEntry(NamedTuple):
    """One platform as this one knows it. Times are the node clock; `version` is 0 before it was described.

    Attributes:
        hears: the units that hear its heartbeat say that they are heard.
        refusal: why this platform cannot federate with it, or None.
        conditions: its own conditions.
        left: it said good-bye.
        definitions: the meanings of its own semantic labels, by name.
    """

    unit: str
    boot: int
    kind: str
    state: PeerState
    services: tuple[Service, ...]
    labels: tuple[LabelEntry, ...]
    version: int
    heard_us: int
    since_us: int
    hears: tuple[str, ...]
    refusal: str | None = None
    conditions: tuple[ConditionEntry, ...] = ()
    left: bool = False
    definitions: Mapping[str, SemanticLabel] = NO_OFFERS.definitions


class DirectoryFacilitator:
    """Own entry, replicas of the others, liveness, heartbeat and deafness watchdog of one platform.

    Every step returns effects and events. `tails` are those of the platform's exports, for the heartbeat. `goes_on` is
    `on_heartbeat` for those that tell nothing new, nearly all: whether this is one. `member_of` is that of `Liveness`.

    Attributes:
        is_busy: this machine has too much to do; losses may only be delays, and no session is opened again.
    """

    def __init__(
        self,
        unit: str,
        boot: int,
        kind: Kind,
        now_us: int,
        *,
        zid: str = "",
        questions: Iterator[int] | None = None,
        clock: FederationClock | None = None,
        roster: str | None = None,
        member_of: Callable[[str], str | None] = str,
    ) -> None:
        self.unit, self.boot, self.kind, self.zid = keys.unit(unit), boot, kind, zid or f"{boot:x}"
        self.version = 1
        self._clock, self._roster = clock or FederationClock(), roster
        self._liveness = Liveness(unit, boot, member_of)
        self._peers = self._liveness.peers
        self.goes_on = self._liveness.goes_on
        self._replicas = Replicas(self._peers, questions or count(1), self._clock, roster)
        self._watchdog = DeafnessWatchdog(unit, now_us)
        self.is_busy = False
        self._offers = NO_OFFERS
        self._conditions: tuple[ConditionEntry, ...] = ()
        self._described: bytes | None = None
        self._superseded: list[str] = []
        self._started = self._is_greeting = False
        self._beat_us = self._since_us = self._greeted_us = now_us
        self._period_us = HEARTBEAT_US
        self._beats = 0

    @property
    def refused(self) -> Counter[str]:
        """Descriptions that were not taken over, by reason."""
        return self._replicas.refused

    @property
    def contradicted(self) -> tuple[Contradicted, ...]:
        """Statements of single platforms about hearing, against the others."""
        return self._watchdog.contradicted

    # Own entry

    def start(self, now_us: int, tails: Tails = ()) -> list[Outcome]:
        """Come into the federation: listen, be askable, then declare what is offered, the platform itself last."""
        self._started = self._is_greeting = True
        self._beat_us = now_us
        return [
            transport.Subscribe(keys.HEARTBEATS),
            transport.DeclareQueryable(keys.describe(self.unit)),
            transport.WatchTokens(keys.PLATFORM_TOKENS),
            *map(transport.DeclareToken, self._tokens()),
            *self._beat(now_us, tails),
        ]

    def declare(
        self,
        services: Iterable[Service],
        labels: Iterable[LabelEntry],
        now_us: int,
        tails: Tails = (),
        conditions: Iterable[ConditionEntry] = (),
        definitions: Iterable[SemanticLabel] = (),
    ) -> list[Outcome]:
        """Offer exactly these services and labels under these conditions from now on; changes are announced at once."""
        before, known, conditions = self._offers, self._tokens(), tuple(conditions)
        after = Offers(
            {offer.service: offer for offer in services},
            {offer.label: offer for offer in labels},
            {label.name: label for label in definitions},
        )
        outcome: list[Outcome] = [*changes(self.unit, before, after)]
        is_same = not outcome and conditions == self._conditions
        self._offers, self._conditions, self._described = after, conditions, None
        if is_same or not self._started:
            return outcome
        self.version += 1
        tokens = self._tokens()
        outcome += [transport.DeclareToken(token) for token in tokens if token not in known]
        self._superseded.append(known.pop())
        outcome += [transport.UndeclareToken(token) for token in known if token not in tokens]
        self._beat_us = now_us + self._period_us
        return [*outcome, self._heartbeat(now_us, self.version, tails), self._announcement()]

    def leave(self, now_us: int) -> list[Outcome]:
        """Go out of the federation: the platform's token first, and a last heartbeat as good-bye."""
        if not self._started:
            return []
        self._started = False
        tokens = [*self._tokens(), *self._superseded]
        self._superseded.clear()
        return [*map(transport.UndeclareToken, reversed(tokens)), self._heartbeat(now_us, LEAVING, ())]

    def description(self) -> Description:
        """This platform's description for others."""
        return Description(
            unit=self.unit,
            boot=self.boot,
            version=self.version,
            kind=self.kind,
            clock_epoch_us=self._clock.epoch_us,
            clock_speed=self._clock.speed,
            roster=self._roster,
            services=tuple(
                ServiceEntry(
                    agent=each.agent, service=each.service, visibility=each.visibility.value, version=each.version
                )
                for each in self._offers.services.values()
            ),
            labels=tuple(self._offers.labels.values()),
            conditions=self._conditions,
            definitions=tuple(map(DefinitionEntry.of, self._offers.definitions.values())),
        )

    def on_asked(self, asked: transport.Asked) -> list[Outcome]:
        """Answer a request for our description."""
        return [transport.Answer(asked.ask, asked.key, self._encoded()), transport.AnswerEnd(asked.ask)]

    def _announcement(self) -> transport.Put:
        return transport.Put(keys.announcement(self.unit), self._encoded(), transport.Urgency.CONTROL)

    def _encoded(self) -> bytes:
        if self._described is None:
            self._described = encode_description(self.description())
        return self._described

    def _tokens(self) -> list[str]:
        zid, unit = self.zid, self.unit
        return [
            *(keys.token_service(zid, unit, each.service, each.version) for each in self._offers.services.values()),
            *(keys.token_label(zid, unit, o.label, o.type_hash, o.period_us) for o in self._offers.labels.values()),
            keys.token_platform(zid, unit, self.kind, self.version),
        ]

    def _beat(self, now_us: int, tails: Tails) -> list[Outcome]:
        """A heartbeat, for newcomers with our description; and the end of the platform token of an earlier version."""
        self._beat_us = max(self._beat_us + self._period_us, now_us + self._period_us // 2)
        superseded = [transport.UndeclareToken(token) for token in self._superseded]
        self._superseded.clear()
        greeting: list[Outcome] = []
        if self._is_greeting:
            greeting, self._is_greeting, self._greeted_us = [self._announcement()], False, now_us
        return [self._heartbeat(now_us, self.version, tails), *greeting, *superseded]

    def _heartbeat(self, now_us: int, version: int, tails: Tails) -> transport.Put:
        self._beats += 1
        hears = self._liveness.heard(now_us)
        self._period_us = min(max(HEARTBEAT_US, PER_MEMBER_US * (1 + len(hears))), SLOWEST_BEAT_US)
        said = Heartbeat(self.unit, self.boot, self._beats, now_us, version, hears, tails)
        return transport.Put(keys.heartbeat(self.unit), encode_heartbeat(said), transport.Urgency.CONTROL)

    # Others

    def on_heartbeat(self, beat: Heartbeat, at_us: int) -> Sequence[Outcome]:
        """A heartbeat arrived. The caller has compared its unit with the key."""
        if self._liveness.goes_on(beat, at_us):
            return ()
        unit = beat.unit
        if beat.description == LEAVING:
            return self._told(self._liveness.on_leaving(unit, beat.boot, beat.seq, at_us))
        events = self._liveness.on_heartbeat(unit, beat.boot, beat.seq, beat.description, beat.hears, at_us)
        replica = self._replicas.of(unit)
        if not events and replica is not None and replica.version == beat.description:
            return ()
        outcome = self._told(events)
        self._replicas.want(unit, at_us)
        return outcome

    def on_token(self, token: keys.Key, alive: bool, at_us: int) -> Sequence[Outcome]:
        """A token of a platform came or went, as `keys.parse_key` reads it.

        Those of services and labels are for observers from outside; a platform's version tells that they changed.
        """
        if not isinstance(token, keys.PlatformToken):
            return ()
        session = f"{token.zid}/{token.version}"
        if alive:
            self._greet(token.unit, at_us)
        outcome = self._told(self._liveness.on_token(token.unit, session, token.kind, alive, at_us))
        if alive:
            self._replicas.want(token.unit, at_us)
        return outcome

    def _greet(self, unit: str, at_us: int) -> None:
        """A newcomer lacks our heartbeats and our description: send both soon, once for all that come together."""
        peer = self._peers.get(unit)
        if unit != self.unit and (peer is None or not peer.tokens):
            self._is_greeting = True
            self._beat_us = min(self._beat_us, max(at_us + GREETING_US, self._greeted_us + BETWEEN_GREETINGS_US))

    def on_answered(self, answered: transport.Answered) -> Sequence[Outcome]:
        """A description arrived; answers to questions of others are ignored."""
        return self._learnt(self._replicas.on_answered(answered), answered.at_us)

    def on_announced(self, unit: str, payload: bytes, at_us: int) -> Sequence[Outcome]:
        """Take an unrequested description. A platform without a heartbeat yet will be sent a request."""
        return self._learnt(self._replicas.on_announced(unit, payload, at_us), at_us)

    def _learnt(self, found: tuple[Replica, Description] | None, at_us: int) -> Sequence[Outcome]:
        if found is None:
            return ()
        replica, description = found
        unit = replica.unit
        outcome = self._told(self._liveness.on_kind(unit, description.kind, at_us))
        before, is_news = replica.offers, description.version != replica.version
        self._replicas.learn(replica, description, at_us)
        if self._peers[unit].present:
            outcome += changes(unit, before, replica.offers)
            if replica.refusal is not None and is_news:
                outcome.append(PlatformRefused(unit, replica.boot, *replica.refusal))
        return outcome

    def on_revoked(self, is_revoked: Callable[[str], bool], at_us: int) -> list[Outcome]:
        """Those platforms are members no more."""
        units = [unit for unit in self._peers if unit != self.unit and is_revoked(unit)]
        return [each for unit in units for each in self._told(self._liveness.on_revoked(unit, at_us))]

    def on_ask_ended(self, ended: transport.AskEnded) -> None:
        """The question is over; missing descriptions are requested again."""
        self._replicas.on_ask_ended(ended)

    def on_reopened(self) -> None:
        """The session is a new one: all tokens will be announced again."""
        self._liveness.on_reopened()

    @property
    def deadline_us(self) -> int:
        due_us = self._watchdog.deadline_us
        beat_us = self._beat_us if self._started else None
        for at_us in (beat_us, self._liveness.deadline_us, self._replicas.deadline_us):
            if at_us is not None and at_us < due_us:
                due_us = at_us
        return due_us

    def beats_at(self, now_us: int) -> bool:
        """Whether a heartbeat is due."""
        return self._started and now_us >= self._beat_us

    def on_time(self, now_us: int, tails: Tails = ()) -> list[Outcome]:
        """Judge silent peers, request what is not known, beat."""
        outcome = self._told(self._liveness.on_time(now_us))
        outcome += self._replicas.on_time(now_us)
        if self.beats_at(now_us):
            outcome += self._beat(now_us, tails)
        if self.is_busy:
            self._watchdog.excuse(now_us)
        why = self._watchdog.on_time(self._peers, now_us)
        if why is not None and self._started:
            self.on_reopened()
            outcome.append(transport.Reopen(why))
        return outcome

    def _told(self, events: Iterable[LivenessEvent]) -> list[Outcome]:
        """The events of liveness, with their consequences for services and labels: those go before their platform."""
        outcome: list[Outcome] = []
        for event in events:
            if isinstance(event, PlatformGone):
                outcome += changes(event.unit, self._replicas.drop(event.unit), NO_OFFERS)
            outcome.append(event)
            if isinstance(event, PlatformAppeared):
                replica = self._replicas.of(event.unit)
                if replica is not None and replica.boot == event.boot:
                    outcome += changes(event.unit, NO_OFFERS, replica.offers)
        return outcome

    # Look-ups

    def entries(self, *, gone: bool = False) -> list[DirectoryEntry]:
        """All platforms that are there, this one included, by unit."""
        own = DirectoryEntry(
            self.unit,
            self.boot,
            self.kind,
            PeerState.ALIVE,
            tuple(self._offers.services.values()),
            tuple(self._offers.labels.values()),
            self.version,
            self._beat_us,
            self._since_us,
            tuple(self._liveness.heard(self._beat_us)),
            conditions=self._conditions,
            definitions=self._offers.definitions,
        )
        peers = (peer for peer in self._peers.values() if peer.present or (gone and peer.state is PeerState.GONE))
        return sorted([own, *map(self._entry, peers)], key=lambda entry: unit_order(entry.unit))

    def entry(self, unit: str) -> DirectoryEntry | None:
        """The entry of another platform, gone or not; None if it never appeared."""
        peer = self._peers.get(unit)
        return None if peer is None or peer.state is PeerState.ANNOUNCED else self._entry(peer)

    def search(
        self, *, service: str | None = None, label: str | None = None, kind: str | None = None
    ) -> list[DirectoryEntry]:
        """The platforms that are there and offer the service, the label, or both."""
        return [
            entry
            for entry in self.entries()
            if (service is None or any(offer.service == service for offer in entry.services))
            and (label is None or any(offer.label == label for offer in entry.labels))
            and (kind is None or entry.kind == kind)
        ]

    def is_present(self, unit: str) -> bool:
        peer = self._peers.get(unit)
        return unit == self.unit or (peer is not None and peer.present)

    def _entry(self, peer: Peer) -> DirectoryEntry:
        replica = self._replicas.of(peer.unit)
        offers = replica.offers if replica else NO_OFFERS
        return DirectoryEntry(
            peer.unit,
            peer.boot,
            peer.kind,
            peer.state,
            tuple(offers.services.values()),
            tuple(offers.labels.values()),
            replica.version if replica else 0,
            peer.heard_us,
            peer.since_us,
            tuple(peer.hears),
            replica.refusal[1] if replica and replica.refusal else None,
            replica.found.conditions if replica and replica.found and replica.refusal is None else (),
            peer.left,
            offers.definitions,
        )


def unit_order(unit: str) -> tuple[int, int, str]:
    """Numbers by value, then names."""
    return (0, int(unit), "") if unit.isdigit() else (1, 0, unit)
