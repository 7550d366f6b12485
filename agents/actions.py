"""Which speech acts a platform understands: each is declared once, under the service it belongs to (thesis 9.3.2).

The roles that may ask, the way of asking, whether it lasts, whether it can be typed and what handles it follow from the `Action`.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import Final, NamedTuple

from dyknow.federation.members.offers import Service
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import Cancel, Content, Done, Reason
from dyknow.model.errors import ContentError

P = Performative
REQUESTED: Final = frozenset({P.REQUEST})
QUERIED: Final = frozenset({P.QUERY_REF, P.REQUEST})
CHECKED: Final = frozenset({P.QUERY_IF, P.REQUEST})
"""Whether something is true: a query, or a task to find out."""
SUBSCRIBED: Final = frozenset({P.SUBSCRIBE})
INFORMED: Final = frozenset({P.INFORM})
COMMON_ANSWERS: Final[tuple[type[Content], ...]] = (Reason, Done, Cancel)
"""Contents with which any act may be answered or ended."""

FEDERATION: Final = Service("dyknow-federation", "federation")
"""A platform that offers it takes part: its streams can be exported, and it gets requests to monitor."""
COORDINATION: Final = Service("monitor-coordination", "coordination")


class Role(IntEnum):
    """Permissions of a member, where there is a roster; each role includes the permissions of the roles before it.

    An observer queries and subscribes at no cost to others, a delegate (another platform) sets up lasting tasks, a
    command centre flies, injects faults, takes platforms out of the federation and restores specifications. A revoked
    member has no permission.
    """

    REVOKED = -1
    OBSERVER = 0
    DELEGATE = 1
    COMMAND_CENTRE = 2


ROLES: Final = {"observer": Role.OBSERVER, "uav": Role.DELEGATE, "command-centre": Role.COMMAND_CENTRE}
"""Roles by their names in a roster."""


@dataclass(frozen=True, slots=True)
class Action:
    """One speech act that a part carries out.

    Attributes:
        content: type of the act's content.
        handler: the part's method that takes (act, content, node clock); it answers, or raises.
        performatives: with which of these it is understood.
        role: the least role, with a roster, whose members may ask for it.
        typed: whether a person can ask for it by `dyknow delegate`.
        inner: parameters that only platforms give each other.
    """

    content: type[Content]
    handler: str
    performatives: frozenset[Performative] = REQUESTED
    role: Role = Role.DELEGATE
    typed: bool = False
    inner: tuple[str, ...] = ()

    @property
    def head(self) -> str:
        return self.content.head

    @property
    def lasting(self) -> bool:
        """Whether it is agreed to and lives until it is cancelled."""
        return self.content.lasting


class Offer(NamedTuple):
    """A service, and the actions of one part that belong to it; another part may have more of the same service."""

    service: Service
    actions: tuple[Action, ...]


class ServiceTable:
    """The services of one platform, by the heads they understand.

    Raises:
        ContentError: two actions take the same head, or two services have one name and are not the same.
    """

    def __init__(self, offers: Iterable[Offer]) -> None:
        self._services: dict[str, Service] = {}
        self._by_head: dict[str, tuple[Service, Action]] = {}
        for service, actions in offers:
            if self._services.setdefault(service.service, service) != service:
                raise ContentError(f"service {service.service} is declared twice and differently")
            for action in actions:
                if self._by_head.setdefault(action.head, (service, action))[1] is not action:
                    raise ContentError(f"({action.head} ...) is understood by two parts")

    @property
    def services(self) -> tuple[Service, ...]:
        return tuple(self._services.values())

    @property
    def actions(self) -> tuple[tuple[Service, Action], ...]:
        return tuple(self._by_head.values())

    def of(self, head: str, performative: Performative) -> tuple[Service, Action]:
        """The service and action that understand a content that begins with `head`, with that performative.

        Raises:
            ContentError: there is none.
        """
        found = self._by_head.get(head)
        if found is None:
            raise ContentError(f"no service of this platform understands ({head} ...)")
        performatives = found[1].performatives
        if performative not in performatives:
            allowed = " or ".join(sorted(performatives))
            raise ContentError(f"({head} ...) is understood as {allowed}, not as {performative}")
        return found
