"""What a simulated vehicle without a protocol reports of its mission and of what bounds it, once a second, as real autopilots do."""

from typing import TypeVar

import pytest

from dyknow.navigation.mission_plans import MissionItem, MissionPlanReport, MissionStep
from dyknow.navigation.vehicle import FailsafeReport, FenceReport, LinkLossAction, MissionReport
from dyknow.sim_uavs.dynamics.flight import Mode
from dyknow.sim_uavs.dynamics.missions import Item, MissionAction
from dyknow.sim_uavs.dynamics.quadcopter import Vector
from dyknow.sim_uavs.dynamics.settings import FENCE_HIGHEST, FENCE_RADIUS, HomePlace, VehicleConfig, VehicleSettings
from dyknow.sim_uavs.dynamics.vehicles import SimulatedVehicle

T = TypeVar("T")
START_US, S = 1_700_000_000_000_000, 1_000_000


def flown(settings: VehicleSettings | None = None) -> SimulatedVehicle:
    config = VehicleConfig(1, HomePlace(58.0, 15.0, 50.0), airborne_m=40.0, settings=settings or VehicleSettings())
    return SimulatedVehicle(config, START_US)


def reports(vehicle: SimulatedVehicle, kind: type[T], seconds: float) -> list[T]:
    """Those of one kind, of so many seconds from now on."""
    found: list[T] = []
    end_us = vehicle.flight.at_us + round(seconds * S)
    while vehicle.deadline_us <= end_us:
        at_us = vehicle.deadline_us
        found += [report for report in vehicle.on_time(at_us, at_us) if isinstance(report, kind)]
    return found


def test_the_fence_that_it_reports_is_the_one_outside_of_which_it_flies_to_no_place() -> None:
    settings = VehicleSettings(fence_on=1.0, fence_kinds=float(FENCE_HIGHEST | FENCE_RADIUS), fence_highest_m=60.0)
    vehicle = flown(settings)
    (fence,) = reports(vehicle, FenceReport, 1.0)
    assert fence[1:4] == (None, 60.0, 300.0)
    assert vehicle.flight.go_to(Vector(0.0, 0.0, -61.0)).value == "outside the fence"
    assert reports(flown(), FenceReport, 1.0)[0][1:4] == (None, None, None)


def test_the_item_of_its_mission_that_it_flies_is_reported_while_it_has_one() -> None:
    vehicle = flown()
    assert reports(vehicle, MissionReport, 2.0) == []
    vehicle.flight.items = tuple(Item(MissionAction.FLY_TO, Vector(north, 0.0, -40.0)) for north in (5.0, 60.0))
    vehicle.flight.set_mode(Mode.AUTO)
    assert [report.item for report in reports(vehicle, MissionReport, 8.0)][-1] == 1


def test_it_reports_that_it_carries_on_without_its_link_which_is_what_it_does() -> None:
    vehicle = flown(VehicleSettings(return_m=35.0))
    report = reports(vehicle, FailsafeReport, 1.0)[0]
    assert (report.action, report.in_mission, report.return_height_m) == (*(LinkLossAction.CARRY_ON,) * 2, 35.0)


def test_the_places_of_its_mission_are_reported_when_they_change() -> None:
    vehicle = flown()
    assert reports(vehicle, MissionPlanReport, 2.0) == []
    vehicle.flight.items = (
        Item(MissionAction.SET_SPEED, speed_m_s=3.0),
        Item(MissionAction.FLY_TO, Vector(0.0, 0.0, -40.0)),
        Item(MissionAction.FLY_TO, Vector(0.0, 0.0, -30.0), stay_us=None),
        Item(MissionAction.TAKE_OFF, Vector(0.0, 0.0, -20.0)),
        Item(MissionAction.LAND, Vector(0.0, 0.0, 0.0)),
        Item(MissionAction.RETURN),
    )
    (report,) = reports(vehicle, MissionPlanReport, 5.0)
    expected = (
        MissionItem(1, MissionStep.FLY_TO, 58.0, 15.0, 90.0), MissionItem(2, MissionStep.STAY, 58.0, 15.0, 80.0),
        MissionItem(3, MissionStep.TAKE_OFF, altitude_m=70.0), MissionItem(4, MissionStep.LAND, 58.0, 15.0),
        MissionItem(5, MissionStep.RETURN),
    )  # fmt: skip
    assert len(report.items) == len(expected)
    for item, wanted in zip(report.items, expected, strict=True):
        assert item == pytest.approx(wanted, abs=1e-6)
    vehicle.flight.items = ()
    assert [report.items for report in reports(vehicle, MissionPlanReport, 2.0)] == [()]
