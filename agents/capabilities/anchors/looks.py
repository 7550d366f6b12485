"""One look of a recovery's plan: since when it lasts, what it has shown."""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from dyknow import US_PER_S
from dyknow.agents.capabilities.anchors.observed_objects import ObservedObjects, properties_of, since
from dyknow.agents.capabilities.anchors.viewpoints import Viewpoint
from dyknow.anchoring.matching.descriptions import PropertyValue
from dyknow.planning.ambiguity.anchoring_recovery import AnchoringRecovery
from dyknow.planning.ambiguity.recovery_messages import SensingActionStarted

SETTLED_US: Final = 1_500_000
"""The camera is turned, and has settled, so long after a look began."""
SEEN_US: Final = 3 * US_PER_S
"""A look has shown nothing when its object, or place, has been in view for so long without the wanted property."""
SEARCHED_US: Final = 5 * US_PER_S
"""A place of a search is looked at for so long: a new percept there has to become an object."""
SHARE: Final = 0.6
"""Of the percepts of a property that have to agree."""
Shows = Callable[[float, float, int], bool]
"""Whether images newer than a time show a place."""


@dataclass(slots=True)
class PlannedLook:
    """A look at one object, or, in a search, at a place. Federation time.

    Attributes:
        before: the properties that percepts of the object had shown when it began.
    """

    started: SensingActionStarted
    since_us: int
    before: Mapping[str, Counter[PropertyValue]]
    in_view_us: int = 0

    @property
    def target(self) -> str:
        return self.started.action.arguments[0]

    def shown(self, recovery: AnchoringRecovery, objects: ObservedObjects, shows: Shows, now_us: int) -> str | None:
        """The outcome for its object, as branches of plans name it; None: nothing yet."""
        if now_us < self.since_us + SETTLED_US:
            return None
        seen = properties_of(since(objects.counts(self.target), self.before))
        sure = {name: one for name, one in seen.items() if one is not None and one.confidence >= SHARE}
        shown = recovery.shown(self.target, sure)
        place, settled_us = objects.place(self.target), self.since_us + SETTLED_US
        is_in_view = place is not None and (
            (objects.is_seen(self.target) and place.seen_us > settled_us) or shows(place.x_m, place.y_m, settled_us)
        )
        self.in_view_us = (self.in_view_us or now_us) if is_in_view else 0
        if shown == "f" and not (self.in_view_us and now_us - self.in_view_us >= SEEN_US):
            return None
        return shown

    def is_searched(self, place: Viewpoint | None, shows: Shows, now_us: int) -> bool:
        """Whether all that is seen at a place of a search has been."""
        if place is None or now_us < self.since_us + SEARCHED_US:
            return False
        return shows(place.x_m, place.y_m, self.since_us + SETTLED_US)
