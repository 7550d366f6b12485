"""The interface from a link process to the structures that it belongs to."""

from typing import Protocol

from dyknow.anchoring.links.deciding.context import ConditionContext
from dyknow.anchoring.links.objects import EventKind, LinkObject, LinkReason, ObjectLink
from dyknow.anchoring.links.prediction import ObjectPrediction
from dyknow.anchoring.links.states import ObjectState


class LinkPorts(Protocol):
    """The interface from a link process to the structures it belongs to.

    Attributes:
        context: the context of conditions, besides both objects.
    """

    context: ConditionContext

    def create(self, valid_us: int, target: str, state: ObjectState, symbol: str | None = None) -> LinkObject:
        """A new object, with a symbol of its own if none is given."""

    def expected(self, one: LinkObject, valid_us: int) -> ObjectPrediction:
        """Where an object is at a time, by its latest state or its predictor."""

    def on_linked(
        self, valid_us: int, kind: EventKind, link: ObjectLink, reason: LinkReason, weight: float = 1.0
    ) -> None:
        """A link was made."""

    def on_unlinked(self, valid_us: int, link: ObjectLink, reason: LinkReason) -> None:
        """A link was removed."""
