"""The scenario with boxes is the one of its problem."""

import re
from pathlib import Path

import numpy as np
import pytest

from dyknow.model.errors import WrongCall
from dyknow.navigation.geodesy import LocalFrame
from dyknow.sim_uavs.boxes.shared import HandlingList
from dyknow.sim_uavs.depot import boxes_of
from dyknow.sim_uavs.dynamics.scenarios import ORIGIN, scenario

PROBLEM = Path(__file__).parents[3] / "examples" / "logistics" / "field.prob"


def test_the_scenario_has_the_places_of_its_problem() -> None:
    text = PROBLEM.read_text(encoding="utf-8")
    named = {
        name: (float(x), float(y))
        for name, x, y in re.findall(r"xpos\((\w+)\) := ([-\d.]+), ypos\(\w+\) := ([-\d.]+)", text)
    }
    situation = scenario("logistics", 2)
    assert situation.depot is not None
    frame = LocalFrame(*ORIGIN)
    found = {thing.name: (thing.x_m, thing.y_m) for thing in situation.depot.things}
    for unit in situation.units:
        north_m, east_m, _ = frame.to_ned(*unit.home)
        found[f"uav{unit.number}"] = (round(east_m, 3), round(north_m, 3))
    assert found == named


def test_other_scenarios_have_no_boxes() -> None:
    with pytest.raises(WrongCall, match="has no boxes"):
        boxes_of(scenario("hover", 1), 1, HandlingList())


def test_winds_are_drawn_by_the_seed() -> None:
    winds = {scenario("logistics", 1, seed).depot.wind for seed in range(5)}  # type: ignore[union-attr]
    assert len(winds) == 5
    assert all(1.0 <= float(np.hypot(wind.north_m_s, wind.east_m_s)) <= 4.0 for wind in winds)
