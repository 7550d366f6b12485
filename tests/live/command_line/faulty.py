"""An extension whose part raises in everything that a platform calls of it."""

from typing import Any

from dyknow.agents.actions import REQUESTED, Action, Offer, Role
from dyknow.agents.part import Part
from dyknow.federation.members.offers import Service
from dyknow.federation.messages.contents import Content


class FailHere(Content):
    """`(fail-here)`: have the part raise."""


class Faulty(Part):
    """Raises."""

    offers = (Offer(Service("faulty", "faulty"), (Action(FailHere, "fail", REQUESTED, Role.OBSERVER, typed=True),)),)

    def fail(self, *_args: Any) -> Any:
        """Whatever it is called for."""
        raise RuntimeError("made to fail")

    deadline_us = property(fail)
    is_owing = property(fail)
    labels = conditions = start = on_time = flush = on_peer = on_alarm = on_cancel = on_lost = fail


PARTS = (Faulty,)
