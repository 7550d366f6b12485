"""The parts of a platform, listed once: a new capability is registered here, or named as an extension.

The order is the order in which parts are stepped by time, by peers and by alarms: what makes samples, what sends
and takes them, what keeps conversations, what reacts to peers and alarms; the directory comes last, since a platform
comes into the federation when it can answer.
"""

from collections.abc import Callable, Sequence

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
from agents.calls.bids import Bids
from agents.calls.calls import Calls
from agents.cameras.cameras import Cameras
from agents.config import PlatformConfig
from agents.cooperation.cooperation import Cooperation
from agents.cooperation.handover import Handover
from agents.directory.directory import DirectoryAgent
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
from agents.flight.vehicle_streams import WinchStream
from agents.missions.leading import MissionLeading
from agents.missions.mission_succession import MissionSuccession
from agents.missions.performing import Performing
from agents.missions.proposing import MissionProposals
from agents.missions.relaying import MissionRelay
from agents.monitoring.alarm_log import AlarmLog
from agents.monitoring.checks import Checks
from agents.monitoring.coordination import Coordination
from agents.monitoring.monitor_queries import MonitorQueries
from agents.monitoring.monitors import UnitMonitors
from agents.monitoring.recognitions import Recognitions
from agents.monitoring.unit_monitoring import UnitMonitoring
from agents.part import Part
from agents.ports import Needs, PartRegistry, Ports
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
from dyknow import Label
from dyknow.model.errors import UnitError
from federation.members.offers import Service
from federation.sharing.translation import LabelConversion
from kpl import Instance
from navigation.geodesy import LocalFrame
from reasoning import AlarmEvent

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


class PlatformParts(PartRegistry):
    """The parts of one platform and their shared objects; onlookers look at it, too."""

    def __init__(self, config: PlatformConfig) -> None:
        super().__init__()
        self.config, self._kinds = config, _kinds(config)

    def build(self, ports: Ports) -> tuple[Part, ...]:
        """All parts of the platform.

        Raises:
            UnitError: a part cannot be built.
        """
        self.ports = ports
        return tuple(self._built(kind) for kind in self._kinds)

    def _built(self, kind: type[Part]) -> Part:
        try:
            return self[kind]
        except TypeError as error:
            raise UnitError(f"{kind.__name__} cannot be built of (ports, parts), see agents.ports: {error}") from error

    # -- services for parts that are built before -------------------------------------------------------

    @property
    def lasting(self) -> frozenset[str]:
        return lasting_heads(self.config.extensions)

    def offer(self, at_us: int) -> None:
        self[DirectoryAgent].offer(at_us)

    def offered(self) -> list[Service]:
        places = {name: at for at, name in enumerate(LISTED)}
        return sorted(self.ports.services(), key=lambda service: places.get(service.service, len(LISTED)))

    def handling(self) -> list[Part]:
        return [self._built(kind) for kind in self._kinds if kind is not Admission]

    def on_moved(self, at_us: int) -> None:
        self[GivingWay].on_moved(at_us)

    def instance(self) -> Instance:
        return self[SpecificationPart].instance

    def source(self) -> Callable[[str, str], tuple[Label, LabelConversion]]:
        return self[LocalInstance].source

    def declared(self) -> Callable[[str, str], Label]:
        return self[DeclaredStreams.of].find

    def monitored(self) -> Callable[[], Needs]:
        return self.monitors.needs

    def on_own_alarm(self, event: AlarmEvent) -> None:
        annotated = self.ports.contain.call(self[GivingWay].annotated, event, otherwise=event)
        self.ports.on_alarm(annotated)

    def origin(self) -> LocalFrame | None:
        home, rig = self.pilot.bounds.home, self.ports.config.cameras
        if rig is not None:
            return rig.frame
        return None if home is None else LocalFrame(home.latitude_deg, home.longitude_deg, home.altitude_m)

    # -- for onlookers --------------------------------------------------------------------------------

    @property
    def pilot(self) -> Pilot:
        return self[Pilot.of]

    @property
    def gateway(self) -> Gateway:
        """The local instance under semantic labels; `ports.network` is the instance itself."""
        return self[Gateway.of]

    @property
    def exporter(self) -> ExportProxy:
        return self[ExportProxy.of]

    @property
    def monitors(self) -> UnitMonitors:
        return self[UnitMonitors.of]

    @property
    def tasks(self) -> TaskLife:
        """What was asked for and lasts."""
        return self[TaskLife]


def _kinds(config: PlatformConfig) -> list[type[Part]]:
    """The classes of the parts that this platform has."""
    attends = config.cameras is not None and config.vehicle
    wanted = (
        (Cameras, config.cameras), (CameraAttention, attends), (FlightAgent, config.vehicle), (Following, attends),
        (Scanning, attends), (RecoveringAnchors, attends), (WinchStream, config.vehicle),
        (Performing, config.vehicle), (MissionLeading, config.vehicle), (MissionProposals, config.vehicle),
        (MissionRelay, not config.vehicle), (MissionSuccession, config.vehicle), (Faults, config.simulated),
    )  # fmt: skip
    missing = {kind for kind, has in wanted if not has}
    return [kind for kind in (*PARTS[:-1], *config.extensions, PARTS[-1]) if kind not in missing]


def lasting_heads(extensions: Sequence[type[Part]] = ()) -> frozenset[str]:
    """The heads of requests that live until they are cancelled."""
    offers = [offer for part in (*PARTS, *extensions) for offer in part.offers]
    return frozenset(action.head for offer in offers for action in offer.actions if action.lasting)
