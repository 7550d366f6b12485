"""One platform of a federation as a value: events in, effects out (thesis, figure 9.2 and 9.3).

Nothing here reads a clock or a socket: `on_event` and `on_time` are given the node clock and return what is to be done.
Federation time, which streams and monitors live in, follows from the node clock by the federation's clock.
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import count

from agents.account import Account
from agents.alarm_book import AlarmBook
from agents.bulletin import Bulletin
from agents.checks import Checks
from agents.context import Context
from agents.coordination import Coordination
from agents.effects import Effect, Event, Halt, Leave, Note, Reported
from agents.export_proxy import ExportProxy
from agents.federation_agent import FederationAgent
from agents.fixes import fix_of
from agents.gateway import Gateway
from agents.giving_way import GivingWay
from agents.handlers import handlers_of, offers_of
from agents.import_proxy import ImportProxy
from agents.interface import InterfaceAgent, Trust
from agents.limits import ACTS_BURST, ACTS_PER_S, Limits
from agents.membership import Membership
from agents.monitoring import Monitors
from agents.own_streams import OwnStreams
from agents.pilot import Fix, FlightLimits, FlightPlan, Pilot
from agents.plans import PlanBook
from agents.services import ServiceTable
from agents.supply import Supply
from agents.tasks import TaskBook
from dyknow import Label, Network, Sample
from dyknow.errors import DecodeError
from federation import keys
from federation.clock import FederationClock
from federation.codec import decode_heartbeat
from federation.directory import Directory, Kind, Outcome
from federation.exports import Exports
from federation.offsets import ClockOffsets
from federation.ontology import Convert, Ontology, Translation, default_ontology
from federation.transport import (
    Answered,
    Arrived,
    Asked,
    AskEnded,
    Conflated,
    DeclareQueryable,
    HandlerFailed,
    Subscribe,
    TokenChanged,
)
from navigation.vehicle import Command
from reasoning import AlarmEvent, Profile, builtin_profiles

IMPORTED_HISTORY = 1200


@dataclass(frozen=True, slots=True)
class PlatformConfig:
    """What makes one platform different from another.

    Attributes:
        unit: its name in the federation.
        boot: which life of it this is; greater in each later one.
        zid: identity of its session, for tokens.
        vehicle: whether it has one, and so labels to offer.
        simulated: whether faults can be injected.
        control: whether it may command its vehicle.
        period_us: the grid of its estimates.
    """

    unit: str
    boot: int
    zid: str = ""
    kind: Kind = "uav"
    clock: FederationClock = field(default_factory=FederationClock)
    vehicle: bool = True
    simulated: bool = False
    control: bool = False
    avoidance: bool = True
    period_us: int = 100_000
    plan: FlightPlan | None = None
    limits: FlightLimits = field(default_factory=FlightLimits)
    ontology: Ontology = field(default_factory=default_ontology)
    translation: Translation | None = None
    profiles: Mapping[str, Profile] = field(default_factory=builtin_profiles)
    trust: Trust | None = None
    acts_per_s: float = ACTS_PER_S
    acts_burst: float = ACTS_BURST


class Platform:
    """The agents, the proxies and the local instance of one platform."""

    def __init__(self, config: PlatformConfig, now_us: int) -> None:
        self.config, self.unit, self.clock = config, config.unit, config.clock
        self.refused: Counter[str] = Counter()
        self._out: list[Effect] = []
        self._now_us = now_us
        self._due_us: int | None = None
        self._questions = count(1)
        emit = self._out.append
        self.network = Network()
        translation = config.translation or Translation(config.ontology)
        self._translation = translation
        self.own = (
            OwnStreams(config.unit, self.network, translation, config.period_us, self._on_estimate, self.note)
            if config.vehicle
            else None
        )
        roster = None if config.trust is None else config.trust.roster.fingerprint
        self.directory = Directory(
            config.unit,
            config.boot,
            config.kind,
            now_us,
            zid=config.zid,
            questions=self._questions,
            clock=config.clock,
            roster=roster,
        )
        self.clocks = ClockOffsets(config.boot, self._questions)
        self.exports = Exports(config.unit, config.boot, config.clock)
        self.account, self.tasks, self.alarms = Account(), TaskBook(), AlarmBook()
        self.monitors = Monitors(config.unit, self.network, self._source, self._on_alarm)
        self.importer = ImportProxy(
            self.network,
            config.ontology,
            translation,
            config.clock,
            self.clocks.last,
            self._questions,
            emit,
            self._source,
        )
        self.gateway = Gateway(
            config.unit,
            self.network,
            config.ontology,
            translation,
            ExportProxy(self.exports, self.network, translation, emit),
            self.importer,
            self.monitors,
            self._variance_of,
        )
        self.services = ServiceTable(offers_of(config))
        self.interface = InterfaceAgent(
            config.unit,
            config.boot,
            self.services,
            emit,
            account=self.account,
            limits=Limits(rate_per_s=config.acts_per_s, burst=config.acts_burst),
            trust=config.trust,
            offset_us_of=self._offset_us_of,
        )
        self.pilot = Pilot(config.control, config.plan, config.limits)
        self.context = Context(
            config.unit,
            config.boot,
            config.clock,
            self.directory,
            self.gateway,
            self.interface,
            self.tasks,
            self.alarms,
            self.pilot,
            self._fix_of,
            self.fly,
            config.avoidance,
        )
        self.federation = FederationAgent(self.context)
        plans = PlanBook(config.unit, config.profiles, config.period_us)
        self.coordination = Coordination(self.context, plans, self.federation)
        self.giving_way = GivingWay(self.context)
        self.supply = Supply(self.context)
        self.bulletin = Bulletin(self.context, self.account)
        self.checks = Checks(self.context)
        self.membership = Membership(self)
        self.interface.handlers.update(handlers_of(self))
        self.interface.on_cancel = self.membership.on_cancel
        self.interface.on_lost = self.membership.on_lost

    # -- steps -------------------------------------------------------------------------------------------------

    def start(self, now_us: int) -> list[Effect]:
        """Come into the federation."""
        self._now_us = now_us
        unit = self.unit
        self._out += [
            Subscribe(keys.inbox(unit)),
            Subscribe(keys.BROADCAST),
            DeclareQueryable(keys.clock(unit)),
            DeclareQueryable(keys.history_expr(unit)),
        ]
        labels = () if self.own is None else self.own.entries()
        services = [offer.service for offer in self.services.offers]
        self._take(self.directory.declare(services, labels, now_us))
        self._take(self.directory.start(now_us))
        return self._done()

    def on_event(self, event: Event, now_us: int) -> list[Effect]:
        """Take one event; `now_us` is the node clock."""
        self._now_us = now_us
        try:
            if type(event) is Arrived and self._is_quiet(event):
                return []
            self._on_event(event)
        except DecodeError as wrong:
            self.refused[wrong.reason] += 1
        return self._done()

    def _is_quiet(self, event: Arrived) -> bool:
        """Take a heartbeat or samples; whether it was that, and nothing follows from it. Most events are so.

        Quiet ones change few deadlines, and every step pays for finding the earliest.
        """
        key = keys.parse_key(event.key)
        if type(key) is keys.HeartbeatKey:
            return self._is_quiet_beat(event, key)
        if type(key) is not keys.StreamKey:
            return False
        self.importer.on_arrived(event, key)
        if self._out or self.gateway.exporter.pending:
            return False
        self._hasten(self.importer.deadline_us)
        for federation_us in (self.monitors.deadline_us, self.network.deadline_us):
            self._hasten(None if federation_us is None else self.clock.wall_us(federation_us))
        return True

    def _is_quiet_beat(self, event: Arrived, key: keys.HeartbeatKey) -> bool:
        beat = decode_heartbeat(event.payload)
        if beat.unit != key.unit:
            raise DecodeError("key")
        if key.unit == self.unit and not self.membership.is_twin(beat.boot, event.at_us):
            return True
        outcome = self.directory.on_heartbeat(beat, event.at_us)
        if self.importer.on_tails(beat.unit, beat.boot, beat.tails, event.at_us):
            self._hasten(self.importer.deadline_us)
        self._take(outcome)
        return not outcome

    def _hasten(self, at_us: int | None) -> None:
        if at_us is not None and self._due_us is not None and at_us < self._due_us:
            self._due_us = at_us

    def on_time(self, now_us: int) -> list[Effect]:
        """Let time pass. Call at `deadline_us`; more often is harmless."""
        self._now_us = now_us
        federation_us = self.clock.federation_us(now_us)
        if self.own is not None:
            self.own.on_time(federation_us)
        self.network.on_time(federation_us)
        self.monitors.on_time(federation_us)
        self._take(self.directory.on_time(now_us, self.exports.tails()))
        self._out += self.clocks.on_time(now_us)
        self.interface.on_time(now_us)
        self.importer.on_time(now_us)
        self.federation.on_contracts_ended(self.gateway.exporter.on_events(self.exports.on_time(now_us)), now_us)
        self.coordination.on_time(now_us)
        self.membership.on_time(now_us)
        self.supply.on_time(now_us)
        self.checks.on_time(now_us)
        self.gateway.exporter.flush()
        return self._done()

    @property
    def deadline_us(self) -> int:
        """When `on_time` has work next (node clock). Worked out once per step: the loop asks before and after it waits."""
        if self._due_us is None:
            self._due_us = self._earliest_us()
        return self._due_us

    def _earliest_us(self) -> int:
        if self.gateway.exporter.pending:
            return self._now_us
        due = self.directory.deadline_us
        for part in (
            self.clocks.deadline_us,
            self.interface.deadline_us,
            self.importer.deadline_us,
            self.exports.deadline_us,
            self.coordination.deadline_us,
            self.membership.deadline_us,
            self.supply.deadline_us,
            self.checks.deadline_us,
        ):
            if part is not None and part < due:
                due = part
        own = None if self.own is None else self.own.deadline_us
        for part in (self.monitors.deadline_us, self.network.deadline_us, own):
            if part is not None:
                due = min(due, self.clock.wall_us(part))
        return due

    def _done(self) -> list[Effect]:
        self._due_us = None
        self.interface.flush()
        effects = self._out[:]
        self._out.clear()
        return effects

    # -- events ------------------------------------------------------------------------------------------------

    def _on_event(self, event: Event) -> None:
        match event:
            case Arrived():
                self._on_arrived(event)
            case Reported():
                self._on_reported(event)
            case TokenChanged():
                key = keys.parse_key(event.key)
                if key is not None:
                    self._take(self.directory.on_token(key, event.alive, event.at_us))
            case Asked():
                self._on_asked(event)
            case Answered():
                unit = self.clocks.on_answered(event)
                if unit is not None:
                    self.membership.on_clock(unit, self._now_us)
                elif not self.importer.on_answered(event):
                    self._take(self.directory.on_answered(event))
            case AskEnded():
                if not (self.clocks.on_ask_ended(event) or self.importer.on_ask_ended(event)):
                    self.directory.on_ask_ended(event)
            case Conflated():
                self.refused["conflated"] += event.lost
            case HandlerFailed():
                self._out.append(Note(event.at_us, f"{event.where}: {event.error}"))
            case Leave():
                self.leave(event.at_us)

    def _on_arrived(self, event: Arrived) -> None:
        key = keys.parse_key(event.key)
        match key:
            case keys.StreamKey() | keys.HeartbeatKey():
                pass  # it was taken already
            case keys.ActKey():
                if key.sender == self.unit:
                    self.refused["our own name"] += 1
                else:
                    self.interface.on_arrived(event, key)
            case _:
                raise DecodeError("key")

    def _on_asked(self, event: Asked) -> None:
        key = keys.parse_key(event.key)
        match key:
            case keys.ClockKey(unit) if unit == self.unit:
                self._out += self.clocks.on_asked(event, self._now_us)
            case keys.DescribeKey(unit) if unit == self.unit:
                self._take(self.directory.on_asked(event))
            case keys.HistoryKey(owner, label) if owner == self.unit:
                self._out += self.exports.on_asked(event, label)
            case _:
                self.refused["key"] += 1

    def _on_reported(self, event: Reported) -> None:
        federation_us = self.clock.federation_us(self._now_us)  # not when it was posted: timers may have gone since
        self.fly(self.pilot.on_report(event.report, federation_us))
        if self.own is not None:
            self.own.on_report(event.report, federation_us)

    def _take(self, outcomes: Iterable[Outcome]) -> None:
        """Effects of the directory go out, its events go to the agents."""
        for outcome in outcomes:
            if not self.membership.on_directory(outcome, self._now_us):
                self._out.append(outcome)  # type: ignore[arg-type]  # what is no event of the directory is an effect

    def _on_estimate(self, sample: Sample) -> None:
        self.fly(self.pilot.on_estimate(sample))
        if self.giving_way.encounters:
            self.giving_way.on_moved(self._now_us)

    def _on_alarm(self, event: AlarmEvent) -> None:
        self.membership.on_alarm(event, self._now_us)

    def _offset_us_of(self, unit: str) -> int:
        """A peer's node clock minus ours; 0 while it is not known."""
        offset = self.clocks.of(unit)
        return 0 if offset is None else offset.offset_us

    def fly(self, commands: Iterable[Command]) -> None:
        self._out += commands

    def _source(self, semantic_label: str, unit: str) -> tuple[Label, Convert]:
        """The local label of a unit's stream, its source declared if it comes from elsewhere and is not there yet."""
        local = self._translation.local_label(semantic_label, unit)
        if unit != self.unit and not self.network.has(local):
            self.network.add_source(local, self._translation.local_sort(semantic_label), IMPORTED_HISTORY)
        return local, self._translation.to_semantic(semantic_label)

    def _variance_of(self, semantic_label: str, valid_us: int) -> tuple[float, ...] | None:
        return None if self.own is None else self.own.variance_of(semantic_label, valid_us)

    def _fix_of(self, unit: str) -> Fix | None:
        """Where a unit is, as far as this platform's streams know."""
        return self.pilot.fix if unit == self.unit else fix_of(self.gateway, unit)

    def leave(self, now_us: int) -> None:
        """Unregister: streams that are set up go on while the process lives (thesis 9.3.4)."""
        self._take(self.directory.leave(now_us))

    def rejoin(self, now_us: int) -> None:
        self._take(self.directory.start(now_us, self.exports.tails()))

    def emit(self, effects: Iterable[Effect]) -> None:
        self._out += effects

    def halt(self, reason: str) -> None:
        self._out.append(Halt(reason))

    def note(self, text: str) -> None:
        self._out.append(Note(self._now_us, text))
