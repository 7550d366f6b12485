"""What is wanted, and is not clear: over live processes and MAVLink the vehicle looks again from elsewhere, and says what it is."""

import json
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.live.command_line.command import Dyknow

pytestmark = [pytest.mark.live, pytest.mark.full]
EXAMPLES = Path(__file__).parents[3] / "examples"
PATIENCE_S = 240.0
DOMAIN = (EXAMPLES / "missions" / "survey.dom").read_text("utf-8").replace("HEIGHT = 20", "HEIGHT = 60")
PROBLEM = """
#objects uav = {uav0}
#objects place = {field}
#init x-of(field) := 600, y-of(field) := 80
#goal survey: forall place: seen(place)
"""
STAGED = """
sort staged-thing(symbol in text, x_m in m, y_m in m, kind in text, mark in bool, anchored in bool, end in bool)
compunit staged-percept Staged(position)
compunit staged-thing WorldObject(staged-percept)
strmgen sightings = Staged(heli-position[self])
strmgen things = link(sightings, WorldObject,
    eventually[1s, oo] true, eventually[0, 1s] xy_dist[from, to] < thresh, true)
"""


class Stage:
    """One platform over things that the test puts there."""

    def __init__(self, dyknow: Dyknow, directory: Path) -> None:
        self.dyknow, self._file = dyknow, directory / "stage.json"
        self.show()
        shutil.copy(Path(__file__).with_name("staged.py"), directory)
        for name, text in (("staged.kpl", STAGED), ("survey.dom", DOMAIN), ("field.prob", PROBLEM)):
            (directory / name).write_text(text, "utf-8")
        given = ("--spec", str(directory / "staged.kpl"), "--units", str(directory / "staged.py"))
        dyknow.run("up", "1", "--scenario", "traffic", "--speed", "2", *given, "--detach")

    def show(self, **things: dict[str, Any]) -> None:
        """Have these there, and nothing else."""
        written = self._file.with_suffix(".new")
        written.write_text(json.dumps(things), "utf-8")
        written.replace(self._file)

    def want(self, description: str, *more: str) -> str:
        """The conversation."""
        given = ("symbol=suspect", "type=things", f"description={description}", "recover=yes", *more)
        (asked,) = self.dyknow.run("delegate", "want", *given, "--to", "0")
        assert asked["performative"] == "agree", asked
        return str(asked["conversation"])

    def until(self, mission: str, wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """The state of a mission, or of a recovery, once it is like that."""
        until = time.monotonic() + PATIENCE_S
        while True:
            listed = self.dyknow.run("mission", "status", code=None)
            found = next((each for each in listed if each.get("mission") == mission), None)
            if found is not None and wanted(found):
                return found
            assert time.monotonic() < until, json.dumps(found)

    def recovered(self, kind: str = "anchored", after: int = 0) -> list[str]:
        """What was done about the suspect, once that came of it."""
        found = self.until(
            "anchor-suspect", lambda each: any(one.startswith(f"{kind}: ") for one in each["actions"][after:])
        )
        return list(found["actions"][after:])


def kinds(done: list[str]) -> list[str]:
    return [each.partition(":")[0] for each in done]


@pytest.mark.timeout(900)
def test_what_is_not_clear_is_decided_by_a_flown_plan(dyknow: Dyknow, tmp_path: Path) -> None:
    stage = Stage(dyknow, tmp_path)

    # A person seen by half, whom the detector loses at the first viewpoint while the cameras show nothing: that is replanned.
    person = {"x_m": 82.0, "y_m": 95.0, "kind": "person", "mark_deg": 0.0}
    stage.show(p={**person, "hidden_deg": 180.0, "seen_m": 23.0})
    dyknow.run("fault", "0", "blind", "--for", "10min")
    asked = stage.want('kind[suspect] = "person" and mark[suspect]')
    stage.until("anchor-suspect", lambda each: sum(one.startswith("plan: ") for one in each["actions"]) == 2)
    stage.show(p=person)
    dyknow.run("fault", "0", "blind", "--for", "1ms")
    done = stage.recovered()
    assert kinds(done)[:5] == ["halted", "plan", "flies", "looks", "plan"], done
    assert done[0] == "halted: case 2: to1: kind person is as described"
    assert done[-2].endswith("shows t") and "it was looked at again" in done[-1], done
    dyknow.run("cancel", asked)

    # Nothing as described is there.
    absent = stage.want('kind[suspect] = "bear"', "within_m=25")
    done = stage.recovered("not present")
    assert done[0].startswith("halted: case 1"), done
    assert any(each.startswith("observed: from p1: case 1") for each in done)
    dyknow.run("cancel", absent)

    # A car that was anchored is lost while a mission flies; when it is seen again there are two.
    one, other = {"x_m": 96.0, "y_m": 88.0, "kind": "car"}, {"x_m": 68.0, "y_m": 92.0, "kind": "car"}
    stage.show(one={**one, "is_marked": True})
    car = stage.want('kind[suspect] = "car" and mark[suspect]')
    before = len(stage.recovered())
    texts = (str(tmp_path / "survey.dom"), str(tmp_path / "field.prob"))
    dyknow.run("mission", "start", *texts, "--name", "survey", "--detach")
    stage.until("survey", lambda each: any(one.startswith("running") for one in each["actions"]))
    stage.show()
    until = time.monotonic() + PATIENCE_S
    while not any(each.get("event") == "lost" for each in dyknow.run("explain", "suspect", code=None)):
        assert time.monotonic() < until
    stage.show(one={**one, "mark_deg": 270.0}, other=other)
    stage.until("survey", lambda each: each["phase"] == "suspended" and each["why"] == "anchor suspect is recovered")
    done = stage.recovered(after=before)
    assert kinds(done)[:4] == ["lost", "halted", "plan", "flies"], done
    assert done[-2].endswith("shows t") and "it was looked at again" in done[-1], done
    stage.until("survey", lambda each: any(one == "running  fly-to(uav0, field)" for one in each["actions"]))
    dyknow.run("cancel", car)
    stage.until("survey", lambda each: each["phase"] == "ended" and each["why"] == "the plan is done")
    assert dyknow.run("mission", "status")[0]["replans"] == 0
    assert dyknow.run("tasks", code=None) == []
