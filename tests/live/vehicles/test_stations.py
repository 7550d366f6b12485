"""A ground station that commands a vehicle of `dyknow up` right after it has started: its target is flown to, and stays."""

import socket
import time
from contextlib import closing
from math import nan

import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.sim_uavs.dynamics.settings import PersonaName
from tests.live.command_line.command import Dyknow

pytestmark = pytest.mark.live

METRES_PER_DEGREE = 111_319.5
NORTH_M, THERE_M, STAYS_S, PATIENCE_S = 40.0, 2.0, 5.0, 60.0
_CHANGE_MODE = 1.0
"""DO_REPOSITION, parameter 2, as MAVSDK's `goto_location` sends it."""


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.mark.parametrize("persona", ["ardupilot", "px4"])
def test_a_target_of_a_station_right_after_the_start_is_flown_to_and_not_overwritten(
    dyknow: Dyknow, persona: PersonaName
) -> None:
    port = free_port()
    with closing(mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}", source_system=245)) as station:
        dyknow.run("up", "1", "--scenario", "hover", "--gcs", f"127.0.0.1:{port}", "--persona", persona, "--detach")
        assert station.wait_heartbeat(timeout=PATIENCE_S) is not None
        here = station.recv_match(type="GLOBAL_POSITION_INT", blocking=True, timeout=PATIENCE_S)
        north_e7 = here.lat + round(NORTH_M / METRES_PER_DEGREE * 1e7)
        station.mav.command_int_send(
            station.target_system, 1, mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_CMD_DO_REPOSITION, 0, 0,
            -1.0, _CHANGE_MODE, 0.0, nan, north_e7, here.lon, here.alt / 1000.0,
        )  # fmt: skip
        until_s, there_s, away_m = time.monotonic() + PATIENCE_S, None, NORTH_M
        while time.monotonic() < until_s and (there_s is None or time.monotonic() < there_s + STAYS_S):
            at = station.recv_match(type="GLOBAL_POSITION_INT", blocking=True, timeout=PATIENCE_S)
            away_m = abs(at.lat - north_e7) / 1e7 * METRES_PER_DEGREE
            if away_m < THERE_M and there_s is None:
                there_s = time.monotonic()
        assert there_s is not None, f"it is still {away_m:.0f} m away"
        assert away_m < THERE_M, "it has been sent elsewhere"
