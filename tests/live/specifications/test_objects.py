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
