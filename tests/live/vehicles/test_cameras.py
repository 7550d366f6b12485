"""From the camera to the event over live processes: simulated UAVs over streets, their cameras, cars, turns (thesis, 8.7)."""

import re
import time
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from dyknow.sim_uavs.dynamics.scenarios import scenario
from dyknow.sim_uavs.roads.shared import ROUND_US
from dyknow.sim_uavs.streets import traffic_of
from tests.live.command_line.command import Dyknow, lines
from tests.sim_uavs.monitoring.truth import Passage, chronicle_of, passages

pytestmark = pytest.mark.live
SEED = 3
EXAMPLES = Path(__file__).parents[3] / "examples" / "traffic"
PATIENCE_S = 200.0
TURN = re.compile(r"(turn_left_in|turn_right_in|straight_through)_crossing(_predicted)?\[(\w+), (\w+), (\w+), (\w+)\]")
CARS = 200
"""Among this many cars at least one passes a crossing while it is tracked."""


@pytest.mark.timeout(1200)
def test_cars_are_explained_and_a_way_that_is_recognised_or_predicted_is_one_that_a_car_took(dyknow: Dyknow) -> None:
    dyknow.run("up", "2", "--scenario", "traffic", "--seed", str(SEED), "--detach")
    for is_predicted in (False, True):
        check_turn(dyknow, recognised_turn(dyknow, is_predicted=is_predicted))

    percepts = dyknow.run("watch", "vision-percepts", "--unit", "0", "--count", "3")
    assert all(each["value"]["sd_m"] is not None for each in percepts)
    state = dyknow.run("query", "camera-state", "--unit", "0")[0]["value"]
    assert state["altitude_m"] == pytest.approx(85.0, abs=3.0)
    check_beliefs(dyknow)


def check_beliefs(dyknow: Dyknow) -> None:
    """What is believed is listed with existence, types and the platforms that see it, watched, and explained."""
    until, sure = time.monotonic() + PATIENCE_S, list[dict[str, Any]]()
    while not any(each["seen_by"] == str(each["unit"]) for each in sure):
        believed = [each for each in dyknow.run("objects", "--type", "car", code=None) if "existence" in each]
        sure = [each for each in believed if each["existence"] > 0.9 and each["status"] == "confirmed"]
        assert time.monotonic() < until, believed
    assert all(each["types"].startswith("car 0.") for each in sure if each["type"] == "car")
    (watched,) = dyknow.run("watch", "believed-objects", "--unit", "0", "--count", "1")
    assert 0.0 <= watched["value"]["existence"] <= 1.0
    history = dyknow.run("explain", sure[0]["symbol"], "--unit", str(sure[0]["unit"]))
    assert {"created", "confirmed"} & {each["event"] for each in history}


def check_turn(dyknow: Dyknow, turn: dict[str, Any]) -> None:
    """It is of a car that is explained, also once it is forgotten, and was really gone."""
    name, _, car, come, crossing, gone = TURN.fullmatch(turn["to"]).groups()  # type: ignore[union-attr]

    history = dyknow.run("explain", car, "--unit", str(turn["unit"]), code=None)
    if turn["to"] not in {each["to"] for each in history}:  # the platforms have agreed on another name since
        renamed = [each for each in dyknow.run("events", code=None) if each["event"] == "renamed"]
        assert any(car in str(each) for each in renamed), (history, renamed)

    assert "-" not in turn["because"], turn  # a way that has been there since ever has no time

    at_us = round(turn["t_ms"] * 1000)
    traffic = traffic_of(scenario("traffic"), SEED)
    begun_us = at_us - at_us % ROUND_US
    took = passages(traffic.at, range(begun_us, at_us + 1_000_000, 100_000))
    near = [each for each in took if abs(each.at_us - at_us) < 3_000_000]
    assert (come, crossing, gone) in {(each.come, each.crossing, each.gone) for each in near}
    assert is_turn(traffic.network, name, near, (come, crossing, gone))


def recognised_turn(dyknow: Dyknow, *, is_predicted: bool) -> dict[str, Any]:
    """The latest way through a crossing that any platform recognises, one that it sees or one that it does not."""
    cars = set[tuple[int, str]]()
    while True:
        events = dyknow.run("events", code=None)
        for each in reversed(events):
            turn = TURN.fullmatch(each["to"]) if each["event"] == "recognised" else None
            if turn is not None and bool(turn[2]) is is_predicted:
                return each
        cars |= {(each["unit"], each["to"]) for each in events if is_of_a_percept(each)}
        if len(cars) >= CARS:
            recognised = Counter(
                (each["unit"], each["to"].partition("[")[0]) for each in events if each["event"] == "recognised"
            )
            pytest.fail(f"no way of {len(cars)} cars; recognised are {recognised}; the platforms: {dyknow.run('ls')}")


def is_of_a_percept(event: dict[str, Any]) -> bool:
    return event["event"] == "established" and str(event["from"]).startswith("vp")


def is_turn(network: Any, name: str, near: list[Passage], way: tuple[str, str, str]) -> bool:
    return any(
        chronicle_of(network, each) == f"{name}_crossing"
        for each in near
        if (each.come, each.crossing, each.gone) == way
    )


def test_a_detector_of_ones_own_in_a_host_takes_the_place_of_cameras(dyknow: Dyknow) -> None:
    dyknow.run("up", "1", "--scenario", "hover", "--spec", str(EXAMPLES / "cars.kpl"), "--detach")
    host = dyknow.start("host", str(EXAMPLES / "detector.py"), "--unit", "0", "--json")
    registered = next(line for line in lines(host) if line["event"] == "registered")
    assert registered["labels"] == ["vision-percepts[0]"]
    until = time.monotonic() + PATIENCE_S
    while len(listed := dyknow.run("objects", code=None)) < 2:
        assert time.monotonic() < until
    assert {each["colour"] for each in listed} == {"red", "white"}
    assert {each["to"] for each in dyknow.run("events") if each["event"] == "established"} >= {"co1", "co2"}
