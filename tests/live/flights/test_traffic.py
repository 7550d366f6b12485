"""A helicopter and a drone that are no members come over simulated vehicles: bytes of MAVLink, processes, Zenoh."""

import time
from typing import Any

import pytest

from tests.live.command_line.command import Dyknow, Follower

pytestmark = pytest.mark.live

SPEED = 4.0


def ahead_s(alarm: dict[str, Any]) -> float:
    """How long after the alarm was known well clear is lost."""
    unit, other = alarm["units"]
    late_s = (alarm["detected_us"] - alarm["valid_us"]) / 1e6
    return float(alarm["values"][f"time_to_violation[{unit},{other}]"]) / 1e6 - late_s


def test_a_helicopter_that_one_vehicle_hears_is_warned_of_a_minute_ahead_by_both_and_ends_when_it_is_silent(
    dyknow: Dyknow,
) -> None:
    dyknow.run("up", "2", "--scenario", "hover", "--detach", "--speed", str(SPEED))
    follower = Follower(dyknow)
    since_s = time.monotonic()
    dyknow.run("fault", "0", "helicopter=60", "--for", "60s")
    opened = [follower.line(since_s, event="opened", monitor="traffic-well-clear")[1] for _ in range(2)]
    assert sorted(alarm["units"] for alarm in opened) == [[0, "adsb-4ca123"], [1, "adsb-4ca123"]]
    assert all(ahead_s(alarm) >= 60.0 for alarm in opened)
    [heard] = dyknow.run("query", "traffic", "--unit", "0")
    assert heard["value"]["callsign"] == "SIMHELI"
    assert heard["value"]["kind"] == "rotocraft"
    follower.line(since_s, event="ended", units=[0, "adsb-4ca123"])


def test_a_drone_is_heard_by_its_remote_id(dyknow: Dyknow) -> None:
    dyknow.run("up", "1", "--scenario", "hover", "--detach", "--speed", str(SPEED), "--persona", "px4")
    follower = Follower(dyknow)
    since_s = time.monotonic()
    dyknow.run("fault", "0", "drone=40")
    _, alarm = follower.line(since_s, event="opened", monitor="traffic-well-clear")
    assert alarm["units"] == [0, "rid-1sim5flyby"]
    assert ahead_s(alarm) >= 60.0
