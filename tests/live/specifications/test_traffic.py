"""Traffic on links and passable routes on running platforms: exported by one, watched by a command, monitored by another."""

from pathlib import Path

import pytest

from tests.live.command_line.command import Dyknow, lines

pytestmark = pytest.mark.live
EXAMPLES = Path(__file__).parents[3] / "examples" / "traffic"
WATCHER = """\
import passable-routes from 7 as routes
monitor can_pass = always forall r in routes: passable[r]
"""


def test_routes_and_traffic_are_exported_watched_and_monitored_elsewhere(dyknow: Dyknow, tmp_path: Path) -> None:
    (watcher := tmp_path / "watcher.kpl").write_text(WATCHER, encoding="utf-8")
    spec, units, tracker = (str(EXAMPLES / name) for name in ("streets.kpl", "streets.py", "tracker.py"))
    platform = dyknow.start("join", "--unit", "7", "--spec", spec, "--units", units, "--units", tracker, "--json")
    specified = next(line for line in lines(platform) if line["event"] == "specified")
    assert sorted(specified["exports"]) == ["passable-routes", "traffic-on-links"]
    crane = next(
        line
        for line in lines(platform)
        if line.get("stream") == "way-crane" and line["event"] == "sample" and not line["value"][1]
    )
    assert "car1 stands on main at 150 m and leaves 3.5 m of 7 m, 6 m are needed" in crane["value"][-1]

    watched = dyknow.run("watch", "traffic-on-links", "--count", "3")
    assert {each["value"]["symbol"] for each in watched} <= {"main", "main-back"}
    assert any("car1 stands on main" in each["value"]["obstacles"] for each in watched)
    back = next(each["value"] for each in watched if each["value"]["symbol"] == "main-back")
    assert back["speed_m_s"] == pytest.approx(11.0, abs=0.5)
    assert back["flow"] == pytest.approx(back["speed_m_s"] * 3.6 * back["density"])

    other = dyknow.start(
        "join", "--unit", "8", "--spec", str(watcher), "--ontology", str(ontology_of(tmp_path)), "--json"
    )
    opened = next(line for line in lines(other) if line["event"] == "alarm-opened")
    assert opened["monitor"] == "can_pass"
    assert "'passable[crane]': False" in str(opened)


def ontology_of(folder: Path) -> Path:
    """The words that both platforms have."""
    (file := folder / "routes.toml").write_text(
        """\
[passable-routes]
sort = "route-state"
fields = { symbol = "text", passable = "bool", links = "text", length_m = "m", time_s = "s", because = "text" }
meaning = "the routes that are wanted, whether they can be passed, on which links, and why not"
""",
        encoding="utf-8",
    )
    return file
