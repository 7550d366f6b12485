"""Intents out and in: that of the own vehicle as the stream `intent`, those of others while a task keeps vehicles apart.

The own one is put out twice a second, on the grid. Intents of others are imported from all platforms that offer them; a
platform that offers none is represented by its position. A vehicle that is silent in the air is an alarm. Times are the
node clock.
"""

from collections.abc import Iterable
from typing import Final

from dyknow import NO_VALUE, Sample
from dyknow.agents.capabilities.flight.options import AvoidanceOptions
from dyknow.agents.capabilities.flight.peer_fixes import fix_of
from dyknow.agents.capabilities.flight.pilot import Pilot
from dyknow.agents.capabilities.separation.neighbours import Neighbour, Neighbours
from dyknow.agents.capabilities.separation.own.conformance import Conformance
from dyknow.agents.capabilities.separation.own.own_intent import OwnIntent
from dyknow.agents.capabilities.separation.records import INTENT, intent_of, intent_value
from dyknow.agents.capabilities.traffic.traffic import Traffic
from dyknow.agents.exchange.gateway import Gateway
from dyknow.agents.exchange.label_agreements import LabelAgreements
from dyknow.agents.exchange.local_instance import LocalInstance
from dyknow.agents.exchange.partners import Partners
from dyknow.agents.exchange.subscription_keeper import SubscriptionKeeper
from dyknow.agents.monitoring.coordination import Coordination
from dyknow.agents.part import Followed, Part, PeerChange
from dyknow.agents.places import Fix
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.federation.members.liveness import Departure, PlatformGone
from dyknow.federation.messages.descriptions import ConditionEntry, LabelEntry
from dyknow.navigation.intents.intent import IntendedPlace, Intent, RightOfWay
from dyknow.reasoning import SILENT_IN_THE_AIR, AlarmEvent

PERIOD_US: Final = 500_000
LOOK_US: Final = 500_000
TELLS_US: Final = 3_000_000
"""Age of the last intent after which a vehicle in the air is reported as silent."""
LEFT_US: Final = 60_000_000
"""How long one stays traffic whose platform has left in flight."""
_OWN_US: Final = 2_000_000
MOST_NOTED: Final = 256
SAME_HEIGHT_M: Final = 3.0
"""How many notes about intents that are left out there are, at most."""
AIRCRAFT_M, AIRCRAFT_UP_M, UNKNOWN_HEIGHT_M = 15.0, 10.0, 20.0
"""Margins for an aircraft that is no member, in addition to the uncertainty of its place and height."""


class Neighbourhood(Part):
    """See the module.

    Attributes:
        others: all other vehicles.
        manoeuvre: the places that the vehicle flies to keep apart; None: it flies its own way.
        manoeuvre_m_s: how fast it flies that; None: as by itself.
        cannot: whether its manoeuvres are not flown at the moment.
    """

    vital = True

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._unit, self._network, self._clock = ports.unit, ports.network, ports.clock
        self._translation = ports.translation
        self._directory, self._agreements, self._gateway = ports.directory, parts[LabelAgreements], parts[Gateway.of]
        self._coordination, self._pilot, self._raise = parts[Coordination], parts[Pilot.of], ports.on_alarm
        self._note = ports.note
        self._traffic, self._aircraft = parts[Traffic], set[str]()
        self._noted = set[tuple[str, str]]()
        self._has_vehicle = ports.config.vehicle
        self.others = Neighbours()
        self.own = OwnIntent(parts[Pilot.of], may_avoid=ports.config.options[AvoidanceOptions].avoidance)
        self.manoeuvre: tuple[IntendedPlace, ...] | None = None
        self.manoeuvre_m_s: float | None = None
        self.cannot = False
        self._conformance = Conformance(ports.unit, ports.on_alarm, ports.note)
        self._partners = Partners(ports.network, parts[LocalInstance], parts[SubscriptionKeeper], self._on_import)
        self._label = ports.translation.local_label(INTENT, ports.unit)
        self._to_local = ports.translation.to_local(INTENT)
        if self._has_vehicle:
            ports.network.add_source(self._label, ports.translation.local_sort(INTENT))
        self._sent_us = 0
        self._silent: dict[str, AlarmEvent] = {}
        self._left_us: dict[str, int] = {}
        self._offered_us: dict[str, int] = {}
        self._due_us: int | None = 0

    # -- the own intent ----------------------------------------------------------------------------------------

    def labels(self) -> Iterable[LabelEntry]:
        if self._has_vehicle:
            entry = self._translation.ontology[INTENT]
            yield LabelEntry(label=INTENT, sort=entry.sort.name, type_hash=entry.type_hash, period_us=PERIOD_US)

    def intent(self) -> Intent | None:
        """The intent of the own vehicle; None: its position is unknown."""
        intent = self.own.now(self.manoeuvre, self.manoeuvre_m_s)
        return intent._replace(rank=RightOfWay.CANNOT) if intent is not None and self.cannot else intent

    def publish(self, now_us: int) -> None:
        """Put the own intent out, twice a second, on the grid."""
        if self._due_us is None and self.is_watched:
            self._due_us = now_us
        fix = self._pilot.fix
        if fix is None or fix.valid_us % PERIOD_US or fix.valid_us <= self._sent_us:
            return
        intent = self.intent()
        if intent is not None:
            intent = self._conformance.shown(intent)
            self._sent_us = fix.valid_us
            sample = Sample(self._clock.federation_us(now_us), fix.valid_us, intent_value(intent))
            self._network.push(self._label, self._to_local.sample(sample))

    # -- others' -----------------------------------------------------------------------------------------------

    @property
    def is_watched(self) -> bool:
        """Whether a task wants vehicles to keep apart."""
        return self._coordination.keeps_apart()

    def _on_import(self, unit: str, label: str, sample: Sample) -> None:
        if label == INTENT and sample.value is not NO_VALUE:
            found = intent_of(sample)
            at_us = max(self._network.now_us, sample.available_us)
            if found is not None:
                self.take(unit, found, at_us)
            else:
                self._leave_out(unit, "intent", "it is no intent")

    def _leave_out(self, unit: str, kind: str, why: str) -> None:
        """Count what is not believed, and note it once a member."""
        self.others.left_out[kind] = self.others.left_out.get(kind, 0) + 1
        if (unit, kind) not in self._noted and len(self._noted) < MOST_NOTED:
            self._noted.add((unit, kind))
            self._note(f"an intent of {unit} is left out: {why}")

    def take(self, unit: str, intent: Intent, at_us: int) -> None:
        """Take the intent of a member, at a federation time."""
        if intent.at_us > at_us + _OWN_US:
            self._leave_out(unit, "ahead of time", "it is ahead of time")
            return
        problem = self.others.take(unit, intent, at_us)
        if problem is not None:
            self._note(problem)

    def on_peer(self, change: PeerChange, now_us: int) -> None:
        if isinstance(change, PlatformGone) and change.why is Departure.LEFT:
            self._left_us[change.unit] = now_us + LEFT_US
        self._due_us = now_us if self._due_us is None else min(self._due_us, now_us)

    @property
    def deadline_us(self) -> int | None:
        return self._due_us

    def on_time(self, now_us: int) -> Followed:
        """Request the intents that are needed, and report silent vehicles."""
        if self._due_us is not None and now_us >= self._due_us:
            self._look(now_us)
        return ()

    def _look(self, now_us: int) -> None:
        watched = self.is_watched
        self._due_us = now_us + LOOK_US if watched or self._partners.units or self._silent else None
        present = {entry.unit for entry in self._directory.entries() if entry.kind == "uav"} - {self._unit}
        offering = {unit for unit in present if watched and self._offers(unit)}
        for unit in {*offering, *self._partners.units}:
            self._partners.want(
                unit, {INTENT: PERIOD_US} if unit in offering or (unit not in present and watched) else {}, now_us
            )
        federation_us = self._clock.federation_us(now_us)
        if watched:
            self._see(present, offering, federation_us)
            self._see_aircraft(federation_us)
        for unit, until_us in list(self._left_us.items()):
            known = self.others.by_unit.get(unit)
            if known is None or not known.is_silent(federation_us):
                if unit in present:
                    del self._left_us[unit]
            elif now_us >= until_us:
                del self._left_us[unit]
                self.others.forget(unit)
        self.others.expire(federation_us)
        self._tell_silent(federation_us)

    def _see_aircraft(self, federation_us: int) -> None:
        """Aircraft that are no members, as the platform has them: none of them yields. One of unknown height is at ours."""
        own = self._pilot.fix
        seen = set[str]()
        for one in self._traffic.aircraft(federation_us) if own is not None else ():
            known = one.altitude_m is not None
            altitude_m = one.altitude_m if one.altitude_m is not None else own.altitude_m if own is not None else 0.0
            velocity = (one.north_m_s or 0.0, one.east_m_s or 0.0, one.down_m_s or 0.0)
            fix = Fix(one.valid_us, one.latitude_deg, one.longitude_deg, altitude_m, *velocity)
            half_m = one.altitude_error_m if known else UNKNOWN_HEIGHT_M
            seen.add(one.identity)
            self.others.see(one.identity, fix, federation_us, AIRCRAFT_M + one.radius_m, AIRCRAFT_UP_M + half_m)
        for identity in self._aircraft - seen:
            self.others.forget(identity)
        self._aircraft = seen

    def _see(self, present: set[str], offering: set[str], federation_us: int) -> None:
        """Compare positions with intents; they alone count of one that publishes no intent, soon after it has offered it."""
        self._offered_us = {unit: self._offered_us.get(unit, federation_us) for unit in offering}
        for unit in present:
            is_due = federation_us - self._offered_us.get(unit, 0) > TELLS_US or unit in self.others.by_unit
            fix = fix_of(self._gateway, unit) if is_due else None
            problem = None if fix is None else self.others.see(unit, fix, federation_us)
            if problem is not None:
                self._note(problem)

    def _offers(self, unit: str) -> bool:
        entry = self._directory.entry(unit)
        has = entry is not None and any(each.label == INTENT for each in entry.labels)
        return has and not self._agreements.disagreement(unit, INTENT)

    # -- silence -----------------------------------------------------------------------------------------------

    def _tell_silent(self, federation_us: int) -> None:
        silent = {}
        if self.is_watched:
            for each in self.others.airborne():
                if each.unit not in self._aircraft and federation_us - each.heard_us > TELLS_US:
                    silent[each.unit] = each
        for unit in [unit for unit in self._silent if unit not in silent]:
            event = self._silent.pop(unit)
            self._raise(event._replace(event="closed", detected_us=federation_us))
        for unit, each in silent.items():
            if unit not in self._silent:
                self._silent[unit] = self._opened(each, federation_us)
                self._note(_silent_words(unit, self._silent[unit]))
                self._raise(self._silent[unit])

    def _opened(self, each: Neighbour, federation_us: int) -> AlarmEvent:
        intent = each.intent
        towards_m = intent.legs[-1].altitude_m if intent.legs else intent.altitude_m
        values = {
            "altitude_m": intent.altitude_m, "towards_m": towards_m, "latitude_deg": intent.latitude_deg, "longitude_deg": intent.longitude_deg,
            "source": intent.source.value,
        }  # fmt: skip
        return AlarmEvent(
            f"{SILENT_IN_THE_AIR} {self._unit} {each.unit} {each.heard_us}", "opened", SILENT_IN_THE_AIR,
            (self._unit, each.unit), each.heard_us, federation_us, values,
        )  # fmt: skip

    def conditions(self) -> Iterable[ConditionEntry]:
        """The vehicles that are silent in the air."""
        for unit, event in list(self._silent.items())[:4]:
            yield ConditionEntry(
                text=_silent_words(unit, event), since_us=max(0, self._clock.wall_us(event.detected_us))
            )


def _silent_words(unit: str, event: AlarmEvent) -> str:
    """How high it was, and to which height it was to fly, if that is another one."""
    altitude_m, towards_m = float(event.values["altitude_m"]), float(event.values["towards_m"])
    flies = f", and flies to {towards_m:.0f} m" if abs(towards_m - altitude_m) > SAME_HEIGHT_M else ""
    return f"{unit} is silent, in the air, at about {altitude_m:.0f} m{flies}"
