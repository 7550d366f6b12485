"""The parts of a platform: the parts of all platforms are listed here; capabilities and extensions bring the others.

Parts are stepped by time, by peers and by alarms in this order: producers of samples, exchange of samples,
conversations, reactions to peers and alarms; the directory comes last, since a platform comes into the federation when
it can answer.
"""

from collections.abc import Callable

from dyknow import Label
from dyknow.agents.admission.admission import Admission
from dyknow.agents.admission.message_log import MessageLog
from dyknow.agents.admission.trusted import PlatformTrust
from dyknow.agents.capabilities.capability import Stage, parts_of
from dyknow.agents.config import PlatformConfig
from dyknow.agents.directory.directory import DirectoryAgent
from dyknow.agents.exchange.export_proxy import ExportProxy
from dyknow.agents.exchange.federation_agent import FederationAgent
from dyknow.agents.exchange.gateway import Gateway
from dyknow.agents.exchange.import_proxy import ImportProxy
from dyknow.agents.exchange.label_agreements import LabelAgreements
from dyknow.agents.exchange.local_instance import LocalInstance
from dyknow.agents.exchange.peer_motion import PeerMotion
from dyknow.agents.exchange.silent_imports import SilentImports
from dyknow.agents.exchange.stream_queries import StreamQueries
from dyknow.agents.exchange.subscription_keeper import SubscriptionKeeper
from dyknow.agents.monitoring.alarm_log import AlarmLog
from dyknow.agents.monitoring.checks import Checks
from dyknow.agents.monitoring.coordination import Coordination
from dyknow.agents.monitoring.monitor_queries import MonitorQueries
from dyknow.agents.monitoring.monitors import UnitMonitors
from dyknow.agents.monitoring.recognitions import Recognitions
from dyknow.agents.monitoring.unit_monitoring import UnitMonitoring
from dyknow.agents.part import Part
from dyknow.agents.ports import Needs, PartRegistry, Ports
from dyknow.agents.shedding import Shedding
from dyknow.agents.specification.declared_streams import DeclaredStreams
from dyknow.agents.specification.learning import Learning
from dyknow.agents.specification.object_queries import ObjectQueries
from dyknow.agents.specification.remote_changes import SpecificationChanges
from dyknow.agents.specification.specification_part import SpecificationPart
from dyknow.agents.tasks.authority import Authority
from dyknow.agents.tasks.command_watch import CommandWatch
from dyknow.agents.tasks.life import TaskLife
from dyknow.federation.members.offers import Service
from dyknow.federation.sharing.translation import LabelConversion
from dyknow.kpl import Instance
from dyknow.model.errors import UnitError

PLATFORM: tuple[type[Part] | Stage, ...] = (
    Authority, CommandWatch,
    Stage.SENSING, Stage.FLYING,
    Shedding, LocalInstance, FederationAgent, PeerMotion, ImportProxy, LabelAgreements, SubscriptionKeeper, SilentImports,
    Stage.CONVERSING,
    Admission, PlatformTrust, UnitMonitoring, AlarmLog, Coordination, TaskLife, MonitorQueries, Checks, Recognitions,
    StreamQueries, SpecificationPart, SpecificationChanges, ObjectQueries, Learning,
    Stage.REACTING,
    MessageLog, DirectoryAgent,
)  # fmt: skip
"""The parts that each platform has, and where those of capabilities stand; extensions stand before the directory."""

LISTED = ("dyknow-federation", "monitor-coordination", "alarms", "directory", "account", "specification")
"""The order in which a description lists the services of the platform itself, before those of capabilities and extensions."""


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
            raise UnitError(
                f"{kind.__name__} cannot be built of (ports, parts), see dyknow.agents.ports: {error}"
            ) from error

    # -- services for parts that are built before -------------------------------------------------------

    def offer(self, at_us: int) -> None:
        self[DirectoryAgent].offer(at_us)

    def offered(self) -> list[Service]:
        places = {name: at for at, name in enumerate(LISTED)}
        return sorted(self.ports.services(), key=lambda service: places.get(service.service, len(LISTED)))

    def handling(self) -> list[Part]:
        return [self._built(kind) for kind in self._kinds if kind is not Admission]

    def instance(self) -> Instance:
        return self[SpecificationPart].instance

    def source(self) -> Callable[[str, str], tuple[Label, LabelConversion]]:
        return self[LocalInstance].source

    def declared(self) -> Callable[[str, str], Label]:
        return self[DeclaredStreams.of].find

    def monitored(self) -> Callable[[], Needs]:
        return self.monitors.needs

    # -- for onlookers --------------------------------------------------------------------------------

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
        """The accepted requests that last until they are cancelled."""
        return self[TaskLife]


def _kinds(config: PlatformConfig) -> list[type[Part]]:
    """The classes of the parts that this platform has."""
    kinds: list[type[Part]] = []
    for each in PLATFORM[:-1]:
        kinds += parts_of(each, config) if isinstance(each, Stage) else [each]
    return [*kinds, *config.extensions, DirectoryAgent]
