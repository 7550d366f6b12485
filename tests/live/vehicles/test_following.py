"""A simulated UAV over streets really flies after a car that its own camera sees, over live processes and MAVLink."""

import time
from typing import Any

import pytest

from dyknow.navigation.geodesy import distance_m
from tests.live.command_line.command import Dyknow

pytestmark = pytest.mark.live
PATIENCE_S = 150.0
MOVED_M = 15.0


def place(dyknow: Dyknow) -> tuple[float, float]:
    value = dyknow.run("query", "heli-position", "--unit", "0")[0]["value"]
    return value["latitude_deg"], value["longitude_deg"]


def followed(dyknow: Dyknow, until: float) -> str:
    """Delegate until the platform agrees: a car may be forgotten between the two commands."""
    while True:
        listed = dyknow.run("objects", "--type", "tracked-object", code=None)
        moving = sorted(listed, key=speed, reverse=True)
        for each in moving[:1]:
            answers = dyknow.run(
                "delegate", "follow", f"object={each['symbol']}", "standoff_m=0", "--to", "0", code=None
            )
            if "agree" in str(answers):
                return str(each["symbol"])
        assert time.monotonic() < until, f"nothing to follow among {listed}"


def speed(entry: dict[str, Any]) -> float:
    attributes = entry.get("attributes", entry)
    return abs(attributes.get("vx_m_s") or 0.0) + abs(attributes.get("vy_m_s") or 0.0)


def test_the_vehicle_flies_after_a_car_and_the_task_is_listed_until_it_is_cancelled(dyknow: Dyknow) -> None:
    dyknow.run("up", "1", "--scenario", "traffic", "--seed", "3", "--detach")
    until = time.monotonic() + PATIENCE_S
    unknown = dyknow.run("delegate", "follow", "object=nothing", "--to", "0", code=1)
    assert "unknown-object" in str(unknown)
    before = place(dyknow)
    followed(dyknow, until)
    while distance_m(*before, *place(dyknow)) < MOVED_M:
        assert time.monotonic() < until
        if not dyknow.run("tasks", code=None):
            followed(dyknow, until)
    looked = dyknow.run("watch", "camera-attention", "--unit", "0", "--count", "1")
    assert looked[0]["value"]["because"]
    for task in dyknow.run("tasks", code=None):
        dyknow.run("cancel", task["conversation"], code=None)
    assert dyknow.run("tasks", code=None) == []
