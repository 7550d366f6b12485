"""What a platform offers, to whom, and which agent does it (thesis 9.3.2).

A public service answers any agent on any platform. A protected one answers agents of its own platform, and others only
through the Interface Agent. A private one answers agents of its own platform only.
"""

from dataclasses import dataclass

from federation.directory import Visibility


@dataclass(frozen=True, slots=True)
class Service:
    """One service: the agent that provides it and the heads of the contents it understands."""

    name: str
    agent: str
    visibility: Visibility
    heads: frozenset[str]


FEDERATION = Service(
    "dyknow-federation", "federation", Visibility.PROTECTED, frozenset({"create-multicast", "query", "stream", "end-stream"})
)
COORDINATION = Service(
    "monitor-coordination",
    "coordination",
    Visibility.PROTECTED,
    frozenset({"monitor-proximity", "create-monitor", "avoid", "tasks", "monitors", "check-formula"}),
)
FLIGHT = Service("flight", "pilot", Visibility.PROTECTED, frozenset({"goto", "hold", "land", "return-home", "resume"}))
ALARMS = Service("alarms", "alarms", Visibility.PUBLIC, frozenset({"alarms", "alarm-list"}))
DIRECTORY = Service("directory", "directory", Visibility.PUBLIC, frozenset({"directory", "search"}))
ACCOUNT = Service("account", "interface", Visibility.PROTECTED, frozenset({"acts", "act-list", "leave", "rejoin"}))
FAULTS = Service("fault-injection", "simulator", Visibility.PROTECTED, frozenset({"fault"}))
INSTANCE = Service("local-instance", "gateway", Visibility.PRIVATE, frozenset({"labels", "latest"}))


def admitted(visibility: Visibility, *, same_platform: bool, through_interface: bool) -> bool:
    """Whether a request reaches the service: the table of thesis 9.3.2."""
    if same_platform or visibility is Visibility.PUBLIC:
        return True
    return visibility is Visibility.PROTECTED and through_interface


class ServiceTable:
    """The services of one platform, by the heads they understand."""

    def __init__(self, services: tuple[Service, ...]) -> None:
        self.services = services
        self._by_head = {head: service for service in services for head in service.heads}

    def of(self, head: str) -> Service | None:
        """The service that understands a content that begins with `head`."""
        return self._by_head.get(head)
