"""One platform of a federation as a value: events in, effects out (thesis, figure 9.2 and 9.3).

Nothing here reads a clock or a socket: `on_event` and `on_time` are given the node clock and return what is to be done.
Federation time, which streams and monitors live in, follows from the node clock by the federation's clock.
"""

from collections import Counter
from collections.abc import Iterable
from itertools import count
from typing import Any

from agents.account import Account
from agents.alarm_book import AlarmBook
from agents.arrivals import Arrivals
from agents.bulletin import Bulletin
from agents.config import PlatformConfig
from agents.context import Context
from agents.coordination import Coordination
from agents.declared import Declared
from agents.effects import Effect, Event, Fed, Halt, HostEvent, Leave, Note, Reported, Specify, Tell, Waited
from agents.export_proxy import ExportProxy
from agents.federation_agent import FederationAgent
from agents.fixes import fix_of
from agents.gateway import Gateway
from agents.giving_way import GivingWay
from agents.handlers import handlers_of, offers_of
from agents.import_proxy import ImportProxy
from agents.inquiries import Inquiries
from agents.interface import InterfaceAgent
from agents.limits import Limits
from agents.membership import Membership
from agents.monitoring import Monitors
from agents.own_streams import OwnStreams
from agents.pilot import Fix, Pilot
from agents.plans import PlanBook
from agents.services import ServiceTable
from agents.supply import Supply
from agents.tasks import TaskBook
from agents.timetable import Timetable
from dyknow import Label, Network, Sample
from dyknow.errors import DecodeError
from federation import keys
from federation.directory import Directory, Outcome
from federation.exports import Exports
from federation.offsets import ClockOffsets
from federation.ontology import Convert, Translation
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
from reasoning import AlarmEvent

IMPORTED_HISTORY = 1200


class Platform:
    """The agents, the proxies and the local instance of one platform."""

    def __init__(self, config: PlatformConfig, now_us: int) -> None:
        self.config, self.unit, self.clock = config, config.unit, config.clock
        self.refused: Counter[str] = Counter()
        self._out: list[Effect] = []
        self._now_us = now_us
        self._questions = count(1)
        self.account, self.tasks, self.alarms = Account(), TaskBook(), AlarmBook()
        self._hold_federation(config, now_us)
        self._hold_streams(config)
        self._hold_agents(config)
        parts = (self.clocks, self.interface, self.importer, self.exports, self.coordination, self.membership)
        own = () if self.own is None else (self.own,)
        self.timetable: Timetable = Timetable(
            config.clock,
            (*parts, self.supply, self.inquiries, self.federation.rousing, self.declared.desk),
            (self.monitors, self.network, *own),
        )
        self._arrivals = Arrivals(self)

    def _hold_federation(self, config: PlatformConfig, now_us: int) -> None:
        """What knows of the other platforms."""
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
        self.services = ServiceTable(offers_of(config))
        self.interface = InterfaceAgent(
            config.unit,
            config.boot,
            self.services,
            self._out.append,
            account=self.account,
            limits=Limits(rate_per_s=config.acts_per_s, burst=config.acts_burst),
            trust=config.trust,
            offset_us_of=self._offset_us_of,
        )

    def _hold_streams(self, config: PlatformConfig) -> None:
        """The local instance, what feeds it and what leaves it."""
        self.network = Network()
        translation = self.translation = config.translation or Translation(config.ontology)
        self.own = (
            OwnStreams(config.unit, self.network, translation, config.period_us, self._on_estimate, self.note)
            if config.vehicle
            else None
        )
        self.monitors = Monitors(config.unit, self.network, self.source, self.on_alarm)
        self.importer = ImportProxy(
            self.network,
            config.ontology,
            translation,
            config.clock,
            self.clocks.last,
            self._questions,
            self._out.append,
            self.source,
        )
        self.gateway = Gateway(
            config.unit,
            self.network,
            config.ontology,
            translation,
            ExportProxy(self.exports, self.network, translation, self._out.append),
            self.importer,
            self.monitors,
            self._variance_of,
        )

    def _hold_agents(self, config: PlatformConfig) -> None:
        """The agents; what they share is the context."""
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
        self.declared = Declared(self)
        self.bulletin = Bulletin(self.context, self.account, self.declared.instance.monitors.values)
        self.membership = Membership(self)
        self.inquiries = Inquiries(self.context, self.declared.instance)
        self.gateway.imported = lambda: self.declared.imported
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
        self.offer()
        self.take(self.directory.start(now_us))
        return self._done()

    def on_event(self, event: Event, now_us: int) -> list[Effect]:
        """Take one event; `now_us` is the node clock."""
        self._now_us = now_us
        try:
            if type(event) is Arrived and self._arrivals.take(event):
                return []
            if self._on_event(event):
                return self._done()
        except DecodeError as wrong:
            self.refused[wrong.reason] += 1
        return self._effects()

    def on_time(self, now_us: int) -> list[Effect]:
        """Let time pass. Call at `deadline_us`; more often is harmless."""
        self._now_us = now_us
        federation_us = self.clock.federation_us(now_us)
        if self.own is not None:
            self.own.on_time(federation_us)
        self.network.on_time(federation_us)
        self.monitors.on_time(federation_us)
        tails = self.exports.tails() if self.directory.beats_at(now_us) else ()
        self.take(self.directory.on_time(now_us, tails))
        self._out += self.clocks.on_time(now_us)
        self.interface.on_time(now_us)
        self.importer.on_time(now_us)
        self.federation.on_contracts_ended(self.gateway.exporter.on_events(self.exports.on_time(now_us)), now_us)
        self.coordination.on_time(now_us)
        self.membership.on_time(now_us)
        self.supply.on_time(now_us)
        self.inquiries.on_time(now_us)
        self.federation.rousing.on_time(now_us)
        self.declared.desk.on_time(now_us)
        self.gateway.exporter.flush()
        return self._done()

    @property
    def deadline_us(self) -> int:
        """When `on_time` has work next (node clock), or a little earlier."""
        due_us = self.timetable.due_us
        if due_us is None:
            exporter = self.gateway.exporter
            due_us = self._now_us if exporter.pending else self.timetable.earliest_us(self.directory.deadline_us)
            self.timetable.due_us = due_us
        return due_us

    @property
    def is_owing(self) -> bool:
        """Whether there are effects to return, or samples to put."""
        return bool(self._out) or self.gateway.exporter.pending or self.declared.desk.is_owing

    def _done(self) -> list[Effect]:
        self.timetable.forget()
        self.interface.flush()
        return self._effects()

    def _effects(self) -> list[Effect]:
        self._out += self.declared.desk.flush()
        if not self._out:
            return []
        effects = self._out[:]
        self._out.clear()
        return effects

    # -- events ------------------------------------------------------------------------------------------------

    def _on_event(self, event: Event) -> bool:
        """Whether it may have changed any deadline; those of the parts that most events are for are seen to here."""
        match event:
            case Reported():
                return self._on_reported(event)
            case TokenChanged():
                key = keys.parse_key(event.key)
                return key is not None and self._found(self.directory.on_token(key, event.alive, event.at_us))
            case Asked():
                self._on_asked(event)
                return False
            case Answered():
                return self._on_answered(event)
            case AskEnded():
                self._on_ask_ended(event)
                return False
            case Arrived():
                self._on_arrived(event)
            case Conflated():
                self.refused["conflated"] += event.lost
            case HandlerFailed():
                self._out.append(Note(event.at_us, f"{event.where}: {event.error}"))
            case Specify():
                self.declared.specify(event, self.clock.federation_us(self._now_us))
            case Fed():
                self.declared.instance.push(
                    event.source, event.valid_us, event.value, self.clock.federation_us(self._now_us)
                )
            case Waited():
                self.declared.on_waited(event.waited_us, self.clock.federation_us(self._now_us))
            case _ if isinstance(event, HostEvent):
                return self.declared.on_host(event, self._now_us)
            case Leave():
                self.leave(event.at_us)
        return True

    def _on_answered(self, event: Answered) -> bool:
        unit = self.clocks.on_answered(event)
        if unit is not None:
            self.timetable.hasten(self.clocks)
            return self.membership.on_clock(unit, self._now_us)
        return self.importer.on_answered(event) or self._found(self.directory.on_answered(event))

    def _on_ask_ended(self, event: AskEnded) -> None:
        if self.clocks.on_ask_ended(event):
            return
        if self.importer.on_ask_ended(event):
            self.timetable.hasten(self.importer)
        else:
            self.directory.on_ask_ended(event)
            self.timetable.hasten(self.directory)

    def _found(self, outcomes: Iterable[Outcome]) -> bool:
        """Whether the directory had events; its own deadlines are seen to."""
        self.timetable.hasten(self.directory)
        return self.take(outcomes)

    def _on_arrived(self, event: Arrived) -> None:
        key = keys.parse_key(event.key)
        match key:
            case keys.StreamKey() | keys.HeartbeatKey():
                pass  # it was taken already
            case keys.AnnouncementKey(unit):
                self._found(self.directory.on_announced(unit, event.payload, event.at_us))
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
                self.take(self.directory.on_asked(event))
            case keys.HistoryKey(owner, label) if owner == self.unit:
                self._out += self.exports.on_asked(event, label)
            case _:
                self.refused["key"] += 1

    def _on_reported(self, event: Reported) -> bool:
        federation_us = self.clock.federation_us(self._now_us)  # not when it was posted: timers may have gone since
        self.fly(self.pilot.on_report(event.report, federation_us))
        if self.own is not None:
            self.own.on_report(event.report, federation_us)
            self.timetable.hasten_federation(self.own)
            self.timetable.hasten_federation(self.network)
        return self.is_owing

    def take(self, outcomes: Iterable[Outcome]) -> bool:
        """Effects of the directory go out, its events go to the agents; whether there were events."""
        is_told = False
        for outcome in outcomes:
            if self.membership.on_directory(outcome, self._now_us):
                is_told = True
            else:
                self._out.append(outcome)  # type: ignore[arg-type]  # what is no event of the directory is an effect
        return is_told

    def _on_estimate(self, sample: Sample) -> None:
        self.fly(self.pilot.on_estimate(sample))
        if self.giving_way.encounters:
            self.giving_way.on_moved(self._now_us)

    def on_alarm(self, event: AlarmEvent) -> None:
        self.membership.on_alarm(event, self._now_us)
        self.declared.on_alarm(event)

    def _offset_us_of(self, unit: str) -> int:
        """A peer's node clock minus ours; 0 while it is not known."""
        offset = self.clocks.of(unit)
        return 0 if offset is None else offset.offset_us

    def fly(self, commands: Iterable[Command]) -> None:
        self._out += commands

    def source(self, semantic_label: str, unit: str) -> tuple[Label, Convert]:
        """The local label of a unit's stream, its source declared if it comes from elsewhere and is not there yet."""
        local = self.translation.local_label(semantic_label, unit)
        if unit != self.unit and not self.network.has(local):
            self.network.add_source(local, self.translation.local_sort(semantic_label), IMPORTED_HISTORY)
        return local, self.translation.to_semantic(semantic_label)

    def _variance_of(self, semantic_label: str, valid_us: int) -> tuple[float, ...] | None:
        return None if self.own is None else self.own.variance_of(semantic_label, valid_us)

    def _fix_of(self, unit: str) -> Fix | None:
        """Where a unit is, as far as this platform's streams know."""
        return self.pilot.fix if unit == self.unit else fix_of(self.gateway, unit)

    def offer(self) -> None:
        """Services and labels as they are now: those of the vehicle, and those that the specification exports."""
        own = () if self.own is None else self.own.entries()
        labels = {entry.label: entry for entry in (*own, *self.declared.entries())}
        services = [offer.service for offer in self.services.offers]
        self.take(self.directory.declare(services, labels.values(), self._now_us, self.exports.tails()))

    def wake(self) -> None:
        """Streams of other platforms are needed that were not before."""
        self.supply.wake(self._now_us)

    def tell(self, record: dict[str, Any]) -> None:
        """Something the specification brings forth."""
        self._out.append(Tell(record))

    def leave(self, now_us: int) -> None:
        """Unregister: streams that are set up go on while the process lives (thesis 9.3.4)."""
        self.take(self.directory.leave(now_us))

    def rejoin(self, now_us: int) -> None:
        self.take(self.directory.start(now_us, self.exports.tails()))

    def emit(self, effects: Iterable[Effect]) -> None:
        self._out += effects

    def halt(self, reason: str) -> None:
        self._out.append(Halt(reason))

    def note(self, text: str) -> None:
        self._out.append(Note(self._now_us, text))
