"""The parts of a platform, listed once: a new capability is registered here, or named as an extension.

The order is the order in which parts are stepped by time, by peers and by alarms: what makes samples, what sends
and takes them, what keeps conversations, what reacts to peers and alarms; the directory comes last, since a platform
comes into the federation when it can answer.

A part's constructor names what it takes: another part by its class, anything else by the name of a port.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache, cached_property
from inspect import signature
from typing import Any, TypeVar

from agents.actions import ROLES, Role
from agents.admission.admission import Admission
from agents.admission.message_log import MessageLog
from agents.admission.trusted import PlatformTrust
from agents.anchors.recovering import RecoveringAnchors
from agents.areas.assignment import AreaAssignment
from agents.areas.division import AreaDivision
from agents.areas.scanning import Scanning
from agents.attention.camera_attention import CameraAttention
from agents.attention.following import Following
from agents.attention.wanting import Wanting
from agents.audit_log import AuditLog
from agents.calls.bids import Bids
from agents.calls.calls import Calls
from agents.cameras.cameras import Cameras
from agents.config import PlatformConfig
from agents.containment import Containment
from agents.cooperation.cooperation import Cooperation
from agents.cooperation.handover import Handover
from agents.directory.directory import DirectoryAgent
from agents.effects import Effect
from agents.exchange.export_proxy import ExportProxy
from agents.exchange.federation_agent import FederationAgent
from agents.exchange.gateway import Gateway
from agents.exchange.import_proxy import ImportProxy
from agents.exchange.label_agreements import LabelAgreements
from agents.exchange.local_instance import LocalInstance
from agents.exchange.peer_motion import PeerMotion
from agents.exchange.silent_imports import SilentImports
from agents.exchange.stream_queries import StreamQueries
from agents.exchange.subscription_keeper import SubscriptionKeeper
from agents.flight.flight import Faults, FlightAgent
from agents.flight.pilot import Pilot
from agents.flight.vehicle_streams import VehicleStreams, WinchStream
from agents.interface import InterfaceAgent
from agents.missions.leading import MissionLeading
from agents.missions.mission_succession import MissionSuccession
from agents.missions.performing import Performing
from agents.missions.proposing import MissionProposals
from agents.missions.relaying import MissionRelay
from agents.monitoring.alarm_log import AlarmLog
from agents.monitoring.checks import Checks
from agents.monitoring.coordination import Coordination
from agents.monitoring.monitor_plans import PlanBook
from agents.monitoring.monitor_queries import MonitorQueries
from agents.monitoring.monitors import Needs, UnitMonitors
from agents.monitoring.recognitions import Recognitions
from agents.monitoring.unit_monitoring import UnitMonitoring
from agents.part import Part, PeerChange
from agents.saliency.saliency import Saliency
from agents.separation.encounter_log import EncounterLog
from agents.separation.giving_way import GivingWay
from agents.separation.neighbourhood import Neighbourhood
from agents.shedding import Shedding
from agents.specification.declared_streams import DeclaredStreams
from agents.specification.learning import Learning
from agents.specification.object_queries import ObjectQueries
from agents.specification.remote_changes import SpecificationChanges
from agents.specification.specification_part import SpecificationPart
from agents.tasks.authority import Authority
from agents.tasks.command_watch import CommandWatch
from agents.tasks.life import TaskLife
from agents.traffic.traffic import Traffic
from dyknow import Label, Network
from dyknow.model.errors import UnitError
from federation.members.clock import Offset
from federation.members.directory import DirectoryFacilitator
from federation.members.imports import Imports
from federation.members.member import Member, MemberAgents
from federation.members.offers import Service
from federation.members.offsets import ClockOffsets
from federation.messages.descriptions import ConditionEntry, LabelEntry
from federation.shares import ActLimits, MemberShare
from federation.sharing.exports import Exports
from federation.sharing.translation import Convert, Translation
from federation.transport import Reopen, WireEffect
from kpl import Instance
from navigation.geodesy import LocalFrame
from reasoning import AlarmEvent, Profile

T = TypeVar("T", bound=Part)

PARTS: tuple[type[Part], ...] = (
    Authority, CommandWatch, Cameras, WinchStream, CameraAttention, Traffic, FlightAgent, Performing, MissionLeading,
    MissionProposals, MissionRelay, MissionSuccession, Following, RecoveringAnchors, Faults, Shedding, LocalInstance,
    FederationAgent, PeerMotion, ImportProxy, LabelAgreements, SubscriptionKeeper, SilentImports, Bids, Calls,
    AreaAssignment, AreaDivision, Scanning,
    Admission, PlatformTrust, UnitMonitoring,
    AlarmLog, Coordination, TaskLife, Neighbourhood, EncounterLog, GivingWay, MonitorQueries, Checks, Recognitions, StreamQueries, SpecificationPart,
    SpecificationChanges, ObjectQueries, Learning, Wanting, Cooperation, Handover, Saliency, MessageLog, DirectoryAgent,
)  # fmt: skip
"""The classes of all parts there are, in their order; which of them a platform has, `Ports.kinds` decides."""

LISTED = (
    "dyknow-federation", "monitor-coordination", "alarms", "directory", "account", "specification",
    "flight", "fault-injection",
)  # fmt: skip
"""The order in which a description lists services, those of extensions last: equal descriptions are equal bytes."""


@dataclass(eq=False)
class Ports:
    """What the parts of one platform are built of, each made when it is first named; onlookers look at it, too.

    Attributes:
        emit: takes an effect; note: words for users; refuse: counts what is dropped, by reason.
        on_peer, on_alarm: tell all parts of a change of a peer, of an alarm.
        services, labels: what all parts offer.
        now_us: the node clock of the present step.
        contain: what becomes of what a part raises.
    """

    config: PlatformConfig
    started_us: int
    emit: Callable[[Effect], None]
    note: Callable[[str], None]
    refuse: Callable[[str], None]
    on_peer: Callable[[PeerChange, int], None]
    on_alarm: Callable[[AlarmEvent], None]
    services: Callable[[], Sequence[Service]]
    labels: Callable[[], Sequence[LabelEntry]]
    conditions: Callable[[], Sequence[ConditionEntry]]
    now_us: Callable[[], int]
    contain: Containment

    def __post_init__(self) -> None:
        config = self.config
        self.unit, self.boot, self.clock = config.unit, config.boot, config.clock
        self.ontology = config.ontology.copy()  # a specification adds to it
        self.network, self.may_avoid = Network(), config.avoidance
        self.network.instant.contain = self.contain.stream_out_us
        self._parts: dict[type[Part], Part] = {}

    # -- parts -------------------------------------------------------------------------------------------------

    def kinds(self) -> list[type[Part]]:
        """The classes of the parts that this platform has."""
        config = self.config
        attends = config.cameras is not None and config.vehicle
        wanted = (
            (Cameras, config.cameras), (CameraAttention, attends), (FlightAgent, config.vehicle), (Following,
            attends), (Scanning, attends), (RecoveringAnchors, attends),
            (WinchStream, config.vehicle), (Performing, config.vehicle), (MissionLeading, config.vehicle),
            (MissionProposals, config.vehicle), (MissionRelay, not config.vehicle), (MissionSuccession, config.vehicle), (Faults, config.simulated),
        )  # fmt: skip
        missing = {kind for kind, has in wanted if not has}
        return [kind for kind in (*PARTS[:-1], *config.extensions, PARTS[-1]) if kind not in missing]

    def build(self) -> tuple[Part, ...]:
        """All parts of the platform.

        Raises:
            UnitError: a part cannot be built.
        """
        kinds = self.kinds()
        self.parts = [self.part(kind) for kind in kinds if kind is not Admission]
        return tuple(self.part(kind) for kind in kinds)

    def part(self, kind: type[T]) -> T:
        """The part of that class, built of what its constructor names."""
        found = self._parts.get(kind)
        if found is None:
            given = {name: self.part(of) if of else getattr(self, name) for name, of in _taken(kind).items()}  # type: ignore[arg-type]
            found = self._parts[kind] = kind(**given)
        return found  # type: ignore[return-value]

    # -- what parts of the same platform share -----------------------------------------------------------------

    @cached_property
    def agent(self) -> InterfaceAgent:
        config, audit_log = self.config, AuditLog()

        def emit(effect: WireEffect) -> None:
            if isinstance(effect, Reopen):
                self.note(f"opens a new session: {effect.why}")
            self.emit(effect)

        def member(agents: MemberAgents) -> Member:
            return Member(
                self.unit, self.boot, self.started_us, agents, audit_log.enter, emit,
                kind="uav", zid=config.zid, clock=self.clock, trust=config.trust, tails=self.exports.tails,
            )  # fmt: skip

        return InterfaceAgent(member, lasting_heads(config.extensions), audit_log, self.on_peer, self.contain)

    @property
    def learnt(self) -> Mapping[str, str]:
        return self.config.learnt

    @property
    def trusted(self) -> Mapping[str, float]:
        return self.config.trusted

    @property
    def member(self) -> Member:
        return self.agent.member

    @property
    def directory(self) -> DirectoryFacilitator:
        return self.member.directory

    @cached_property
    def limits(self) -> ActLimits:
        return ActLimits(rate_per_s=self.config.acts_per_s, burst=self.config.acts_burst)

    def role_of(self, peer: str) -> Role:
        """Without a roster everybody may command; with one, a unit that is no member, or no longer, may nothing."""
        trust = self.config.trust
        if trust is None:
            return Role.COMMAND_CENTRE
        member = trust.roster.member(peer)
        return Role.REVOKED if member is None or member.revoked else ROLES[member.role]

    @property
    def share_of(self) -> Callable[[str], MemberShare]:
        """The member whose quota a unit uses, and how many shares of it that member has."""
        return self.agent.acts.share_of

    def offered(self) -> list[Service]:
        """The services of all parts, as a description lists them."""
        places = {name: at for at, name in enumerate(LISTED)}
        return sorted(self.services(), key=lambda service: places.get(service.service, len(LISTED)))

    @property
    def offsets(self) -> ClockOffsets:
        return self.member.offsets

    @property
    def offset_of(self) -> Callable[[str], Offset | None]:
        return self.offsets.last

    @cached_property
    def translation(self) -> Translation:
        own = self.config.translation
        return Translation(self.ontology) if own is None else own.over(self.ontology)

    @property
    def source(self) -> Callable[[str, str], tuple[Label, Convert]]:
        return self.part(LocalInstance).source

    @property
    def stopwatch(self) -> Callable[[], int] | None:
        """Federation time within a step; None: time is simulated."""
        return self.config.stopwatch

    @property
    def disagreement(self) -> Callable[[str, str], str]:
        return self.part(LabelAgreements).disagreement

    @property
    def declared(self) -> Callable[[str, str], Label]:
        """(unit, label as text) -> the stream of the instance that the unit may ask for."""
        agreements = self.part(LabelAgreements)
        return DeclaredStreams(self.unit, self.network, self.translation, agreements, self.instance).find

    @property
    def fed(self) -> tuple[Part, ...]:
        """The parts that imported samples may make due earlier."""
        return self.part(LocalInstance), self.part(UnitMonitoring), self.part(PeerMotion)

    @property
    def imports(self) -> Imports:
        return self.member.imports

    @cached_property
    def exports(self) -> Exports:
        return Exports(self.unit, self.boot, self.clock.wall_us)

    @cached_property
    def exporter(self) -> ExportProxy:
        return ExportProxy(self.exports, self.network, self.translation, self.emit)

    @cached_property
    def gateway(self) -> Gateway:
        """The local instance under semantic labels; `network` is the instance itself."""
        importer = self.part(ImportProxy)
        return Gateway(self.unit, self.network, self.ontology, self.translation, self.exporter, importer)

    @cached_property
    def streams(self) -> VehicleStreams:
        return VehicleStreams(self.unit, self.network, self.translation, self.config.period_us, self.note)

    @cached_property
    def pilot(self) -> Pilot:
        def clock() -> int:
            return self.clock.federation_us(self.now_us())

        config = self.config
        return Pilot(config.control, config.plan, config.limits, config.missions, clock, self.note)

    @property
    def keeps_encounters(self) -> bool:
        return self.config.encounters

    @property
    def has_vehicle(self) -> bool:
        return self.config.vehicle

    @property
    def on_moved(self) -> Callable[[int], None]:
        """Called with the node clock after each estimate of where the vehicle is."""
        return lambda at_us: self.part(GivingWay).on_moved(at_us)

    @property
    def profiles(self) -> Mapping[str, Profile]:
        return self.config.profiles

    @property
    def camera_frame(self) -> LocalFrame | None:
        return None if self.config.cameras is None else self.config.cameras.frame

    @property
    def origin(self) -> Callable[[], LocalFrame | None]:
        """Of places on the ground: that of cameras, or the home of the vehicle, once it is known."""

        def found() -> LocalFrame | None:
            home, rig = self.pilot.bounds.home, self.config.cameras
            if rig is not None:
                return rig.frame
            return None if home is None else LocalFrame(home.latitude_deg, home.longitude_deg, home.altitude_m)

        return found

    @cached_property
    def monitors(self) -> UnitMonitors:
        def on_alarm(event: AlarmEvent) -> None:
            self.on_alarm(self.contain.call(self.part(GivingWay).annotated, event, otherwise=event))

        return UnitMonitors(self.unit, self.network, self.source, on_alarm, self.contain)

    @property
    def monitored(self) -> Callable[[], Needs]:
        return self.monitors.needs

    @cached_property
    def plans(self) -> PlanBook:
        return PlanBook(self.unit, self.config.profiles, self.config.period_us)

    @property
    def tasks(self) -> TaskLife:
        """What was asked for and lasts."""
        return self.part(TaskLife)

    @property
    def instance(self) -> Instance:
        """What the specification declares, as it runs."""
        return self.part(SpecificationPart).instance

    @property
    def offer(self) -> Callable[[int], None]:
        """Tells the directory that labels or conditions of a part have changed, at a time (node clock)."""
        return lambda at_us: self.part(DirectoryAgent).offer(at_us)


def lasting_heads(extensions: Sequence[type[Part]] = ()) -> frozenset[str]:
    """The heads of requests that live until they are cancelled."""
    offers = [offer for part in (*PARTS, *extensions) for offer in part.offers]
    return frozenset(action.head for offer in offers for action in offer.actions if action.lasting)


@cache
def _taken(kind: type[Part]) -> Mapping[str, type[Part] | None]:
    """What the constructor of a part takes by name: the class of another part, or None for a port."""
    known = {each.name for each in fields(Ports)} | {name for name in vars(Ports) if not name.startswith("_")}
    known |= {"unit", "boot", "clock", "ontology", "network", "may_avoid", "parts"}
    known -= {"build", "kinds", "part"}
    taken: dict[str, Any] = {}
    for name, parameter in signature(kind).parameters.items():
        of = parameter.annotation
        taken[name] = of if isinstance(of, type) and issubclass(of, Part) else None
    unknown = sorted(name for name, of in taken.items() if of is None and name not in known)
    if unknown:
        raise UnitError(f"{kind.__name__} wants {', '.join(unknown)}; ports are {', '.join(sorted(known))}")
    return taken
