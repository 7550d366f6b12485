"""`dyknow join` on vehicles that speak MAVLink: several at one port, by one process; and what is missing, in words."""

import time
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import pytest
from pymavlink import mavutil

from dyknow.runtime.configuration.local_endpoints import free_ports
from dyknow.sim_uavs.autopilot.server import AutopilotServer
from dyknow.sim_uavs.dynamics.settings import HomePlace, VehicleConfig
from tests.live.command_line.command import Dyknow, lines
from tests.proxies.vehicle import Wire

pytestmark = pytest.mark.live
HOME = HomePlace(47.0, 8.0, 500.0)


@pytest.fixture
def port() -> int:
    return free_ports(1)[0]


@pytest.fixture
def vehicles(port: int) -> Iterator[list[AutopilotServer]]:
    """Systems 1 and 2, both sending to the one port."""
    found = [
        AutopilotServer(VehicleConfig(system, HOME, persona, peers=(("127.0.0.1", port),), airborne_m=20.0))
        for system, persona in ((1, "ardupilot"), (2, "px4"))
    ]
    for each in found:
        each.start()
    yield found
    for each in found:
        each.stop()


def heard(said: Iterator[dict], count: int) -> dict[str, str]:
    """The notes of a running command that say what is heard of a vehicle, by platform."""
    found: dict[str, str] = {}
    for record in said:
        if record.get("event") == "note" and "system" in record["text"]:
            found[str(record["unit"])] = record["text"]
        if len(found) == count:
            return found
    raise AssertionError(f"the command ended; heard {found}")


def test_two_vehicles_of_one_port_are_joined_by_one_process(dyknow: Dyknow, port: int, vehicles) -> None:
    pair = ("--unit", "a", "--sysid", "1", "--unit", "b", "--sysid", "2")
    started = dyknow.start("join", *pair, "--mavlink", f"udpin:127.0.0.1:{port}", "--control", "--json")
    assert heard(lines(started), 2) == {
        "a": "hears system 1, ArduCopter, MAVLink 2",
        "b": "hears system 2, PX4, MAVLink 2",
    }
    platforms = dyknow.run("ls")
    assert [record["unit"] for record in platforms] == ["a", "b"]
    assert all(
        label["age_ms"] < 2000 for record in platforms for label in record["labels"] if "position" in label["label"]
    )
    for unit in ("a", "b"):
        assert dyknow.run("delegate", "hold", "--to", unit, "--wait")[-1]["performative"] == "inform"
    vehicles[0].stop()
    until_s = time.monotonic() + 30
    while not (found := dyknow.run("ls")[0].get("conditions")):
        assert time.monotonic() < until_s
    assert found[0]["text"] == f"system 1 is silent at udpin:127.0.0.1:{port}"
    assert "conditions" not in dyknow.run("ls")[1]


def test_a_platform_whose_vehicle_is_another_one_says_so_in_ls(dyknow: Dyknow, port: int, vehicles) -> None:
    started = dyknow.start("join", "--unit", "9", "--sysid", "77", "--mavlink", f"udpin:127.0.0.1:{port}", "--json")
    text = "heard systems 1, 2; not 77 (--sysid)"
    assert heard(lines(started), 1) == {"9": text}
    (platform,) = dyknow.run("ls")
    assert [condition["text"] for condition in platform["conditions"]] == [text]
    shown, _ = dyknow.raw("ls")
    assert f"9: {text}" in shown
    with closing(Wire(("127.0.0.1", port))):
        (found,) = [each for each in dyknow.run("doctor", "--mavlink", f"udpin:127.0.0.1:{port}", code=1)
                    if "mavlink" in each["finding"]]  # fmt: skip
    assert "another ground station" in found["detail"]


@pytest.mark.full
def test_a_ground_station_hears_a_joined_vehicle_and_its_command_is_the_pilots_hands(
    dyknow: Dyknow, port: int, vehicles: list[AutopilotServer]
) -> None:
    (behind,) = free_ports(1)
    station: Any = mavutil.mavlink_connection(f"udpin:127.0.0.1:{behind}", source_system=255)
    started = dyknow.start(
        "join", "--unit", "a", "--sysid", "1", "--mavlink", f"udpin:127.0.0.1:{port}", "--control",
        "--forward", f"udp://127.0.0.1:{behind}", "--forward-commands", "--json",
    )  # fmt: skip
    said = lines(started)
    heard(said, 1)
    beat = station.recv_match(type="HEARTBEAT", blocking=True, timeout=20)
    assert beat.get_srcSystem() == 1
    place = station.recv_match(type="GLOBAL_POSITION_INT", blocking=True, timeout=20)
    assert place.lat / 1e7 == pytest.approx(47.0, abs=1e-4)
    dyknow.run("delegate", "goto", "latitude_deg=47.0003", "longitude_deg=8.0", "altitude_m=520", "--to", "a")
    station.mav.command_long_send(1, 1, mavutil.mavlink.MAV_CMD_DO_SET_MODE, 0, 1, 4, 0, 0, 0, 0, 0)
    notes = (record["text"] for record in said if record.get("event") == "note")
    note = next(text for text in notes if "ground station" in text and "commanded" in text)
    assert note.startswith(
        "ground station 255/0 has commanded the vehicle (MAV_CMD_DO_SET_MODE); nothing is sent until"
    )
    station.close()
