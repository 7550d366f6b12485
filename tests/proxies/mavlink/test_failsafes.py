"""What an autopilot does when its link is lost, as it says by its parameters, asked for over the wire."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.navigation.cruise import CruiseReport
from dyknow.navigation.vehicle import FailsafeReport, LinkLossAction
from dyknow.proxies.mavlink.reports import VehicleReports
from dyknow.sim_uavs.dynamics.settings import PersonaName
from tests.proxies.mavlink.test_reports import heartbeat
from tests.sim_uavs.piloted import Piloted

A = LinkLossAction


def report_of(flown: Piloted) -> FailsafeReport:
    found = flown.pilot.failsafe
    assert found is not None, "it was asked for, and has come"
    return found


def test_an_arducopter_says_how_it_returns_and_when() -> None:
    flown = Piloted("ardupilot")
    assert report_of(flown)[1:] == (A.CARRY_ON, 5.0, A.CARRY_ON, A.CARRY_ON, 20.0, 0.0, 255)


def test_a_px4_says_how_it_returns_and_when() -> None:
    flown = Piloted("px4")
    assert report_of(flown)[1:] == (A.CARRY_ON, 5.0, A.CARRY_ON, A.LAND, 20.0, None, None)


@pytest.mark.parametrize(
    ("enabled", "options", "guided", "mission"),
    [
        (0, 0, A.CARRY_ON, A.CARRY_ON),
        (1, 0, A.RETURN, A.RETURN),
        (1, 2, A.RETURN, A.CARRY_ON),
        (2, 0, A.RETURN, A.CARRY_ON),
        (5, 16, A.LAND, A.LAND),
        (99, 0, None, None),
    ],
)
def test_the_options_of_an_arducopter_count(
    enabled: int, options: int, guided: LinkLossAction | None, mission: LinkLossAction | None
) -> None:
    known = VehicleReports()
    known.reports(heartbeat(), 1)
    kind = mavlink.MAV_PARAM_TYPE_INT8
    for name, value in ((b"FS_OPTIONS", options), (b"RTL_ALT_M", 30.0), (b"FS_GCS_ENABLE", enabled)):
        (told,) = known.reports(mavlink.MAVLink_param_value_message(name, float(value), kind, 9, 0), 1)
    assert isinstance(told, FailsafeReport)
    assert (told.action, told.in_mission, told.return_height_m, told.delay_s) == (guided, mission, 30.0, None)


@pytest.mark.parametrize("persona", ["ardupilot", "px4"])
def test_an_autopilot_says_how_fast_it_flies_to_places(persona: PersonaName) -> None:
    flown = Piloted(persona)
    assert flown.pilot.cruise[1:] == (8.0, 3.0, 2.0)


@pytest.mark.parametrize(
    ("name", "value", "speed_m_s"), [(b"WPNAV_SPEED", 750.0, 7.5), (b"WP_SPD", 12.0, 12.0), (b"WPNAV_SPEED", 0.0, None)]
)
def test_older_arducopters_say_it_in_centimetres(name: bytes, value: float, speed_m_s: float | None) -> None:
    known = VehicleReports()
    known.reports(heartbeat(), 1)
    (told,) = known.reports(mavlink.MAVLink_param_value_message(name, value, mavlink.MAV_PARAM_TYPE_REAL32, 9, 0), 1)
    assert isinstance(told, CruiseReport)
    assert (told.speed_m_s or None) == speed_m_s
