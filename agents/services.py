"""What a platform offers, to whom, and which agent does it (thesis 9.3.2).

A public service answers any agent on any platform. A protected one answers agents of its own platform, and others only
through the Interface Agent. A private one answers agents of its own platform only.
"""

from collections.abc import Mapping
from typing import NamedTuple

from dyknow.errors import ContentError
from federation.acts import Performative
from federation.offers import Service, Visibility

P = Performative


class Offer(NamedTuple):
    """A service, and the speech acts it supports: by head of the content, the performatives it comes with."""

    service: Service
    acts: Mapping[str, frozenset[Performative]]


_ASKED = frozenset({P.REQUEST})
_QUESTION = frozenset({P.QUERY_REF, P.REQUEST})
_FOLLOWED = frozenset({P.SUBSCRIBE})
_TOLD = frozenset({P.INFORM})


def _offer(
    name: str, agent: str, visibility: Visibility, *given: tuple[frozenset[Performative], tuple[str, ...]]
) -> Offer:
    return Offer(Service(name, agent, visibility), {head: said for said, heads in given for head in heads})


FEDERATION = _offer(
    "dyknow-federation",
    "federation",
    Visibility.PROTECTED,
    (_ASKED, ("create-multicast",)),
    (_QUESTION, ("query", "import-list")),
    (_TOLD, ("stream", "end-stream")),
)
COORDINATION = _offer(
    "monitor-coordination",
    "coordination",
    Visibility.PROTECTED,
    (_ASKED, ("monitor-proximity", "create-monitor", "avoid", "check-formula")),
    (_FOLLOWED, ("recognise",)),
    (_QUESTION, ("monitors", "tasks")),
    (_TOLD, ("alarm", "progress")),
)
FLIGHT = _offer("flight", "pilot", Visibility.PROTECTED, (_ASKED, ("goto", "hold", "land", "return-home", "resume")))
ALARMS = _offer("alarms", "alarms", Visibility.PUBLIC, (_FOLLOWED, ("alarms",)), (_QUESTION, ("alarm-list",)))
DIRECTORY = _offer("directory", "directory", Visibility.PUBLIC, (_FOLLOWED, ("directory",)), (_QUESTION, ("search",)))
ACCOUNT = _offer(
    "account",
    "account",
    Visibility.PROTECTED,
    (_FOLLOWED, ("acts",)),
    (_QUESTION, ("act-list",)),
    (_ASKED, ("leave", "rejoin")),
)
FAULTS = _offer("fault-injection", "simulator", Visibility.PROTECTED, (_ASKED, ("fault",)))
INSTANCE = _offer("local-instance", "gateway", Visibility.PRIVATE, (_QUESTION, ("labels",)))
SPECIFICATION = _offer(
    "specification",
    "gateway",
    Visibility.PROTECTED,
    (_QUESTION, ("specification",)),
    (_ASKED, ("restore-specification",)),
)

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
        self._by_head = {head: (offer.service, said) for offer in offers for head, said in offer.acts.items()}

    def of(self, head: str, performative: Performative) -> Service:
        """The service that understands a content that begins with `head`, said with that performative.

        Raises:
            ContentError: there is none.
        """
        found = self._by_head.get(head)
        if found is None:
            raise ContentError(f"no service of this platform understands ({head} ...)")
        service, said = found
        if performative not in said:
            raise ContentError(f"({head} ...) is understood as {' or '.join(sorted(said))}, not as {performative}")
        return service
