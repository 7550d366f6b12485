"""Answers to `(avoid ...)`: to a manoeuvre that another platform proposes, and to a meeting that it leaves to us."""

from typing import Final

from dyknow.agents.capabilities.separation.logic import STEPS, SeparationLogic
from dyknow.agents.capabilities.separation.neighbourhood import Neighbourhood
from dyknow.agents.capabilities.separation.neighbours import tube_of
from dyknow.agents.capabilities.separation.records import legs_of
from dyknow.agents.capabilities.separation.situation import Situation
from dyknow.agents.capabilities.separation.situation_view import SituationView
from dyknow.federation.messages.contents import Avoid
from dyknow.model.errors import Refused
from dyknow.navigation.intents.intent import Contingency, IntendedPlace, Intent, IntentEnding, IntentSource, RightOfWay
from dyknow.navigation.intents.meeting import MINIMA, clearance, closeness

SOON_S: Final = 20.0
"""A meeting that another leaves to us has to be so near, by our own data."""


class AvoidAnswers:
    """Answers to proposals. Agreements are stored in `logic` and `neighbourhood`."""

    def __init__(self, unit: str, logic: SeparationLogic, neighbourhood: Neighbourhood, view: SituationView) -> None:
        self._unit, self._logic = unit, logic
        self._neighbourhood, self._view = neighbourhood, view

    def answer(self, other: str, content: Avoid) -> str:
        """Agree to a proposal; returns what was agreed, as a note for users.

        Raises:
            Refused: the proposed manoeuvre conflicts with ours, or this vehicle cannot avoid the other one; with the reason.
        """
        if set(content.units) != {self._unit, other}:
            raise Refused("the manoeuvre is not between the two of us", "not-a-participant")
        own = self._neighbourhood.own.now(None)
        if own is None:
            raise Refused("this platform does not know where it is", "no-position")
        legs = legs_of(content.legs)
        if legs is None:
            raise Refused("legs: expected places; write latitude,longitude,altitude;...", "no-places")
        if not own.is_airborne:
            raise Refused("the vehicle is on the ground or not armed", "grounded")
        known = self._neighbourhood.others.by_unit.get(other)
        if known is None:
            raise Refused(f"this platform does not know where {other} is", "no-position")
        if known.leapt_us is not None:
            raise Refused(f"the position of {other} has leapt", "implausible")
        if not self._neighbourhood.is_watched:
            raise Refused("no task here keeps vehicles apart", "unwatched")
        situation = self._view.situation()
        if situation is None:
            raise Refused("the vehicle is on the ground or not armed", "grounded")
        if content.because is not None:
            return self._take(other, content.because, legs, situation)
        return self._hear(other, legs, content.speed_m_s, situation)

    def _take(self, other: str, because: str, legs: tuple[IntendedPlace, ...], now: Situation) -> str:
        """Take a meeting that another leaves to us, if its continued way meets ours; returns a note for users."""
        known = self._neighbourhood.others.by_unit[other]
        if known.has_intent:
            known.intent = known.intent._replace(rank=RightOfWay.CANNOT, legs=legs)
        now = now._replace(traffic=self._view.traffic_now(now))
        if self._logic.avoids(other):
            known.cannot, known.cannot_us = because, now.now_us
            return f"leaves all of it to {self._unit}, which makes room already: {because}"
        if not self._logic.meets(now, other) <= SOON_S:
            raise Refused(f"nothing here shows that {other} comes near", "no-evidence")
        known.cannot, known.cannot_us = because, now.now_us
        reason = self._logic.on_left(other, now)
        if reason is not None:
            raise Refused(reason, "cannot")
        return f"leaves all of it to {self._unit}: {because}"

    def _hear(self, other: str, legs: tuple[IntendedPlace, ...], speed_m_s: float | None, now: Situation) -> str:
        """Check its proposed way; refused if it meets our manoeuvre, or a way of ours that cannot be changed."""
        known = self._neighbourhood.others.by_unit[other]
        own = known.intent
        proposed = own._replace(
            source=IntentSource.MANOEUVRE,
            rank=RightOfWay.COMMITTED,
            legs=legs,
            ending=IntentEnding.HOVER,
            speed_m_s=speed_m_s or own.speed_m_s,
            contingency=Contingency(0.0, own.legs, own.ending),  # until it says that it flies it
        )
        if self._is_met(proposed, now):
            raise Refused(f"it meets the way of {self._unit}", "not-free")
        if known.has_intent:  # else its positions stand for it: it has no intent, or one that they contradict
            known.intent = proposed
        return f"{other} makes room"

    def _is_met(self, proposed: Intent, now: Situation) -> bool:
        origin = self._view.origin
        if origin is None:
            return False
        tube = tube_of(proposed, origin, now.now_us, STEPS)
        own = self._logic.flown(now)
        return clearance(closeness(own, tube[None], MINIMA)) < 1.0
