"""`dyknow roads check`, and roads of `dyknow link`."""

import json
from pathlib import Path

from tests.anchoring.roads.towns import NO_LINE, cross, crossing, link, text
from tests.console.conftest import Run


def test_a_network_is_summed_up_in_a_sentence(dyknow: Run, tmp_path: Path) -> None:
    file = tmp_path / "town.geojson"
    file.write_text(cross())
    done = dyknow("roads", "check", str(file))
    assert done.returncode == 0
    shown = " ".join(done.stdout.split())
    assert (
        "GeoJSON, 1 crossing, 4 links, 8 lanes, 0 areas, 0.8 km, 1 part, 4 dead ends, x and y in metres; recognised: "
        "16 turns (4 left, 4 right, 4 straight, 4 back), 4 forks, 8 ways, 4 links both ways; 0 errors, 0 warnings"
        in shown
    )


def test_a_map_on_which_no_turn_can_be_recognised_has_a_warning(dyknow: Run, tmp_path: Path) -> None:
    file = tmp_path / "town.geojson"
    file.write_text(text(crossing("x", 0.0, 0.0), link("l", None, "x", [(-99.0, 0.0), (0.0, 0.0)], oneway=True)))
    done = dyknow("roads", "check", str(file), "--json")
    assert done.returncode == 0
    remark, summary = map(json.loads, done.stdout.splitlines())
    assert (remark["severity"], summary["warnings"], summary["turns"]) == ("warning", 1, 0)
    assert "no turn can be recognised on it" in remark["message"]


def test_each_problem_is_a_line_with_the_feature_the_cause_and_the_remedy(dyknow: Run, tmp_path: Path) -> None:
    file = tmp_path / "town.geojson"
    file.write_text(text(crossing("x", 0.0, 0.0), NO_LINE))
    done = dyknow("roads", "check", str(file))
    assert done.returncode == 1
    shown = " ".join(done.stdout.split())
    assert "feature 1 ('zero'): its length is zero; a LineString has two different points" in shown
    assert "1 error, 0 warnings" in shown


def test_problems_beyond_those_listed_are_counted(dyknow: Run, tmp_path: Path) -> None:
    file = tmp_path / "town.geojson"
    file.write_text(text(*[NO_LINE] * 1005))
    done = dyknow("roads", "check", str(file), "--json")
    assert done.stdout.count('"severity"') == 1000
    assert "5 more problems are not listed" in done.stderr


def test_link_refuses_broken_roads_with_the_same_words(dyknow: Run, tmp_path: Path) -> None:
    file = tmp_path / "town.geojson"
    file.write_text(text(NO_LINE))
    done = dyknow("link", "--percepts", str(file), "--roads", str(file))
    assert done.returncode == 2
    assert "town.geojson: feature 0 ('zero'): its length is zero" in " ".join(done.stderr.split())
