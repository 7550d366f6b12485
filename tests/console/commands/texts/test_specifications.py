"""`dyknow kpl check` and `show`."""

import json
from pathlib import Path

import pytest

from tests.console.conftest import Run
from tests.docs.pages import ROOT

RIGHT = """\
source position gps   # a comment goes
strmgen pos[self] = gps
export heli-position = pos[self] with sample every 100ms
"""
WRONG = """\
source pos gps
strmgen pos[uav1] = gps
export heli-positon = pos[uav1]
stream a = pos[uav2]
"""


@pytest.fixture
def right(tmp_path: Path) -> str:
    return written(tmp_path, RIGHT)


def written(folder: Path, text: str) -> str:
    path = folder / "mission.kpl"
    path.write_text(text)
    return str(path)


def test_a_right_specification_is_done_and_shown_as_it_is_understood(dyknow: Run, right: str) -> None:
    checked, shown = dyknow("kpl", "check", right), dyknow("kpl", "show", right)
    assert (checked.returncode, shown.returncode) == (0, 0)
    assert checked.stdout.strip() == "3 declarations, 0 errors, 0 warnings"
    assert shown.stdout.splitlines() == [
        "source position gps",
        "strmgen pos[self] = gps",
        "export heli-position = pos[self] with sample every 100",
    ]


def test_what_is_shown_can_be_read_back_however_narrow_the_terminal(
    dyknow: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    name = "g" * 100
    text = f"source pos {name}\nstrmgen pos[self] = {name}\nstream s = pos[self] with sample every 100, max delay 200\n"
    assert dyknow("kpl", "show", written(tmp_path, text)).stdout == text


def test_every_error_is_told_with_place_and_repair(dyknow: Run, tmp_path: Path) -> None:
    path = written(tmp_path, WRONG)
    done = dyknow("kpl", "check", path, "--json")
    assert done.returncode == 1
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert [(one["line"], one["column"], one["repair"]) for one in found] == [
        (3, 1, "heli-position"),
        (4, 12, "pos[uav1]"),
    ]
    assert {(one["severity"], one["file"]) for one in found} == {("error", path)}
    drawn = dyknow("kpl", "check", path)
    assert drawn.returncode == 1
    assert "2 errors" in drawn.stdout


def test_what_leaves_the_grammar_is_told_for_each_statement(dyknow: Run, tmp_path: Path) -> None:
    path = written(tmp_path, "source pos\nstream a = b with from 3 until 5\nsource pos gps\n")
    done = dyknow("kpl", "check", path, "--json")
    assert done.returncode == 1
    assert [json.loads(line)["line"] for line in done.stdout.splitlines()] == [1, 2]
    shown = dyknow("kpl", "show", path)
    assert shown.returncode == 2
    assert "from 300 to 400" in shown.stderr


def test_what_nobody_reaches_is_a_warning_and_no_error(dyknow: Run, tmp_path: Path) -> None:
    done = dyknow("kpl", "check", written(tmp_path, "source pos gps\n"), "--json")
    assert done.returncode == 0
    assert json.loads(done.stdout)["severity"] == "warning"


@pytest.mark.parametrize("name", ["nothing.kpl", "."])
def test_a_file_that_cannot_be_read_is_a_wrong_call(dyknow: Run, tmp_path: Path, name: str) -> None:
    done = dyknow("kpl", "check", str(tmp_path / name))
    assert done.returncode == 2
    assert "cannot be read" in done.stderr


def test_a_file_that_is_no_text_or_far_too_long_is_a_wrong_call(dyknow: Run, tmp_path: Path) -> None:
    path = tmp_path / "mission.kpl"
    for content, said in ((b"\xff\xfe\x00", "cannot be read"), (b" " * (2 << 20), "longer than")):
        path.write_bytes(content)
        done = dyknow("kpl", "check", str(path))
        assert done.returncode == 2
        assert said in done.stderr


def test_a_unit_that_is_called_like_one_of_the_library_is_said_to_be_that_one(dyknow: Run, tmp_path: Path) -> None:
    text = (
        "source pos gps\ncompunit speed SpeedEst(pos, pos)\nstrmgen p = gps\nstream a = s\nstrmgen s = SpeedEst(p, p)\n"
    )
    spec, own = written(tmp_path, text), tmp_path / "own.py"
    checked = dyknow("kpl", "check", spec)
    assert checked.returncode == 1
    assert "SpeedEst is checked as the library's" in checked.stderr
    own.write_text(
        "from dyknow import computational_unit\n\n"
        '@computational_unit("speed", "pos", "pos")\nclass SpeedEst:\n    def __call__(self, now_us, one, other):\n        return 1.0\n'
    )
    checked = dyknow("kpl", "check", spec, "--units", str(own))
    assert (checked.returncode, checked.stderr) == (0, "")


def test_a_unit_nearly_called_like_one_that_is_offered_is_told_so(dyknow: Run, tmp_path: Path) -> None:
    spec = written(tmp_path, "source pos gps\nstrmgen p = gps\nstrmgen s = SpedEst(p)\n")
    assert "write: SpeedEst" in dyknow("kpl", "check", spec).stdout


def test_a_stream_of_the_platform_is_there_when_a_file_is_checked_and_roads_may_be_given(
    dyknow: Run, tmp_path: Path
) -> None:
    file = tmp_path / "cars.kpl"
    file.write_text(
        "compunit road-car OnRoad(camera-percept)\n"
        "strmgen cars = link(vision-percepts[self], OnRoad, on_road[from], xy_dist[from, to] < 5, true)\n"
        "stream seen = cars\nstream high = heli-height[self]\n"
    )
    without = dyknow("kpl", "check", str(file))
    assert without.returncode == 1
    assert "OnRoad needs roads" in without.stdout
    assert "1 error" in without.stdout
    done = dyknow("kpl", "check", str(file), "--roads", str(ROOT / "examples" / "roads" / "town.geojson"))
    assert done.returncode == 0, done.stdout
    assert "vision-percepts[self], heli-height[self]: of the platform" in done.stderr
