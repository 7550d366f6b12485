"""The part of a platform that is played back: recorded samples become streams, recorded alarms are raised again.

Recorded speech acts enter its audit log, marked as recorded: subscribers get them, nothing is done on them.

Everything else, from queries to monitors of its own, is what every platform has. Times of samples and alarms are
federation time, moved by the recording's reader to when they are played.
"""

from collections.abc import Iterable
from typing import NamedTuple

from dyknow import NO_VALUE, SURE, Quality, Sample, Value
from dyknow.agents.audit_log import RECORDED, Direction
from dyknow.agents.exchange.label_agreements import LabelAgreements
from dyknow.agents.exchange.local_instance import LocalInstance
from dyknow.agents.part import Followed, Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.federation.messages.acts import Act
from dyknow.federation.messages.descriptions import LabelEntry
from dyknow.model.errors import Refused, SortError
from dyknow.model.semantic_labels import SemanticLabel
from dyknow.reasoning import AlarmEvent


class PlayedSample(NamedTuple):
    """A recorded sample, its value as the semantic label has it."""

    label: str
    valid_us: int
    value: Value
    quality: Quality = SURE


class PlayedAct(NamedTuple):
    """A speech act as it passed the recorded platform; `act` is None where the recording has no whole text of it."""

    direction: Direction
    peer: str
    outcome: str
    act: Act | None


class OffersPlayed(NamedTuple):
    """From now on the platform offers these labels, with the period of each, 0 for none."""

    at_us: int
    labels: tuple[tuple[SemanticLabel, int], ...]


class Played(NamedTuple):
    """The recorded samples, acts and alarms of one moment, in their order."""

    at_us: int
    happened: tuple[PlayedSample | PlayedAct | AlarmEvent, ...]


class RecordedPlatform(Part):
    """See the module.

    Args:
        agent: whose audit log takes recorded acts.
        local: the part whose deadline samples may move.
        on_alarm: takes the alarms, as of monitors of this platform.
        offer: tells the directory that labels have changed, at a time.
        refuse: counts samples that are of another sort than their label.
    """

    takes = {OffersPlayed: "on_offers", Played: "on_played"}  # noqa: RUF012  (a declaration)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._unit, self._network, self._clock = ports.unit, ports.network, ports.clock
        self._translation, self._agreements = ports.translation, parts[LabelAgreements]
        self._on_alarm, self._offer = ports.on_alarm, ports.offer
        self._note, self._refuse, self._audit_log = ports.note, ports.refuse, ports.agent.audit_log
        self._followed: Followed = (parts[LocalInstance],)
        self._entries: dict[str, LabelEntry] = {}

    def labels(self) -> Iterable[LabelEntry]:
        return tuple(self._entries.values())

    def on_offers(self, event: OffersPlayed, now_us: int) -> None:
        """Offer what was offered; a label that means something else here is left out, and noted. Node clock."""
        for label, period_us in event.labels:
            try:
                self._declare(label, period_us, now_us)
            except Refused as why:
                self._note(f"{label.name} is not played: {why}")
        self._offer(now_us)

    def _declare(self, label: SemanticLabel, period_us: int, now_us: int) -> None:
        ontology = self._translation.ontology
        known = ontology.get(label.name)
        if known is None:
            self._agreements.define(label, now_us)
        elif known.sort != label.sort:
            raise Refused(f"expected the sort of the label here, {known}, got {label.sort.name}", "other-sort")
        local = self._translation.local_label(label.name, self._unit)
        if not self._network.has(local):
            self._network.add_source(local, self._translation.local_sort(label.name))
        type_hash = ontology[label.name].type_hash
        self._entries[label.name] = LabelEntry(
            label=label.name, sort=label.sort.name, type_hash=type_hash, period_us=period_us
        )

    def on_played(self, event: Played, now_us: int) -> Followed:
        """Samples reach the streams, alarms and acts those that subscribed to them. Node clock."""
        is_reported = False
        for each in event.happened:
            if isinstance(each, PlayedSample):
                self._push(each, self._clock.federation_us(now_us))
            elif isinstance(each, PlayedAct):
                self._audit_log.enter(now_us, each.direction, each.peer, each.act, f"{RECORDED}: {each.outcome}")
                is_reported = True
            else:
                self._on_alarm(each)
                is_reported = True
        return None if is_reported else self._followed

    def _push(self, sample: PlayedSample, federation_us: int) -> None:
        if sample.label not in self._entries:
            self._refuse("recorded label")
            return
        translation = self._translation
        try:
            if sample.value is not NO_VALUE:
                translation.ontology[sample.label].sort.check(sample.value)
        except SortError:
            self._refuse("recorded value")
            return
        played = Sample(federation_us, sample.valid_us, sample.value, sample.quality)
        local = translation.local_label(sample.label, self._unit)
        self._network.push(local, translation.to_local(sample.label).sample(played))
