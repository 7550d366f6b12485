"""Two vehicles cross, a third stays apart: each a process with its own MAVLink autopilot, over real Zenoh."""

import sys
import time
from collections.abc import Callable
from math import hypot
from pathlib import Path

import pytest

from dyknow.federation.messages.contents import Alarm, Alarms
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.navigation.geodesy import distance_m
from dyknow.reasoning.features.proximity import closest_approach
from dyknow.reasoning.features.proximity import offset_m as offset
from dyknow.sim_uavs.dynamics.scenarios import scenario
from tests.live.flights.federated import VELOCITY, Federated, federated, separations

pytestmark = pytest.mark.live

S = 1_000_000
PERIOD_US = 100_000
LEAD_US = 10 * S
PAIR, APART = ("0", "1"), "2"
UNITS = [*PAIR, APART]
ROUTES = [unit.route for unit in scenario("crossing", 3).units]
[MEETING] = scenario("crossing", 3).meetings
Vector = tuple[float, ...]
"""North, east, down."""


def crossing(directory: Path, *, avoidance: bool, speed: float):
    """The three, streamed to a command centre, their alarms followed, with (monitor-proximity) delegated to 0."""
    now_us = time.time_ns() // 1000
    clock = {"epoch_us": now_us, "speed": speed}
    start_us = now_us + round(LEAD_US * speed)
    configs = [
        {
            "unit": unit,
            "avoidance": avoidance,
            "vehicle": {
                "kind": "simulated",
                "scenario": "crossing",
                "index": index,
                "count": 3,
                "start_us": start_us,
            },
        }
        for index, unit in enumerate(UNITS)
    ]
    return start_us, federated(directory, configs, clock)


def set_up(federation: Federated) -> Dialogue:
    federation.stream_positions(UNITS, 2.0, VELOCITY)
    federation.follow_alarms(UNITS, Alarms())
    return federation.monitor("0")


def arrived(federation: Federated, index: int) -> bool:
    """Whether a unit of the pair is at the end of its route."""
    track, goal = federation.track(UNITS[index]), ROUTES[index].waypoints[-1]
    if not track:
        return False
    latitude_deg, longitude_deg, altitude_m = track[max(track)]
    up_m = altitude_m - goal.altitude_m
    return distance_m(latitude_deg, longitude_deg, goal.latitude_deg, goal.longitude_deg, up_m) < 4.0


def pairs(federation: Federated, monitor: str) -> set[tuple[str, ...]]:
    return {alarm.units for alarm in federation.opened(monitor)}


def violates(offset_m: Vector, _speed_m_s: Vector) -> bool:
    return hypot(*offset_m[:2]) < 15.0 and abs(offset_m[2]) < 10.0


def warns(offset_m: Vector, speed_m_s: Vector) -> bool:
    closest = closest_approach(offset_m, speed_m_s)
    soon = closest.time_s <= 10.0 and closest.xy_m < 15.0 and closest.z_m < 10.0
    return soon or (hypot(*offset_m[:2]) < 60.0 and abs(offset_m[2]) < 20.0)


def opens_with(federation: Federated, monitor: str, holds: Callable[[Vector, Vector], bool]) -> None:
    """Each of the pair raised it for the first federated state that shows it, give or take a period."""
    (a, b), (u, v) = (federation.track(unit) for unit in PAIR), (federation.values(unit, VELOCITY) for unit in PAIR)
    for at_us in sorted(a.keys() & b.keys() & u.keys() & v.keys()):
        offset_m = (*offset(a[at_us], b[at_us]), a[at_us][2] - b[at_us][2])
        if holds(offset_m, tuple(other - own for own, other in zip(u[at_us], v[at_us], strict=True))):
            for by in PAIR:
                first_us = min(alarm.valid_us for alarm in federation.opened(monitor, by))
                assert abs(first_us - at_us) <= PERIOD_US
            return
    raise AssertionError(f"no state shows {monitor}")


def tells_the_delegator(federation: Federated, task: Dialogue) -> None:
    """What was delegated tells of every alarm of the pair, whoever raised it."""
    ids = {said.id for said in task.results if isinstance(said, Alarm)}
    assert ids >= {alarm.id for monitor in ("proximity", "proximity-warn") for alarm in federation.opened(monitor)}


def appear_in_time(federation: Federated) -> None:
    """One sample period and 200 ms after the sample that shows it, on the platform and at the command centre."""
    openings = [(alarm, at_us) for alarm, at_us in federation.alarms if alarm.event == "opened"]
    assert openings
    for alarm, at_us in openings:
        assert alarm.detected_us - alarm.valid_us <= PERIOD_US + 200_000, alarm
        assert at_us - alarm.valid_us <= PERIOD_US + 200_000, alarm


@pytest.mark.parametrize("speed", [2.0, pytest.param(1.0, marks=pytest.mark.full)])
def test_with_avoidance_both_warn_stay_apart_and_finish_their_routes(tmp_path, speed) -> None:
    assert all(route.speed_m_s >= 5.0 for route in ROUTES[:2])
    _, starting = crossing(tmp_path, avoidance=True, speed=speed)
    with starting as federation:
        task = set_up(federation)
        finished = federation.wait_for(lambda: arrived(federation, 0) and arrived(federation, 1), 110 / speed + 10)
        apart = separations(federation.track("0"), federation.track("1"))
        sys.stdout.write(f"smallest separation {min(apart.values()):.2f} m; {told(federation)}\n")
        assert pairs(federation, "proximity-warn") == {("0", "1"), ("1", "0")}, "each of the other, and nobody of 2"
        assert not federation.opened("proximity")
        opens_with(federation, "proximity-warn", warns)
        tells_the_delegator(federation, task)
        assert len(apart) > 300
        assert min(apart.values()) > 10.0
        assert finished, "both resumed their routes and flew them to the end"
        closed = {alarm.id for alarm in federation.closed("proximity-warn")}
        assert closed >= {alarm.id for alarm in federation.opened("proximity-warn")}
        if speed == 1.0:
            appear_in_time(federation)


@pytest.mark.parametrize("speed", [4.0, pytest.param(1.0, marks=pytest.mark.full)])
def test_without_avoidance_both_alarms_open_and_they_meet(tmp_path, speed) -> None:
    start_us, starting = crossing(tmp_path, avoidance=False, speed=speed)
    with starting as federation:
        task = set_up(federation)
        federation.until_us(start_us + MEETING.after_us + 15 * S)
        a, b = federation.track("0"), federation.track("1")
        apart = separations(a, b)
        sys.stdout.write(f"smallest separation {min(apart.values()):.2f} m; {told(federation)}\n")
        for monitor in ("proximity", "proximity-warn"):
            assert pairs(federation, monitor) == {("0", "1"), ("1", "0")}
            assert federation.closed(monitor)
        assert min(apart.values()) < 5.0
        opens_with(federation, "proximity", violates)
        opens_with(federation, "proximity-warn", warns)
        tells_the_delegator(federation, task)
        if speed == 1.0:
            appear_in_time(federation)


def told(federation: Federated) -> str:
    return "; ".join(
        f"{a.event} {a.monitor} {a.units} +{(a.detected_us - a.valid_us) / 1000:.0f} ms, told +{(at - a.valid_us) / 1000:.0f} ms"
        for a, at in federation.alarms
    )
