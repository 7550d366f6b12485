"""What a platform offers, to whom, and which agent does it (thesis 9.3.2).

A public service answers any agent on any platform. A protected one answers agents of its own platform, and others only
through the Interface Agent. A private one answers agents of its own platform only.
"""

from typing import NamedTuple

from federation.offers import Service, Visibility


class Offer(NamedTuple):
    """A service and the heads of the contents it understands."""

    service: Service
    heads: frozenset[str]


def _offer(name: str, agent: str, visibility: Visibility, *heads: str) -> Offer:
    return Offer(Service(name, agent, visibility), frozenset(heads))


FEDERATION = _offer(
    "dyknow-federation",
    "federation",
    Visibility.PROTECTED,
    "create-multicast",
    "stop-multicast",
    "query",
    "stream",
    "end-stream",
    "import-list",
)
COORDINATION = _offer(
    "monitor-coordination",
    "coordination",
    Visibility.PROTECTED,
    *(
        "monitor-proximity",
        "create-monitor",
        "remove-monitor",
        "monitors",
        "check-formula",
        "avoid",
        "alarm",
        "progress",
        "tasks",
    ),
)
FLIGHT = _offer("flight", "pilot", Visibility.PROTECTED, "goto", "hold", "land", "return-home", "resume", "take-off")
ALARMS = _offer("alarms", "alarms", Visibility.PUBLIC, "alarms", "alarm-list")
DIRECTORY = _offer("directory", "directory", Visibility.PUBLIC, "directory", "search")
ACCOUNT = _offer("account", "account", Visibility.PROTECTED, "acts", "act-list", "leave", "rejoin")
FAULTS = _offer("fault-injection", "simulator", Visibility.PROTECTED, "fault")
INSTANCE = _offer("local-instance", "gateway", Visibility.PRIVATE, "local-labels")

INTERFACE = "interface"
"""The agent every platform is addressed by from outside."""


def admitted(visibility: Visibility, *, same_platform: bool, through_interface: bool) -> bool:
    """Whether a request reaches the service: the table of thesis 9.3.2."""
    if same_platform or visibility is Visibility.PUBLIC:
        return True
    return visibility is Visibility.PROTECTED and through_interface


class ServiceTable:
    """The services of one platform, by the heads they understand."""

    def __init__(self, offers: tuple[Offer, ...]) -> None:
        self.offers = offers
        self._by_head = {head: offer.service for offer in offers for head in offer.heads}

    def of(self, head: str) -> Service | None:
        """The service that understands a content that begins with `head`."""
        return self._by_head.get(head)

    def has_agent(self, agent: str) -> bool:
        return agent == INTERFACE or any(offer.service.agent == agent for offer in self.offers)
