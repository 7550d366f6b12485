"""The intent of a vehicle whose mission was read: its places from the present item on, and how it ends."""

import pytest

from dyknow.navigation.intents.intent import (
    MOST_LEGS,
    IntendedPlace,
    IntentEnding,
    IntentSource,
)
from dyknow.navigation.mission_plans import MissionItem, MissionPlanReport, MissionStep
from dyknow.navigation.vehicle import (
    MissionReport,
    TargetReport,
)
from tests.agents.capabilities.separation.own.own_flight import (
    FAR,
    HERE,
    HOME,
    HOME_M,
    NEAR,
    TARGET,
    Flown,
    aside,
    hovers,
    line,
    place,
)

ITEMS = (
    MissionItem(1, MissionStep.TAKE_OFF, altitude_m=70.0),
    MissionItem(2, MissionStep.FLY_TO, *NEAR),
    MissionItem(3, MissionStep.FLY_TO, *FAR),
)


def on_mission(item: int, *more: MissionItem) -> Flown:
    """It flies that item of the mission of three and more."""
    flown = Flown(missions=True)
    flown.mode("AUTO")
    flown.pilot.on_report(MissionPlanReport(0, ITEMS + more), 0)
    flown.pilot.on_report(MissionReport(0, item), 0)
    return flown


UNDER_FAR = place(FAR)._replace(altitude_m=HOME_M)
BACK = (HOME._replace(altitude_m=FAR.altitude_m), HOME)


@pytest.mark.parametrize(
    ("last", "legs", "ending"),
    [
        ((), (), IntentEnding.HOVER),
        (
            (MissionItem(5, MissionStep.STAY, *NEAR), MissionItem(6, MissionStep.RETURN)),
            (place(NEAR),),
            IntentEnding.HOVER,
        ),
        ((MissionItem(5, MissionStep.LAND),), (UNDER_FAR,), IntentEnding.LAND),
        (
            (MissionItem(5, MissionStep.LAND, *NEAR[:2]),),
            (place(NEAR)._replace(altitude_m=110.0), place(NEAR)._replace(altitude_m=HOME_M)),
            IntentEnding.LAND,
        ),
        ((MissionItem(5, MissionStep.RETURN),), BACK, IntentEnding.LAND),
        ((MissionItem(5, MissionStep.UNKNOWN), MissionItem(6, MissionStep.LAND)), (), IntentEnding.HOVER),
    ],
)
def test_a_mission_is_its_places_from_the_present_item_on_and_ends_as_its_last_one(
    last: tuple[MissionItem, ...], legs: tuple[IntendedPlace, ...], ending: IntentEnding
) -> None:
    assert on_mission(2, *last).way() == (IntentSource.MISSION, (place(NEAR), place(FAR), *legs), ending)
    assert on_mission(3, *last).way() == (IntentSource.MISSION, (place(FAR), *legs), ending)
    up = HERE._replace(altitude_m=70.0)
    assert on_mission(0, *last).way() == (IntentSource.MISSION, (up, place(NEAR), place(FAR), *legs), ending)


def test_of_a_long_mission_the_places_within_the_time_are_legs() -> None:
    more = (MissionItem(4 + at, MissionStep.FLY_TO, *each) for at, each in enumerate(line(200, 0.0005)))
    assert len(on_mission(2, *more).intent().legs) < MOST_LEGS
    near = (MissionItem(4 + at, MissionStep.FLY_TO, 58.003, 15.0, 100.0) for at in range(200))
    flown = on_mission(2, *near, MissionItem(300, MissionStep.LAND))
    assert len(flown.intent().legs) == MOST_LEGS
    assert flown.intent().ending is IntentEnding.HOVER


def test_a_mission_whose_items_are_others_by_now_flies_to_its_target() -> None:
    flown = on_mission(2)
    flown.pilot.on_report(TARGET, 0)
    assert flown.way() == hovers(IntentSource.MISSION, place(TARGET))
    flown.pilot.on_report(TargetReport(0, *NEAR), 0)
    assert flown.way() == hovers(IntentSource.MISSION, place(NEAR), place(FAR))


@pytest.mark.parametrize("item", [4, 9])
def test_a_mission_that_is_over_or_whose_item_is_not_known_is_its_motion(item: int) -> None:
    assert on_mission(item).way() == (IntentSource.MISSION, (), IntentEnding.OPEN)


def test_a_mission_that_is_interrupted_is_its_places_from_that_item_on() -> None:
    flown = on_mission(2)
    assert aside(flown) == hovers(IntentSource.MISSION, place(NEAR), place(FAR))
