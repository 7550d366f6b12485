"""The emergency service over real processes: two UAVs scan the field, make one map, and bring boxes; one of them is killed."""

import json
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import dyknow as library
from dyknow.runtime.library.pictures.supplies import supply_goals
from dyknow.sim_uavs.bodies import bodies_of
from dyknow.sim_uavs.dynamics.scenarios import scenario
from tests.live.command_line.command import Dyknow

pytestmark = [pytest.mark.live, pytest.mark.full]
EXAMPLES = Path(__file__).parents[3] / "examples"
LOGISTICS, DEPOT = EXAMPLES / "logistics" / "logistics.dom", EXAMPLES / "emergency" / "depot.prob"
SEED = 5
PATIENCE_S = 600.0


def until(asked: Callable[[], Any], wanted: Callable[[Any], bool], within_s: float = PATIENCE_S) -> Any:
    until_s = time.monotonic() + within_s
    while not wanted(found := asked()):
        assert time.monotonic() < until_s, found
    return found


@pytest.mark.timeout(1500)
def test_the_field_is_scanned_boxes_are_brought_and_what_a_killed_uav_was_to_do_the_other_does(
    dyknow: Dyknow, tmp_path: Path
) -> None:
    *_, ready = dyknow.run("up", "2", "--scenario", "emergency", "--seed", str(SEED), "--speed", "2", "--detach")
    field = str(EXAMPLES / "emergency" / "field.geojson")
    (asked,) = dyknow.run("delegate", "divide-area", f"area={field}", "sensor=camera-view", "scan_m=45", "--to", "0")
    assert asked["performative"] == "agree", asked

    def states() -> list[str]:
        return [each["text"] for line in dyknow.run("ls") for each in line.get("conditions", ())]

    until(states, lambda texts: sum(each.startswith("scan: 100% of its piece") for each in texts) == 2)
    field_of = scenario("emergency", 2, SEED).field
    assert field_of is not None
    lie = [each for each in bodies_of(field_of, SEED) if each.kind == "person"]
    for unit in "01":
        until(lambda: dyknow.run("saliency", "--unit", unit, code=None), lambda rows: len(rows) >= 11)  # noqa: B023
        rows = dyknow.run("saliency", "--unit", unit)
        assert len(rows) <= 12, "one false entry at most"
        for person in lie:
            assert min(abs(complex(each["x_m"] - person.x_m, each["y_m"] - person.y_m)) for each in rows) < 2.0
    out, _ = dyknow.raw("saliency", "--format", "geojson")
    features = json.loads(out)["features"]
    assert {each["geometry"]["type"] for each in features} == {"Point"} and len(features) == len(rows)
    out, _ = dyknow.raw("saliency", "--supplies", str(DEPOT))
    assert out.count("#goal brought-") == 11
    dyknow.run("cancel", asked["conversation"])

    with library.connect(dyknow.federation) as fed:
        persons = fed.saliency()
    near = sorted(persons, key=lambda each: each.y_m)[:4]
    goals = tmp_path / "goals.prob"
    goals.write_text(supply_goals(near, DEPOT.read_text("utf-8")).text, "utf-8")
    texts = (str(LOGISTICS), str(DEPOT), "--constraints", str(goals), "--name", "boxes", "--to", "0", "--detach")
    until(
        lambda: dyknow.run("mission", "start", *texts, code=None) and dyknow.run("mission", "status", code=None), bool
    )

    def mission() -> dict[str, Any]:
        return next(each for each in dyknow.run("mission", "status") if each["mission"] == "boxes")

    until(mission, lambda entry: any(each.startswith("running  fly-box-to-goal(uav1") for each in entry["actions"]))
    os.kill(ready["pids"]["1"], signal.SIGKILL)
    entry = until(mission, lambda entry: entry["phase"] == "ended")
    assert entry["why"] == "the plan is done", entry
