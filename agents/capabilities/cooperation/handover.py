"""Handover as a part: manoeuvres over several platforms' areas, and the streams shared for that by pairs (thesis 9.2).

A platform recognises overtakes of all cars of its picture, and the chronicles of attributes that its specification declares. For cars
outside its own area it gets data of the platform into whose area they drive: percepts, states, relations or events
(`anchoring/cooperation/sharing.py`). The level is chosen once a second for
each platform, within what `(share kbit_s: 50)` declares for all, those first into whose area cars drive; `(share level: events)` fixes it.
"""

from collections import deque
from collections.abc import Iterable, Mapping
from importlib.resources import files
from math import tan
from typing import Final

from dyknow import NO_VALUE, US_PER_MS, US_PER_S, Label, Sample
from dyknow.agents.actions import FEDERATION, Offer
from dyknow.agents.capabilities.cooperation.cooperation import Cooperation
from dyknow.agents.capabilities.cooperation.remote_percepts import RemotePercepts
from dyknow.agents.capabilities.cooperation.requests import SHARE
from dyknow.agents.capabilities.cooperation.track_records import (
    ATTRIBUTES,
    EVENTS,
    IDENTITIES,
    RELATIONS,
    TRACKS,
    attribute_value,
    event_value,
    object_attribute,
    pair_event,
    pair_relation,
    relation_value,
)
from dyknow.agents.exchange.export_proxy import ExportProxy
from dyknow.agents.part import Part, PeerChange
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.specification.object_queries import LONGEST_REASON, ObjectQueries
from dyknow.anchoring.cooperation.attributes import AttributeChanges, ObjectAttribute
from dyknow.anchoring.cooperation.manoeuvres import (
    PairEvents,
    PairRelation,
    PairRelations,
    SpanningManoeuvres,
    as_relation,
    handed_over,
)
from dyknow.anchoring.cooperation.picture import HOLD_US, PERIOD_US
from dyknow.anchoring.cooperation.rows import PictureEvent, PictureRow
from dyknow.anchoring.cooperation.sharing import TRACKS_US, Partner, SharingLevel, chosen_level, kbit_s, wanted_of
from dyknow.federation.members.directory import DirectoryEntry
from dyknow.federation.members.offers import LabelAppeared, LabelGone
from dyknow.federation.messages.acts import Act
from dyknow.federation.messages.contents import ObjectEvent, Share
from dyknow.federation.messages.descriptions import LabelEntry
from dyknow.kpl import parse_chronicles
from dyknow.model.errors import Refused
from dyknow.reasoning.chronicles import ChronicleFile, ChronicleInstance

PERCEPTS: Final = "vision-percepts"
CAMERA: Final = "camera-state"
CAMERA_US: Final = 1_000_000
PERCEPTS_US: Final = 100_000
DECIDES_US: Final = US_PER_S
HALF_VIEW_RAD: Final = 0.73
"""Half the assumed angle of view of a camera that looks down."""
BUSY: Final = "too busy"
"""How the condition of a platform begins that has too much to do."""
SETTLES_US: Final = 10 * US_PER_S
"""A platform that has been there for so long and offers no tracks links nothing."""
MOST_RECOGNISED: Final = 200
MOST_OBJECTS: Final = 2
"""Of an attribute that is shared."""
_LABELS: Final[Mapping[str, SharingLevel]] = {
    PERCEPTS: "percepts", TRACKS: "states", RELATIONS: "relations", EVENTS: "events"
}  # fmt: skip
_STREAM: Final[Mapping[SharingLevel, Mapping[str, int]]] = {
    "events": {EVENTS: PERIOD_US, ATTRIBUTES: 0}, "relations": {RELATIONS: PERIOD_US, ATTRIBUTES: 0},
    "states": {ATTRIBUTES: 0}, "percepts": {PERCEPTS: PERCEPTS_US}
}  # fmt: skip


class Handover(Part):
    """Recognises what spans areas. Node clock, except for federation times.

    Attributes:
        levels: the level shared with each platform now.
        recognised: the latest manoeuvres.
    """

    offers = (Offer(FEDERATION, (SHARE,)),)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._now_us = ports.now_us
        self._unit, self._agent, self._clock, self._network = ports.config.unit, ports.agent, ports.clock, ports.network
        self._translation, self._directory, self._exporter = ports.translation, ports.directory, parts[ExportProxy.of]
        self._cooperation, self._note = parts[Cooperation], ports.note
        self._frame = None if ports.config.cameras is None else ports.config.cameras.frame
        self._labels = {
            name: ports.translation.local_label(name, ports.config.unit) for name in (RELATIONS, EVENTS, ATTRIBUTES)
        }
        for name in self._labels:
            ports.network.add_source(self._labels[name], ports.translation.local_sort(name))
        self.levels: dict[str, SharingLevel] = {}
        self.recognised: deque[PictureEvent] = deque(maxlen=MOST_RECOGNISED)
        self._fixed: dict[str | None, SharingLevel] = {}
        self._kbit_s: float | None = None
        self._views: dict[str, tuple[float, float, float]] = {}
        self._linked: dict[str, RemotePercepts] = {}
        self._relations, self._events = PairRelations(), PairEvents()
        text = files("dyknow.agents.capabilities.cooperation").joinpath("spanning.chr").read_text(encoding="utf-8")
        self._overtakes = parse_chronicles(text)
        self._instance = ports.instance()
        parts[ObjectQueries].histories.append(self._history)
        self._spans: dict[ChronicleFile, SpanningManoeuvres] = {}
        self._changes: dict[ChronicleFile, AttributeChanges] = {}
        self._due_us = self._decide_us = 0
        self._lost, self._lost_due = 0, 1
        parts[Cooperation].takers |= {
            RELATIONS: self._on_relation, EVENTS: self._on_event, ATTRIBUTES: self._on_attribute, CAMERA: self._on_camera, PERCEPTS: self._on_percept
        }  # fmt: skip

    def labels(self) -> Iterable[LabelEntry]:
        if self._cooperation.picture is None:
            return ()
        ontology = self._translation.ontology
        return [ontology.entry(name) for name in self._labels]

    def on_peer(self, change: PeerChange, now_us: int) -> None:  # noqa: ARG002  (as every part)
        """Platforms and their labels come and go: decide soon."""
        if isinstance(change, LabelAppeared | LabelGone):
            self._due_us = self._decide_us = 0

    def events(self, symbol: str | None = None) -> list[PictureEvent]:
        """The manoeuvres that were recognised, of one object or of all."""
        return [each for each in self.recognised if symbol is None or symbol in subjects_of(each)]

    def _history(self, symbol: str | None) -> list[tuple[Label, ObjectEvent]]:
        """The events of the picture, and the manoeuvres, for whom may see the tracks of this platform."""
        picture = self._cooperation.picture
        found = () if picture is None else (*picture.events(symbol), *self.events(symbol))
        return [
            (
                self._cooperation.tracks,
                ObjectEvent(
                    at_us=each.valid_us, event=each.kind, target=each.name, because=each.because[:LONGEST_REASON]
                ),
            )
            for each in found
        ]

    # -- what is shared ----------------------------------------------------------------------------------------

    def on_share(self, act: Act, content: Share, now_us: int) -> None:
        """`(share level: events unit: 1)`, `(share level: auto)`, `(share kbit_s: 50)`.

        Raises:
            Refused: there is no picture here, no such platform takes part, or it does not offer that.
        """
        if self._cooperation.picture is None:
            raise Refused("this platform has no picture: its specification does not export object-tracks", "no-picture")
        unit, level = content.unit, content.level
        if unit is not None and unit not in self._partners():
            partners = ", ".join(self._partners()) or "none"
            raise Refused(f"platform {unit} shares nothing; platforms that do: {partners}", "no-partner")
        if level == "auto":
            self._fixed = {} if unit is None else {each: one for each, one in self._fixed.items() if each != unit}
        elif level is not None:
            for each in self._partners().values():
                if each.unit == (unit or each.unit) and level not in {*each.levels, "none"}:
                    levels = ", ".join(sorted(each.levels))
                    raise Refused(f"platform {each.unit}: expected none or {levels}, got {level}", "not-offered")
            self._fixed = {None: level} if unit is None else {**self._fixed, unit: level}
        if content.kbit_s is not None:
            self._kbit_s = content.kbit_s or None
        self._decide(now_us)
        self._agent.done(act, now_us, "; ".join(f"{each} with {name}" for name, each in sorted(self.levels.items())))

    def _partners(self) -> dict[str, Partner]:
        """The platforms that share anything, by name."""
        found: dict[str, Partner] = {}
        for entry in self._directory.entries():
            levels = _offered(entry)
            if self._now_us() - entry.since_us < SETTLES_US:
                levels -= {"percepts"}
            if entry.unit != self._unit and levels and self._directory.is_present(entry.unit):
                is_busy = any(each.text.startswith(BUSY) for each in entry.conditions)
                x_m, y_m, reach_m = self._views.get(entry.unit, (None, None, 80.0))
                found[entry.unit] = Partner(entry.unit, levels, None, is_busy, x_m, y_m, reach_m)
        return found

    def _decide(self, now_us: int) -> None:
        """Choose the level for each platform, those first into whose area cars drive, and ask for its streams."""
        picture, partners = self._cooperation.picture, self._partners()
        if picture is None:
            return
        rows = [row for row in picture.rows(self._clock.federation_us(now_us)) if row.by]
        wanted = wanted_of({row.name: row.state for row in rows if self._unit in row.by}, partners.values())
        for unit in self._cooperation.partners.units:
            if unit not in partners and self._directory.is_present(unit):
                self._cooperation.partners.want(unit, {}, now_us)
                self.levels.pop(unit, None)
        left = self._kbit_s
        for unit in sorted(partners, key=lambda each: (-len(wanted.get(each, ())), each)):
            seen = 1 + sum(unit in row.by for row in rows)
            partner = partners[unit]._replace(kbit_s=left)
            level = self._fixed.get(unit, self._fixed.get(None))
            if level is None:
                level = chosen_level(partner, seen, is_busy=self._exporter.shed > 1)
            left = None if left is None else max(0.0, left - kbit_s(level, seen))
            self._share(partners[unit], level, now_us)

    def _share(self, partner: Partner, level: SharingLevel, now_us: int) -> None:
        if self.levels.get(partner.unit) != level:
            self._note(f"picture: shared by platform {partner.unit}: {level}")
        self.levels[partner.unit] = level
        streams = dict(_STREAM.get(level, {}))
        if level not in {"none", "percepts"}:
            streams |= {TRACKS: TRACKS_US[level], IDENTITIES: PERIOD_US}
        if level != "none" and self._frame is not None and CAMERA in _names(self._directory.entry(partner.unit)):
            streams[CAMERA] = CAMERA_US
        self._link(partner.unit, links=level == "percepts")
        self._cooperation.partners.want(partner.unit, streams, now_us)

    def _link(self, unit: str, *, links: bool) -> None:
        """Link the percepts of a platform here, or no longer."""
        picture = self._cooperation.picture
        if picture is None or links is (unit in self._linked):
            return
        if links:
            self._linked[unit] = RemotePercepts(unit, self._translation.ontology[PERCEPTS].sort)
        else:
            del self._linked[unit]
        picture.name_for(unit, names=links)

    # -- what comes --------------------------------------------------------------------------------------------

    def _on_relation(self, unit: str, sample: Sample) -> None:
        self._take(unit, pair_relation(sample))

    def _on_event(self, unit: str, sample: Sample) -> None:
        event = pair_event(sample)
        self._take(unit, None if event is None else as_relation(event))

    def _take(self, unit: str, relation: PairRelation | None) -> None:
        """Take what a platform reports of two objects of the picture."""
        picture = self._cooperation.picture
        if picture is None:
            return
        now_us = self._network.now_us
        if relation is None or not all(map(picture.has, relation.pair)):
            picture.gate.refuse(unit, "relations of unknown objects")
        elif picture.gate.is_affordable(unit, now_us):
            taken = [spans.take_from(relation, now_us) for spans in self._spans.values()]
            if not all(taken):
                picture.gate.refuse(unit, "late relations, or too many")

    def _on_attribute(self, unit: str, sample: Sample) -> None:
        """Take what a platform has of objects that it tracks."""
        picture, attribute = self._cooperation.picture, object_attribute(sample)
        now_us = self._network.now_us
        if picture is None or not picture.gate.is_affordable(unit, now_us):
            return
        wanting = [] if attribute is None else [each for each in self._spans.values() if each.wants(attribute.label)]
        if attribute is None or not all(picture.is_tracked_by(unit, each) for each in attribute.label.objects):
            picture.gate.refuse(unit, "attributes of objects that it does not track")
        elif not wanting:
            picture.gate.refuse(unit, "attributes that no chronicle has")
        else:
            taken = [each.take_attribute_from(attribute, now_us) for each in wanting]
            if not all(taken):
                picture.gate.refuse(unit, "late attributes, or too many")

    def _on_camera(self, unit: str, sample: Sample) -> None:
        if self._frame is None or sample.value is NO_VALUE:
            return
        latitude_deg, longitude_deg, altitude_m, *_ = sample.value
        north_m, east_m, down_m = self._frame.to_ned(latitude_deg, longitude_deg, altitude_m)
        self._views[unit] = east_m, north_m, max(20.0, -down_m * tan(HALF_VIEW_RAD))

    def _on_percept(self, unit: str, sample: Sample) -> None:
        picture, linked = self._cooperation.picture, self._linked.get(unit)
        if picture is not None and linked is not None and not linked.take(sample):
            picture.gate.refuse(unit, "late percepts, or too many")

    # -- time --------------------------------------------------------------------------------------------------

    @property
    def deadline_us(self) -> int | None:
        return None if self._cooperation.picture is None else self._due_us

    def on_time(self, now_us: int) -> None:
        """Relate what is seen, share what is news, recognise."""
        picture = self._cooperation.picture
        if picture is None or now_us < self._due_us:
            return
        federation_us = self._clock.federation_us(now_us)
        at_us = (federation_us - HOLD_US) // PERIOD_US * PERIOD_US
        self._due_us = self._clock.wall_us((federation_us // PERIOD_US + 1) * PERIOD_US)
        if now_us >= self._decide_us:
            self._decide_us = now_us + DECIDES_US
            self._decide(now_us)
            self._renew()
        for linked in self._linked.values():
            for report in linked.reports(federation_us):
                picture.report(report, federation_us)
        rows = [row for row in picture.rows(at_us) if self._sees(row)]
        found = self._relations.step(rows, at_us)
        own = {row.name for row in rows if self._unit in row.by}
        self._offer_news([each for each in found if own.issuperset(each.pair)], federation_us)
        every = picture.rows(at_us)
        for content, changes in self._changes.items():
            self._take_own(content, changes.news(every, self._unit, federation_us), federation_us)
            self._lost, changes.lost = self._lost + changes.lost, 0
        self._tell_lost()
        for spans in self._spans.values():
            spans.see(every, self._unit)
            spans.take(found)
            for instance in spans.on_time(federation_us):
                self._recognise(instance, spans.subjects(instance))

    def _tell_lost(self) -> None:
        """At the first, and whenever there are ten times as many as were noted."""
        if self._lost >= self._lost_due:
            self._lost_due = 10 * self._lost
            self._note(f"handover: {self._lost} values of attributes were left out until now: there are too many")

    def _take_own(self, content: ChronicleFile, news: list[ObjectAttribute], federation_us: int) -> None:
        spans = self._spans.get(content)
        for each in news:
            if spans is not None and spans.wants(each.label):
                self._lost += not spans.take_own(each)
                if each.is_shared and 1 <= len(each.label.objects) <= MOST_OBJECTS:
                    self._push(ATTRIBUTES, each.seen_us, attribute_value(each), federation_us)

    def _recognise(self, instance: ChronicleInstance, subjects: tuple[str, ...]) -> None:
        times = [at_ms for at_ms in instance.instants.values() if at_ms > 0]
        begin_ms, end_ms = (
            instance.instants.get("out", min(times, default=0)),
            instance.instants.get("past", instance.recognised_ms),
        )
        took = "behind until" if "out" in instance.instants else "begun"
        because = f"{took} {(end_ms - begin_ms) / 1000:.1f} s before; {self._sources()}"
        name = f"{instance.chronicle}[{', '.join(subjects)}]"
        self.recognised.append(PictureEvent(end_ms * US_PER_MS, "recognised", name, because))

    def _renew(self) -> None:
        """The chronicles that are recognised: the specification's, and overtakes in any case."""
        declared = {each.content: each.watch for each in self._instance.chronicles.values()}
        wanted = {each: (handed_over(each), watch.initially) for each, watch in declared.items()}
        if not any("passes" in names for names, _ in wanted.values()):
            wanted[self._overtakes] = ("passes",), False
        self._spans = {
            each: self._spans.get(each) or SpanningManoeuvres(each, *names, initially=initially)
            for each, (names, initially) in wanted.items()
            if names
        }
        for content, watch in declared.items():
            changes = self._changes.setdefault(content, AttributeChanges(watch.delay_us + US_PER_MS))
            if watch.follow(changes):
                for label, value in watch.values.items():
                    changes.on_sample(label, self._network.now_us - watch.delay_us, value)
        self._changes = {each: one for each, one in self._changes.items() if each in declared}

    def _sees(self, row: PictureRow) -> bool:
        """Whether its state is known here, and not only to platforms that share less."""
        return any(unit == self._unit or self.levels.get(unit) in {"states", "percepts"} for unit in row.by)

    def _sources(self) -> str:
        shared = [f"{level} of {unit}" for unit, level in sorted(self.levels.items()) if level != "none"]
        return f"from its own tracks, and {', '.join(shared)}" if shared else "from its own tracks"

    def _offer_news(self, relations: list[PairRelation], federation_us: int) -> None:
        for relation in self._relations.news(relations):
            self._push(RELATIONS, relation.valid_us, relation_value(relation), federation_us)
        for event in self._events.news(relations):
            self._push(EVENTS, event.valid_us, event_value(event), federation_us)

    def _push(self, name: str, valid_us: int, value: object, now_us: int) -> None:
        if self._network.generator(self._labels[name]).subscriptions:
            sample = Sample(now_us, valid_us, value)
            self._network.push(self._labels[name], self._translation.to_local(name).sample(sample))


def subjects_of(event: PictureEvent) -> list[str]:
    """The objects of a recognised manoeuvre."""
    return event.name.partition("[")[2].removesuffix("]").split(", ")


def _names(entry: DirectoryEntry | None) -> frozenset[str]:
    return frozenset(each.label for each in (entry.labels if entry else ()))


def _offered(entry: DirectoryEntry) -> frozenset[SharingLevel]:
    """The levels that a platform can share; a platform that links its percepts itself shares its tracks."""
    labels = _names(entry)
    levels = frozenset(level for label, level in _LABELS.items() if label in labels)
    return levels - {"percepts"} if TRACKS in labels else levels
