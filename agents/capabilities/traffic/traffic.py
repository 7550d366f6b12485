"""Traffic that is no member, as a part: one picture from the vehicle's receivers, streams of hosts and other platforms.

Own hearing is the stream `traffic` of the platform, on a grid; a local stream with the feature `traffic` and another object, as
`traffic[radar]`, feeds it. Other platforms' streams of that label are imported: an aircraft is warned of where it is not heard. An alarm
of the profile `traffic-well-clear` needs no task. Floods are counted and shown.
"""

from collections import Counter
from collections.abc import Callable, Iterable
from typing import Final

from dyknow import NO_VALUE, Label, Policy, Quality, Sample
from dyknow.agents.capabilities.flight.pilot import Pilot
from dyknow.agents.capabilities.traffic.echoes import MemberEchoes, MemberState
from dyknow.agents.capabilities.traffic.records import TRAFFIC, ended_value, heard_of, traffic_value
from dyknow.agents.capabilities.traffic.watch import PROFILE, AircraftWatch
from dyknow.agents.effects import Reported
from dyknow.agents.exchange.label_agreements import LabelAgreements
from dyknow.agents.exchange.local_instance import LocalInstance
from dyknow.agents.exchange.partners import Partners
from dyknow.agents.exchange.subscription_keeper import SubscriptionKeeper
from dyknow.agents.part import NOT_MINE, Followed, Part, PeerChange
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.federation.members.offers import LabelAppeared, LabelGone
from dyknow.federation.messages.descriptions import ConditionEntry, LabelEntry
from dyknow.model.sample import Predicted
from dyknow.navigation.geodesy import metres_per_degree
from dyknow.navigation.traffic import TrafficPicture, TrafficState
from dyknow.navigation.vehicle import TrafficReport
from dyknow.network.stream_proxy import StreamProxy
from dyknow.reasoning import builtin_profiles

PERIOD_US: Final = 500_000
IMPORTED_US: Final = 1_000_000
OWN_AGE_US, MEMBER_AGE_US = 2_000_000, 5_000_000
SHOWN_US: Final = 10_000_000
MOST_STREAMS: Final = 16
MOTION: Final = ("heli-position", "heli-altitude", "heli-velocity")


class Traffic(Part):
    """See the module. Times are federation time, but for `now_us` of the node.

    Attributes:
        picture: all aircraft that are heard, echoes of members among them.
        echoes: the member whose vehicle an aircraft is, by identity.
    """

    vital = heeds_samples = True
    takes = {Reported: "on_reported"}  # noqa: RUF012  (a declaration)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._unit, self._network, self._clock = ports.unit, ports.network, ports.clock
        self._translation = ports.translation
        self._directory, self._agreements, self._local = ports.directory, parts[LabelAgreements], parts[LocalInstance]
        self._pilot = parts[Pilot.of]
        self._note, self._offer = ports.note, ports.offer
        self.picture, self.echoes = TrafficPicture(ports.unit), dict[str, str]()
        self._members = MemberEchoes()
        self._watch = AircraftWatch(
            ports.unit, ports.config.profiles.get(PROFILE, builtin_profiles()[PROFILE]), ports.on_alarm
        )
        self._partners = Partners(ports.network, parts[LocalInstance], parts[SubscriptionKeeper], self._on_import)
        self._label = ports.translation.local_label(TRAFFIC, ports.unit)
        self._fed: dict[Label, StreamProxy] = {}
        self._met: dict[Label, None] = {}
        self._offering = set[str]()
        self._sent = set[str]()
        self._left_out, self._shown = Counter[str](), ""
        self._shown_us, self._blind_us = 0, 0
        self._due_us: int | None = None
        ports.network.meet(self._on_label)

    # -- what others of this platform ask ----------------------------------------------------------------------

    def aircraft(self, at_us: int) -> tuple[TrafficState, ...]:
        """The traffic at a time, flown on straight, the nearest first; members' own vehicles are none."""
        return tuple(one for one in self.picture.at(at_us) if one.identity not in self.echoes)

    def labels(self) -> Iterable[LabelEntry]:
        """The label of this platform's own hearing, from the first aircraft on."""
        if self._network.has(self._label):
            yield self._translation.ontology.entry(TRAFFIC, PERIOD_US)

    def conditions(self) -> Iterable[ConditionEntry]:
        """Reports that were dropped in the last seconds; that no own position is known."""
        if self._shown:
            yield ConditionEntry(text=self._shown[:200], since_us=self._shown_us)
        if self._blind_us:
            yield ConditionEntry(text="traffic: no own position, no warnings", since_us=self._blind_us)

    # -- what is heard -----------------------------------------------------------------------------------------

    def on_reported(self, event: Reported, now_us: int) -> Followed:
        """The vehicle's receivers have heard aircraft."""
        report = event.report
        if not isinstance(report, TrafficReport):
            return NOT_MINE
        at_us = self._clock.federation_us(now_us)
        for heard in report.aircraft:
            self.picture.take(heard, self._unit, at_us)
        for reason, times in report.left_out:
            self.picture.counts[reason] += times
        self._wake(now_us)
        return (self,)

    def _on_label(self, label: Label) -> None:
        """A stream of another source is there."""
        named = label.objects[0] if label.objects else ""
        if label.feature == TRAFFIC and label != self._label and self._directory.entry(named) is None:
            self._met[label] = None
            self._due_us = 0

    def _feed(self) -> None:
        """Subscribe to streams that were met."""
        for label in tuple(self._met):
            del self._met[label]
            is_another = label not in self._fed and label.objects[:1] not in {(unit,) for unit in self._partners.units}
            if is_another and self._network.has(label) and len(self._fed) < MOST_STREAMS:
                take = self._translation.to_semantic(TRAFFIC).into(self._taker(label))
                self._fed[label] = self._network.connect(label, Policy(), take, self._ender(label))

    def _taker(self, label: Label) -> Callable[[Sample], None]:
        source = "-".join(label.objects) or "host"

        def take(sample: Sample) -> None:
            self._take(sample, self._unit, source, str(label))

        return take

    def _ender(self, label: Label) -> Callable[[bool], None]:
        def on_link(linked: bool) -> None:
            if not linked and label in self._fed:
                self._fed.pop(label).cancel()

        return on_link

    def _on_import(self, unit: str, label: str, sample: Sample) -> None:
        if label == TRAFFIC:
            self._take(sample, unit, "", "")

    def _take(self, sample: Sample, by: str, source: str, channel: str) -> None:
        heard = heard_of(sample, source)
        if heard is not None:
            self.picture.take(heard, by, max(self._network.now_us, sample.available_us), channel)
            if self._due_us is None:
                self._due_us = 0

    def on_peer(self, change: PeerChange, now_us: int) -> None:
        """A platform begins to hear aircraft, or ends."""
        match change:
            case LabelAppeared(unit, label) if label.label == TRAFFIC and unit != self._unit:
                if not self._agreements.disagreement(unit, TRAFFIC):
                    self._offering.add(unit)
                    self._want(unit, now_us)
            case LabelGone(unit, label) if label.label == TRAFFIC:
                self._offering.discard(unit)
                self._want(unit, now_us)

    def _want(self, unit: str, now_us: int) -> None:
        """Import a platform's traffic while it offers it, and its motion while there is traffic."""
        names = [TRAFFIC] if unit in self._offering else []
        names += [name for name in MOTION if len(self.picture) and self._offers(unit, name)]
        self._partners.want(unit, dict.fromkeys(names, IMPORTED_US), now_us)

    def _offers(self, unit: str, name: str) -> bool:
        entry = self._directory.entry(unit)
        return entry is not None and any(each.label == name for each in entry.labels)

    # -- time --------------------------------------------------------------------------------------------------

    def _wake(self, now_us: int) -> None:
        if self._due_us is None:
            self._due_us = now_us

    @property
    def deadline_us(self) -> int | None:
        return self._due_us

    def on_time(self, now_us: int) -> None:
        """On the grid: publish the aircraft that are heard, and step their monitors; without aircraft it does nothing."""
        if self._due_us is None or now_us < self._due_us:
            return
        self._feed()
        federation_us = self._clock.federation_us(now_us)
        valid_us = federation_us // PERIOD_US * PERIOD_US
        own = self._own(valid_us)
        if own is not None:
            self.picture.move(own.latitude_deg, own.longitude_deg)
        for gone in self.picture.forget(federation_us):
            if self.echoes.pop(gone, None) is None:
                self._note(f"traffic: {gone} is no longer heard: where it is is unknown")
        is_empty = not len(self.picture) and not self._sent and not self._shown
        self._due_us = None if is_empty else self._clock.wall_us(valid_us + PERIOD_US)
        self._follow_members(now_us)
        self._tell_apart(own, valid_us)
        with self._network.instant.whole():
            self._push(valid_us, federation_us, now_us)
        self._look(own, valid_us, federation_us, now_us)
        self._show(now_us)

    def _follow_members(self, now_us: int) -> None:
        """Where the others are, while there is traffic that may be theirs."""
        wanted = {entry.unit for entry in self._directory.entries() if len(self.picture)} - {self._unit}
        for unit in {*wanted, *self._partners.units}:
            self._want(unit, now_us)

    def _tell_apart(self, own: MemberState | None, valid_us: int) -> None:
        members = [each for each in map(self._member(valid_us), self._partners.units) if each is not None]
        found = self._members.look(self.picture.at(valid_us), [*([own] if own else ()), *members])
        for identity, unit in found.items():
            if identity not in self.echoes:
                self._note(f"traffic: {identity} is the vehicle of platform {unit}, which flies so")
        self.echoes = found

    def _push(self, valid_us: int, federation_us: int, now_us: int) -> None:
        """Put out this platform's own hearing, as a stream, from the first aircraft on."""
        own = {one.identity: one for one in self.aircraft(valid_us) if self._unit in one.by}
        if own and not self._network.has(self._label):
            self._network.add_source(self._label, self._translation.local_sort(TRAFFIC))
            self._offer(now_us)
        to_local = self._translation.to_local(TRAFFIC)
        for one in own.values():
            quality = Quality(prediction=Predicted(min(one.heard_us, valid_us)))
            sample = Sample(federation_us, valid_us, traffic_value(one), quality)
            self._network.push(self._label, to_local.sample(sample))
        for identity in self._sent - own.keys():
            self._network.push(self._label, to_local.sample(Sample(federation_us, valid_us, ended_value(identity))))
        self._sent = set(own)

    def _look(self, own: MemberState | None, valid_us: int, federation_us: int, now_us: int) -> None:
        """Have the monitors take the states of this instant; a vehicle on the ground is not watched."""
        aircraft = self.aircraft(valid_us)
        is_blind = bool(aircraft) and own is None and self._pilot.status is not None
        if is_blind != bool(self._blind_us):
            self._blind_us = now_us if is_blind else 0
            self._offer(now_us)
        status = self._pilot.status
        if status is not None and not (status.armed and status.airborne is not False):
            self._watch.end_all(federation_us)
        elif own is not None:
            self._watch.step(own, aircraft, valid_us, federation_us)
        else:
            for name in {*self._watch.open} - {one.identity for one in aircraft}:
                self._watch.end(name, federation_us)

    def _show(self, now_us: int) -> None:
        """The reports that were dropped, at most every ten seconds."""
        if now_us < self._shown_us + SHOWN_US:
            return
        new = self.picture.counts - self._left_out
        self._left_out = Counter(self.picture.counts)
        counts = ", ".join(f"{times} {reason}" for reason, times in sorted(new.items()))
        text = f"traffic: left out: {counts}" if counts else ""
        if text or self._shown:
            if text and not self._shown:
                self._note(text)
            self._shown, self._shown_us = text, now_us
            self._offer(now_us)

    # -- where members are -------------------------------------------------------------------------------------

    def _own(self, at_us: int) -> MemberState | None:
        generator = self._network.find(Label.parse(f"estimate[{self._unit}]"))
        if generator is None or not generator.history.get_size():
            return None
        sample = generator.history.get_latest()
        if sample.value is NO_VALUE or abs(at_us - sample.valid_us) > OWN_AGE_US:
            return None
        latitude_deg, longitude_deg, altitude_m, *velocity = sample.value[:6]
        return _flown_on(self._unit, latitude_deg, longitude_deg, altitude_m, velocity, (at_us - sample.valid_us) / 1e6)

    def _member(self, at_us: int) -> Callable[[str], MemberState | None]:
        def found(unit: str) -> MemberState | None:
            values = [self._newest(unit, name, at_us) for name in MOTION]
            place, altitude, velocity = values
            if place is None:
                return None
            age_s = (at_us - place.valid_us) / 1e6
            flown = velocity.value if velocity is not None else None
            altitude_m = None if altitude is None else altitude.value[0]
            latitude_deg, longitude_deg = place.value
            return _flown_on(unit, latitude_deg, longitude_deg, altitude_m, flown, age_s)

        return found

    def _newest(self, unit: str, name: str, at_us: int) -> Sample | None:
        generator = self._network.find(self._translation.local_label(name, unit))
        if generator is None or not generator.history.get_size():
            return None
        sample = self._translation.to_semantic(name).sample(generator.history.get_latest())
        fresh = abs(at_us - sample.valid_us) <= MEMBER_AGE_US
        return sample if fresh and sample.value is not NO_VALUE and NO_VALUE not in sample.value else None


def _flown_on(
    unit: str,
    latitude_deg: float,
    longitude_deg: float,
    altitude_m: float | None,
    velocity: Iterable[float] | None,
    age_s: float,
) -> MemberState:
    if velocity is None:
        return MemberState(unit, latitude_deg, longitude_deg, altitude_m)
    north_m_s, east_m_s, down_m_s = velocity
    m_lat, m_lon = metres_per_degree(latitude_deg)
    return MemberState(
        unit,
        latitude_deg + north_m_s * age_s / m_lat,
        longitude_deg + east_m_s * age_s / m_lon,
        None if altitude_m is None else altitude_m - down_m_s * age_s,
        north_m_s,
        east_m_s,
        down_m_s,
    )
