import json
from pathlib import Path

import pytest

from tests.console.conftest import Run

EXAMPLES = Path(__file__).parents[4] / "examples" / "world"
CALL = ("world", str(EXAMPLES / "yard.toml"), "--observations", str(EXAMPLES / "left.jsonl"))


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


def test_without_json_events_are_lines_and_what_is_believed_in_the_end_a_table(dyknow: Run) -> None:
    done = dyknow(*CALL[:3], str(EXAMPLES / "yard.jsonl"))
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


def test_prior_knowledge_is_loaded_for_a_task_completes_repairs_and_is_learnt_back(dyknow: Run, tmp_path: Path) -> None:
    knowledge, learnt = EXAMPLES / "knowledge.toml", tmp_path / "learnt.toml"
    done = dyknow(*CALL, "--knowledge", str(knowledge), "--learn", str(learnt), "--json")
    assert (done.returncode, done.stderr) == (0, "loaded yard\n")
    lines = [json.loads(each) for each in done.stdout.splitlines()]
    events = [(each["event"], each.get("what")) for line in lines for each in line["events"]]
    assert ("matched", "car-of-anna") in events
    assert ("repaired", "colour") in events
    assert lines[1]["instances"][0]["known"] == "car-of-anna"
    asked = [each for line in lines for each in line["requests"]]
    assert {each["what"] for each in asked} == {"existence"}
    assert asked[0]["sensor"] == "camera"
    assert 'id = "car-of-anna"' in learnt.read_text()
    again = dyknow(*CALL, "--knowledge", str(learnt))
    assert "matched car-of-anna" in again.stdout
    again = dyknow(*CALL, "--knowledge", str(knowledge), "--knowledge", str(learnt))
    assert again.returncode == 2
    assert "car-of-anna is in yard and in" in again.stderr


def test_knowledge_that_no_task_needs_is_not_loaded_and_a_wrong_file_is_refused(dyknow: Run, tmp_path: Path) -> None:
    text = (EXAMPLES / "knowledge.toml").read_text()
    file = tmp_path / "knowledge.toml"
    file.write_text(text.replace('name = "yard"', 'name = "yard"\ntasks = ["parking"]'))
    done = dyknow(*CALL, "--knowledge", str(file), "--task", "watching")
    assert "nothing is loaded" in done.stderr
    assert "matched" not in done.stdout
    file.write_text(text.replace('is_a = "vehicle"', 'is_a = "vehicles"'))
    done = dyknow(*CALL, "--knowledge", str(file))
    assert done.returncode == 2
    assert f"{file}:8:1: classes.car.is_a: there is no class vehicles" in done.stderr
    done = dyknow(*CALL, "--learn", str(tmp_path / "no" / "learnt.toml"))
    assert "--learn" in done.stderr
