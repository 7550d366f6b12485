import json
from pathlib import Path

import pytest

from tests.console.conftest import Run

EXAMPLES = Path(__file__).parents[4] / "examples" / "world"
CALL = ("world", str(EXAMPLES / "yard.toml"), "--observations", str(EXAMPLES / "yard.jsonl"))


def test_each_update_is_a_line_with_associations_instances_and_events(dyknow: Run) -> None:
    done = dyknow(*CALL, "--json")
    assert (done.returncode, done.stderr) == (0, "")
    lines = [json.loads(each) for each in done.stdout.splitlines()]
    assert [each["t_ms"] for each in lines] == [0, 1000, 2000, 3000, 4000, 5000, 6000, 40000, 90000]
    for each in lines:
        for association in each.get("associations", [each["association"]] if "association" in each else []):
            assert sum(association.values()) == pytest.approx(1.0, abs=1e-4)
    assert lines[0]["association"] == {"new": 0.5, "clutter": 0.5}
    assert lines[0]["events"][0] == {"t_ms": 0, "event": "created", "id": "i1", "existence": 0.5}
    assert len(lines[5]["associations"]) == 2
    assert lines[5]["exact"] is True
    car, pedestrian = lines[6]["instances"]
    assert (car["id"], car["status"]) == ("i1", "confirmed")
    assert car["existence"] > 0.99
    assert car["type"]["car"] > 0.9
    assert car["attributes"]["position_m"]["mean"][0] == pytest.approx(22.1, abs=0.5)
    assert len(car["attributes"]["position_m"]["covariance"]) == 4
    assert car["attributes"]["colour"]["red"] > 0.9
    assert pedestrian["type"]["pedestrian"] > 0.8
    assert "colour" not in pedestrian["attributes"]
    assert lines[-1]["instances"] == []


def test_without_json_events_are_lines_and_what_is_believed_in_the_end_a_table(dyknow: Run, tmp_path: Path) -> None:
    short = tmp_path / "short.jsonl"
    short.write_text("".join(f"{line}\n" for line in (EXAMPLES / "yard.jsonl").read_text().splitlines()[:9]))
    done = dyknow(*CALL[:3], str(short))
    assert "i1  confirmed, existence 0.99" in done.stdout
    assert "position_m" in done.stdout
    assert "pedestrian" in done.stdout
    assert done.returncode == 0


def test_lines_that_are_left_out_are_named_and_counted_and_the_code_says_so(dyknow: Run, tmp_path: Path) -> None:
    file = tmp_path / "wrong.jsonl"
    file.write_text('{"t_ms": 0, "position_m": [1, 2]}\n' + '{"t_ms": 0, "position_m": [1, null]}\n' * 30)
    done = dyknow(*CALL[:3], str(file))
    assert done.returncode == 2
    assert f"{file}:2:1: position_m is 2 finite numbers" in done.stderr
    assert "left out: 10 more lines" in done.stderr


def test_a_model_with_impossible_thresholds_is_refused_with_its_line(dyknow: Run, tmp_path: Path) -> None:
    file = tmp_path / "model.toml"
    text = (EXAMPLES / "yard.toml").read_text().replace("births = 0.3", "births = 0.001")
    file.write_text(text)
    done = dyknow("world", str(file), *CALL[2:])
    assert done.returncode == 2
    line = text[: text.index("births")].count("\n") + 1
    assert f"{file}:{line}:1: sensors.camera.births: what it observes is new" in done.stderr
    assert "create and delete below" in done.stderr


def test_what_is_missing_is_said(dyknow: Run, tmp_path: Path) -> None:
    assert "--observations FILE.jsonl" in dyknow(*CALL[:2]).stderr
    assert dyknow("world", str(tmp_path / "gone.toml"), *CALL[2:]).returncode == 2
    assert dyknow(*CALL[:3], str(tmp_path / "gone.jsonl")).returncode == 2


def test_what_is_not_taken_as_it_comes_is_told(dyknow: Run, tmp_path: Path) -> None:
    model = tmp_path / "small.toml"
    model.write_text((EXAMPLES / "yard.toml").read_text() + "\n[limits]\ninstances = 2\n")
    file = tmp_path / "many.jsonl"
    file.write_text("".join(json.dumps({"t_ms": 0, "position_m": [5 * i, 0]}) + "\n" for i in range(-9, 9)))
    done = dyknow("world", str(model), "--observations", str(file))
    assert "not taken as it came: 1 limited" in done.stderr
    assert "there are 2 instances, as many as are allowed" in done.stdout
