"""How the campaign reads what a platform does to keep apart: the one place that knows the classes of the rule in the tree.

All the rest of the campaign knows where the vehicles really are, which orders were sent, and which alarms are open.
"""

from typing import NamedTuple

from dyknow.agents.capabilities.flight.flight import FlightAgent
from dyknow.agents.capabilities.separation.giving_way import GivingWay
from dyknow.agents.capabilities.separation.situation_view import OLD_US
from dyknow.agents.platform import Platform
from dyknow.sim_uavs.dynamics.flight import Mode

LEAVES = frozenset({Mode.AUTO, Mode.RTL, Mode.LAND})
"""Modes out of which a platform with leave (`missions`) takes its vehicle in order to keep apart."""
_FLIES_ON = " flies on"
_EXPLAINING_NOTES = (
    "it is not known where the vehicle was going",
    "is where it is to fly",
    "it stands where it made room",
    ": refused: ",
    "if the mission was begun right before",
)
"""Notes that say why a vehicle is not where it was sent, until it flies on."""


class Manoeuvre(NamedTuple):
    """What a platform has its vehicle do in order to keep apart: the number of the order, and the units it is for."""

    number: int
    reasons: frozenset[str]


def manoeuvre(platform: Platform) -> Manoeuvre | None:
    """The manoeuvre that is under way, or None. It has no open reason if `reasons` is empty.

    A vehicle whose position is not known can be ordered nothing, nor out of a manoeuvre: that is a reason.
    """
    pilot = platform.part(FlightAgent).pilot
    diversion = pilot.diversion
    if diversion is None or diversion.is_over:
        return None
    is_lost = pilot.fix is None or pilot.now_us - pilot.fix.valid_us > OLD_US
    reasons = platform.part(GivingWay).encounters
    return Manoeuvre(diversion.command.number, frozenset((*reasons, "position") if is_lost else reasons))


def is_aside(platform: Platform) -> bool:
    """Whether the vehicle flies, or has flown, something in order to keep apart, and has not been sent on since."""
    return platform.part(FlightAgent).pilot.diversion is not None


def why_not(platform: Platform, notes: list[str]) -> str:
    """Why the vehicle does not arrive where it was sent, as its user is told; empty: nothing is said of it."""
    pilot = platform.part(FlightAgent).pilot
    if pilot.claims.hands:
        return pilot.claims.hands
    if pilot._rests:
        return pilot._rests
    if pilot.errand is not None and pilot.errand.has_failed and pilot.diversion is None:
        return pilot.errand.reason
    for note in reversed(notes):
        if note.endswith(_FLIES_ON) or f"{_FLIES_ON}, free of " in note:
            return ""
        if any(words in note for words in _EXPLAINING_NOTES):
            return note
    return ""
