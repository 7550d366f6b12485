"""Objects on running platforms: linked on roads by one, imported, listed, explained and followed by others."""

from pathlib import Path

import pytest

from tests.live.command_line.command import Dyknow, lines

pytestmark = pytest.mark.live
EXAMPLES = Path(__file__).parents[3] / "examples" / "objects"
LABEL = 'label cars-on-roads : cars "cars that a platform links on roads"\n'
SORT = "sort cars(symbol in text, x_m in m, y_m in m, link in text, anchored in bool, end in bool)\n"
CAMERA = """\
from dyknow import source

@source("vision-percept")
def camera(from_us):
    \"\"\"A car drives to and fro on the western road, three seconds to be seen and two hidden.\"\"\"
    valid_us = -(-from_us // 100_000) * 100_000
    while True:
        track, phase_us = divmod(valid_us, 5_000_000)
        if phase_us <= 3_000_000:
            at_m, ahead = abs((valid_us / 1e5) % 200.0 - 100.0), (valid_us / 1e5) % 200.0 >= 100.0
            east_m_s = 10.0 if ahead else -10.0
            y_m = -1.8 if ahead else 1.8
            yield valid_us, (f"vp{track}", at_m - 150.0, y_m, 0.4, east_m_s, 0.0, "red", phase_us == 3_000_000)
        valid_us += 100_000
"""
WATCHER = """\
import cars-on-roads from 7 as theirs with max delay 1s
stream there = theirs.objects
monitor on_west = always forall c in theirs: theirs.link[c] = "west"
"""


def test_objects_linked_on_a_road_are_listed_explained_followed_and_imported(dyknow: Dyknow, tmp_path: Path) -> None:
    (units := tmp_path / "units.py").write_text(CAMERA, encoding="utf-8")
    declared = (EXAMPLES / "camera.kpl").read_text(encoding="utf-8").replace("../roads", str(EXAMPLES.parent / "roads"))
    (spec := tmp_path / "camera.kpl").write_text(
        f"{declared}{SORT}{LABEL}export cars-on-roads = cars\n", encoding="utf-8"
    )
    (watcher := tmp_path / "watcher.kpl").write_text(f"{SORT}{LABEL}{WATCHER}", encoding="utf-8")
    platform = dyknow.start("join", "--unit", "7", "--spec", str(spec), "--units", str(units), "--json")
    other = dyknow.start("join", "--unit", "8", "--spec", str(watcher), "--json")
    link = next(line for line in lines(platform) if line.get("stream") == "link-co1" and line["event"] == "sample")
    assert link["value"] == "west"
    there = next(line for line in lines(other) if line.get("stream") == "there" and line.get("value"))
    assert there["value"] == ["co1"]

    seen = dyknow.run("objects", "--type", "cars", "--unit", "7")
    assert [each["symbol"] for each in seen] == ["co1"]
    history = dyknow.run("explain", "co1", "--unit", "7")
    assert (history[0]["event"], history[0]["from"][:2]) == ("established", "wo")
    assert "on_road[from]" in history[0]["because"]
    followed = dyknow.start("events", "--follow", "--json")
    event = next(line for line in lines(followed) if line["event"] == "reestablished")
    assert event["to"] == "wo1"

    described = 'description=always [0, 1s] (link[suspect] = "west" and speed[suspect] > 5)'
    wanted = ("delegate", "want", "symbol=suspect", "type=cars", "--to", "7")
    refused = dyknow.run(*wanted, described.replace("speed[", "sped["), code=1)
    assert "objects of cars have no sped" in str(refused)
    (agreed,) = dyknow.run(*wanted, described)
    found = next(line for line in lines(followed) if (line["event"], line["to"]) == ("find", "suspect"))
    assert 'link[suspect] = "west"' in found["because"]
    assert "suspect" in [each["symbol"] for each in dyknow.run("objects", "--unit", "7")]
    assert "find" in [each["event"] for each in dyknow.run("explain", "suspect", "--unit", "7")]
    (task,) = dyknow.run("tasks")
    assert (task["task"], "suspect is" in task["state"]) == ("want", True)
    dyknow.run("cancel", agreed["conversation"])
    again = next(line for line in lines(followed) if (line["event"], line["to"]) == ("forgotten", "suspect"))
    assert again["because"] == "it is wanted no more"


SENSORS = """\
from dyknow import computational_unit, source

@source("sighting")
def camera(from_us):
    return seen("ca", from_us, 100_000, 0.4)

@source("sighting")
def radar(from_us):
    return seen("ra", from_us, 300_000, 2.0)

def seen(name, from_us, period_us, sd_m):
    valid_us = -(-from_us // period_us) * period_us
    while True:
        for number, ahead_m in enumerate((0.0, 20.0)):
            yield valid_us, (f"{name}{number}", ahead_m + 8.0 * (valid_us / 1e6 % 1e5), 0.0, sd_m, False)
        valid_us += period_us

@computational_unit("vehicle", "world", "vehicle", name="Counted", needs_all=False)
def counted(_now_us, world, before):
    samples = 1 if before is None else before.value[3] + 1
    return (*world.value[:3], samples, False)
"""
CONVOY = """\
sort sighting(symbol in text, x_m in m, y_m in m, sd_m in m, end in bool)
sort vehicle(symbol in text, x_m in m, y_m in m, samples in 1, end in bool)
source sighting camera
source sighting radar
compunit vehicle Counted(world, vehicle)
strmgen seen = camera
strmgen heard = radar
strmgen world = link(seen, WorldObject, eventually[1s, oo] true, eventually[0, 1s] xy_dist[from, to] < thresh, true)
strmgen world = link(heard, WorldObject, eventually[1s, oo] true, eventually[0, 1s] xy_dist[from, to] < thresh, true)
strmgen vehicles = link(world, Counted, eventually[1s, oo] true, eventually[0, 1s] xy_dist[from, to] < thresh, true)
strmgen convoys = composite(vehicles, always[0, 1s] xy_dist[from, to] < 30, always eventually[0, 2s] xy_dist[from, to] < 40)
stream there = world
stream together = convoys
"""


def test_two_sensors_a_unit_of_a_user_and_a_composite_on_one_platform(dyknow: Dyknow, tmp_path: Path) -> None:
    (units := tmp_path / "sensors.py").write_text(SENSORS, encoding="utf-8")
    (spec := tmp_path / "convoy.kpl").write_text(CONVOY, encoding="utf-8")
    platform = dyknow.start("join", "--unit", "7", "--spec", str(spec), "--units", str(units), "--json")
    next(line for line in lines(platform) if line.get("stream") == "together" and line["event"] == "sample")
    seen = dyknow.run("objects", "--type", "world", "--unit", "7")
    assert len(seen) == 2, "no vehicle has two symbols"
    (convoy,) = dyknow.run("objects", "--type", "convoys", "--unit", "7")
    history = dyknow.run("explain", convoy["symbol"], "--unit", "7")
    assert {each["event"] for each in history} == {"established"}
    assert all("xy_dist[from, to]" in each["because"] for each in history)
    followed = dyknow.start("events", "--follow", "--json")
    dyknow.run("delegate", "want", "symbol=guests", "type=convoys", "--to", "7", "description=count[guests] = 2")
    found = next(line for line in lines(followed) if (line["event"], line["to"]) == ("find", "guests"))
    assert "count[guests] = 2" in found["because"]
