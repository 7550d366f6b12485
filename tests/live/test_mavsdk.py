"""A simulated UAV must be a vehicle to MAVSDK, not to us alone."""

import contextlib
import json
import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from federation.clock import FederationClock
from sim_uavs.autopilot_server import AutopilotServer
from sim_uavs.faults import Fault
from sim_uavs.settings import Place, VehicleConfig

pytestmark = pytest.mark.live

PROGRAM = Path(__file__).with_name("mavsdk_mission.py")
HOME = Place(55.7240, 13.4600, 20.0)
FULL = pytest.param(1.0, 10.0, marks=pytest.mark.full, id="as written")
BRIEF = pytest.param(2.0, 1.0, id="brief")


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def fly_three(persona: str, loss: float, speed: float, seconds: float) -> list[dict]:
    port = free_port()
    clock = FederationClock(speed=speed)
    with contextlib.ExitStack() as stack:
        servers = []
        for unit in (1, 2, 3):
            home = Place(HOME.latitude_deg, HOME.longitude_deg + unit * 1e-3, HOME.altitude_m)
            config = VehicleConfig(unit, home, persona=persona, seed=unit, peers=(("127.0.0.1", port),))
            servers.append(stack.enter_context(AutopilotServer(config, clock=clock)))
            if loss:
                servers[-1].inject(Fault("packet-loss", loss))
        plan = {"port": port, "count": 3, "take_off_m": 5.0, "seconds": seconds, "north_deg": 2e-4, "speed": speed}
        flown = subprocess.run(
            [sys.executable, str(PROGRAM), json.dumps(plan)],
            capture_output=True,
            text=True,
            timeout=180,
            check=False,
            env=os.environ | {"PYTHONUNBUFFERED": "1"},
        )
        assert flown.returncode == 0, f"{flown.stdout[-3000:]}\n{flown.stderr[-3000:]}"
        for server in servers:
            truth = server.truth()
            assert not truth.armed
            assert not truth.airborne
            north_m = (truth.place.latitude_deg - HOME.latitude_deg) * 111_000
            assert abs(north_m - 22.2) < 3.0, "landed where it was sent"
    return json.loads(flown.stdout.splitlines()[-1])


@pytest.mark.parametrize("persona", ["ardupilot", "px4"])
@pytest.mark.parametrize("loss", [0.0, 30.0], ids=["no loss", "30 % lost each way"])
@pytest.mark.parametrize(("speed", "seconds"), [BRIEF, FULL])
def test_mavsdk_arms_flies_and_lands_three_vehicles_on_one_port(persona, loss, speed, seconds) -> None:
    reports = fly_three(persona, loss, speed, seconds)
    assert [report["system"] for report in reports] == [1, 2, 3]
    assert all(report["rate_hz"] >= 5.0 for report in reports), reports
    if not loss:
        assert all(report[order] == 1 for report in reports for order in ("arm", "take_off", "go_to", "land")), reports
