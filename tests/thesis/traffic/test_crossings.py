"""Turns in simulated crossings (8.7.4), from positions with errors of up to 2 m; fewer unless DYKNOW_FULL is set."""

import json
import os
from collections import Counter

import numpy as np
import pytest

from bench.crossings.passes import car_passes
from bench.crossings.recognition import CHRONICLE_OF, counted, links
from dyknow.anchoring.roads.turns import TURNS
from dyknow.kpl import parse_chronicles
from dyknow.reasoning.chronicles import Recogniser
from dyknow.reasoning.chronicles.recognition.events import read_events
from tests.thesis.traffic.written import EXAMPLES

TIMES = 84 if os.environ.get("DYKNOW_FULL") else 1


@pytest.mark.parametrize("hidden", [False, True], ids=["anchored", "hidden in the crossing"])
def test_8_7_4_turns_are_recognised_and_of_straight_passes_none_is_a_turn(hidden) -> None:
    turns, passes = (
        counted(6 * TIMES, straight=False, hidden=hidden),
        counted(12 * TIMES, straight=True, hidden=hidden),
    )
    assert turns["right"] >= 0.98 * 6 * TIMES, turns
    assert turns["wrong"] == passes["wrong"] == 0
    assert passes["right"] >= 0.98 * 12 * TIMES, passes
    assert (turns["predicted"] == turns["right"]) is hidden


def test_the_crossings_are_of_all_kinds() -> None:
    ways = Counter(car_passes(np.random.default_rng(number), straight=False).turn for number in range(100))
    assert set(ways) == set(TURNS) - {"straight"}
    driven = car_passes(np.random.default_rng(0), straight=True)
    assert f"links.straight[{driven.source}, x1, {driven.target}]" in map(str, links(driven.roads))


def told(*events: tuple[int, str, str, str]) -> list[str]:
    """What is recognised of changes, (ms, attribute, old, new)."""
    recogniser = Recogniser.of(parse_chronicles((EXAMPLES / "turns.chr").read_text(encoding="utf-8")))
    lines = [
        json.dumps({"t_ms": at, "attribute": attribute, "from": old, "to": new}) for at, attribute, old, new in events
    ]
    return [one.chronicle for event in read_events(lines) for one in event.told_to(recogniser)]


@pytest.mark.parametrize("turn", TURNS)
def test_8_7_4_each_relation_of_links_has_its_two_chronicles(turn) -> None:
    known = (0, f"links.{turn}[l1, x, l2]", None, True), (10, "cars.link[c]", None, "l1")
    entered = (20, "cars.link[c]", "l1", "no_link"), (20, "cars.crossing[c]", "no_crossing", "x")
    left = (900, "cars.crossing[c]", "x", "no_crossing"), (900, "cars.link[c]", "no_link", "l2")
    assert told(*known, (15, "cars.crossing[c]", None, "no_crossing"), *entered, *left) == [
        "through_crossing",
        CHRONICLE_OF[turn],
    ]
    assert told(*known, (900, "cars.link[c]", "l1", "l2")) == ["from_link_to_link", f"{CHRONICLE_OF[turn]}_predicted"]
    assert told(*known, (900, "cars.link[c]", "l1", "l3")) == ["from_link_to_link"]


def test_8_7_4_what_the_map_no_longer_has_is_no_turn() -> None:
    known = [(0, "links.left[l1, x, l2]", None, True), (5, "links.left[l1, x, l2]", True, False)]
    assert told(*known, (10, "cars.link[c]", None, "l1"), (900, "cars.link[c]", "l1", "l2")) == ["from_link_to_link"]


@pytest.mark.parametrize(("waits_ms", "is_one"), [(900, True), (100_000, True), (130_000, False)])
def test_8_7_4_a_car_may_wait_at_a_light_within_the_crossing(waits_ms: int, *, is_one: bool) -> None:
    at_ms = 20 + waits_ms
    known = (0, "links.left[l1, x, l2]", None, True), (10, "cars.link[c]", None, "l1")
    entered = (20, "cars.link[c]", "l1", "no_link"), (20, "cars.crossing[c]", "no_crossing", "x")
    left = (at_ms, "cars.crossing[c]", "x", "no_crossing"), (at_ms, "cars.link[c]", "no_link", "l2")
    found = told(*known, (15, "cars.crossing[c]", None, "no_crossing"), *entered, *left)
    assert found == (["through_crossing", CHRONICLE_OF["left"]] if is_one else [])
