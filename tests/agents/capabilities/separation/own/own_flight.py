"""A vehicle driven by its reports, and what its platform publishes of it: the same after writing and reading."""

import pytest

from dyknow import Sample
from dyknow.agents.capabilities.flight.pilot import Pilot
from dyknow.agents.capabilities.separation.own.own_intent import OwnIntent
from dyknow.agents.capabilities.separation.records import INTENT, intent_of, intent_value
from dyknow.agents.places import FlightPlan, Waypoint
from dyknow.navigation.intents.intent import (
    IntendedPlace,
    Intent,
    IntentEnding,
    IntentSource,
)
from dyknow.navigation.vehicle import (
    Command,
    CommandResult,
    GoToOrder,
    HomeReport,
    StatusReport,
    TargetReport,
)

HOME_M = 50.0
HOME = IntendedPlace(58.0, 15.0, HOME_M)
FLIES = StatusReport(0, armed=True, guided=True, airborne=True, mode="GUIDED")
HERE = IntendedPlace(58.001, 15.0, 100.0)
NEAR, FAR = Waypoint(58.002, 15.0, 100.0), Waypoint(58.003, 15.0, 110.0)
TARGET = TargetReport(0, 58.004, 15.001, 90.0)
LAND_MODES, RETURN_MODES, MISSION_MODES = ("LAND", "AUTO.LAND"), ("RTL", "AUTO.RTL"), ("AUTO", "AUTO.MISSION")


class Flown:
    """A vehicle 100 m above the sea, 111 m north of its home, 50 m above it, and what its platform makes of its reports."""

    def __init__(
        self, plan: FlightPlan | None = None, *, control: bool = True, missions: bool = False, may_avoid: bool = True
    ) -> None:
        self.pilot = Pilot(control=control, plan=plan, missions=missions)
        self.own = OwnIntent(self.pilot, may_avoid=may_avoid)
        self.pilot.on_report(HomeReport(0, *HOME), 0)
        self.pilot.on_report(FLIES, 0)
        self.commands = self.at(0)

    def at(
        self, now_us: int, place: IntendedPlace = HERE, north_m_s: float = 0.0, down_m_s: float = 0.0
    ) -> list[Command]:
        estimate = (*place, north_m_s, 0.0, down_m_s)
        return self.pilot.on_estimate(Sample(now_us, now_us, estimate))

    def mode(self, mode: str, *, guided: bool = False) -> None:
        self.pilot.on_report(FLIES._replace(mode=mode, guided=guided), self.pilot.now_us)

    def does(self, commands: list[Command]) -> None:
        """The vehicle accepts them."""
        for command in commands:
            self.pilot.on_report(CommandResult(0, command.number, True, ""), self.pilot.now_us)

    def intent(self, manoeuvre: tuple[IntendedPlace, ...] | None = None) -> Intent:
        """What it publishes; that is the same after writing and reading."""
        found = self.own.now(manoeuvre)
        assert found is not None
        same_after_writing(found)
        return found

    def way(self) -> tuple[IntentSource, tuple[IntendedPlace, ...], IntentEnding]:
        intent = self.intent()
        return intent.source, intent.legs, intent.ending


def same_after_writing(intent: Intent) -> None:
    value = intent_value(intent)
    assert isinstance(value, tuple)
    assert all(len(each) <= 1024 for each in value if isinstance(each, str))
    again = intent_of(Sample(intent.at_us, intent.at_us, value))
    assert again is not None, f"others do not read this {INTENT}"
    same_legs(again.legs, intent.legs)
    assert (again.contingency is None) is (intent.contingency is None)
    if again.contingency is not None and intent.contingency is not None:
        same_legs(again.contingency.legs, intent.contingency.legs)
        assert again.contingency.ending is intent.contingency.ending
        assert again.contingency.after_s == pytest.approx(intent.contingency.after_s, abs=0.06)
    assert again._replace(legs=(), contingency=None) == intent._replace(legs=(), contingency=None)


def same_legs(some: tuple[IntendedPlace, ...], others: tuple[IntendedPlace, ...]) -> None:
    assert len(some) == len(others)
    for one, other in zip(some, others, strict=True):
        assert one[:2] == pytest.approx(other[:2], abs=1e-7)
        assert one.altitude_m == pytest.approx(other.altitude_m, abs=0.06)


def place(where: Waypoint | TargetReport | GoToOrder) -> IntendedPlace:
    return IntendedPlace(*where[1:4]) if isinstance(where, TargetReport) else IntendedPlace(*where[:3])


def hovers(source: IntentSource, *legs: IntendedPlace) -> tuple[IntentSource, tuple[IntendedPlace, ...], IntentEnding]:
    return source, legs, IntentEnding.HOVER


def line(count: int, step_deg: float) -> tuple[Waypoint, ...]:
    return tuple(Waypoint(58.001 + step_deg * (1 + number), -115.1234567, 100.0) for number in range(count))


def aside(flown: Flown) -> tuple[IntentSource, tuple[IntendedPlace, ...], IntentEnding]:
    """Its way without others while it flies a diversion."""
    (command,) = flown.pilot.divert(80.0)
    flown.does([command])
    if flown.pilot.status != FLIES:
        flown.mode("GUIDED", guided=True)
    flown.pilot.on_report(TargetReport(0, *HERE[:2], 80.0), flown.pilot.now_us)
    return flown.way()
