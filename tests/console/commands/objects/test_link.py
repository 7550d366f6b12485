"""`dyknow link` over recorded percepts."""

import json
import sys
from pathlib import Path
from subprocess import PIPE, Popen
from typing import Any

import pytest

from tests.console.conftest import Run


def percept(t_ms: float, name: str, x_m: float, **more: Any) -> dict[str, Any]:
    return {"t_ms": t_ms, "percept": name, "type": "vision_percept", "x_m": x_m, "y_m": 0.0, "sd_m": 0.5, **more}


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A car at 10 m/s, seen for three seconds, hidden for two, and seen again under another name."""
    file = tmp_path / "percepts.jsonl"
    lines = [percept(t, f"vp{t // 5000 + 1}", t / 100) for t in range(0, 8000, 100) if t % 5000 < 3000]
    file.write_text("\n".join(map(json.dumps, lines)))
    return file


def test_one_car_has_one_symbol_through_a_gap_and_each_line_is_as_documented(dyknow: Run, recording: Path) -> None:
    done = dyknow("link", "--percepts", str(recording), "--json")
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    events = [(each["t_ms"], each["event"], each["from"], each["to"]) for each in lines if "event" in each]
    assert done.returncode == 0
    assert events[0] == (1000, "established", "vp1", "wo1")
    assert [each[1:] for each in events[1:]] == [("unlinked", "vp1", "wo1"), ("reestablished", "vp2", "wo1")]
    assert events[2][0] == 5000
    states = [each for each in lines if "symbol" in each]
    assert [each["t_ms"] for each in states] == [*range(0, 4200, 100), *range(5000, 8000, 100)]
    assert [each.pop("late_ms") for each in states[:10]] == list(range(1000, 0, -100))
    assert {each["symbol"] for each in states} == {"wo1"}
    assert set(states[0]) == {"t_ms", "symbol", "type", "x_m", "y_m", "linked_to", "hypotheses"}
    for each in states:
        assert each["x_m"] == pytest.approx(each["t_ms"] / 100, abs=0.5)
        assert each["hypotheses"][0]["weight"] == 1.0
    assert {tuple(each["linked_to"]) for each in states} == {("vp1",), (), ("vp2",)}
    assert all("because" in each for each in lines if "event" in each)


def test_as_text_there_are_the_events_and_a_table_of_objects(dyknow: Run, recording: Path) -> None:
    done = dyknow("link", "--percepts", str(recording))
    assert "vp2 -> wo1  reestablished: reestablish holds, eventually[0, 1s] xy_dist[from, to]" in done.stdout
    assert "wo1      world   0.0 .. 7.9   vp1 vp2   linked" in done.stdout


def test_lines_that_cannot_be_used_are_told_and_left_out(dyknow: Run, recording: Path) -> None:
    lines = recording.read_text().splitlines()
    lines[20:20] = [
        '{"t_ms": 1950, "percept": "vp1", "x_m": NaN, "y_m": 0}',
        "no json",
        json.dumps(percept(0, "vp1", 0.0)),
    ]
    recording.write_text("\n".join(lines))
    done = dyknow("link", "--percepts", str(recording), "--json")
    assert done.returncode == 2
    assert {each["symbol"] for each in map(json.loads, done.stdout.splitlines()) if "symbol" in each} == {"wo1"}
    for number, cause in ((21, "NaN is no value"), (22, "no JSON"), (23, "time goes backwards")):
        assert f"percepts.jsonl:{number}:" in done.stderr
        assert cause in done.stderr


def test_what_is_missing_or_cannot_be_read_is_said(dyknow: Run, tmp_path: Path) -> None:
    assert "--percepts FILE.jsonl" in dyknow("link").stderr
    gone = dyknow("link", "--percepts", str(tmp_path / "gone.jsonl"))
    assert gone.returncode == 2
    assert "cannot be read" in gone.stderr


def test_a_file_of_link_declarations_says_what_is_linked(dyknow: Run, recording: Path, tmp_path: Path) -> None:
    file = tmp_path / "cars.kpl"
    file.write_text(
        "source vision-object camera\ncompunit thing WorldObject(vision-object)\nstrmgen vision_percept = camera\n"
        "define NEAR_M = 12.0\nstrmgen thing = link(vision_percept, WorldObject, eventually [500, oo] true,\n"
        "    eventually [0, 1000] xy_dist[from, to] < NEAR_M, true)\n"
    )
    done = dyknow("link", str(file), "--percepts", str(recording), "--json")
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 0
    assert next(each["t_ms"] for each in lines if "event" in each) == 500
    assert {each["symbol"] for each in lines if "symbol" in each} == {"to1"}
    file.write_text(file.read_text().replace("link(vision_percept, WorldObject", "link(vision_percept, WorldObjects"))
    wrong = dyknow("link", str(file), "--percepts", str(recording))
    assert wrong.returncode == 2
    assert "cars.kpl:5:17" in wrong.stderr


def test_places_on_earth_are_left_out_where_roads_have_metres_and_no_place_on_earth(
    dyknow: Run, tmp_path: Path
) -> None:
    roads, percepts = tmp_path / "roads.geojson", tmp_path / "percepts.jsonl"
    line = {"type": "LineString", "coordinates": [[0, 0], [100, 0]]}
    feature = {"type": "Feature", "geometry": line, "properties": {"id": "r"}}
    roads.write_text(json.dumps({"type": "FeatureCollection", "frame": "local", "features": [feature]}))
    percepts.write_text(json.dumps({"t_ms": 0, "percept": "a", "latitude_deg": 58.4, "longitude_deg": 15.6}))
    done = dyknow("link", "--percepts", str(percepts), "--roads", str(roads))
    assert done.returncode == 2
    assert "positions of this file, or of its roads, are local" in done.stderr


def test_roads_with_a_place_on_earth_take_places_in_metres_too_but_not_both_in_one_file(
    dyknow: Run, tmp_path: Path, recording: Path
) -> None:
    roads = tmp_path / "roads.geojson"
    line = {"type": "LineString", "coordinates": [[-50, 0], [200, 0]]}
    feature = {"type": "Feature", "geometry": line, "properties": {"id": "r"}}
    network = {"type": "FeatureCollection", "frame": "local", "origin": [15.6, 58.4], "features": [feature]}
    roads.write_text(json.dumps(network))
    done = dyknow("link", "--percepts", str(recording), "--roads", str(roads), "--json")
    assert done.returncode == 0
    states = [json.loads(each) for each in done.stdout.splitlines() if "on_road" in each and "hypotheses" in each]
    assert states[0]["x_m"] == pytest.approx(states[0]["t_ms"] / 100, abs=0.5)
    with recording.open("a") as file:
        file.write("\n" + json.dumps({"t_ms": 9000, "percept": "b", "latitude_deg": 58.4, "longitude_deg": 15.6}))
    done = dyknow("link", "--percepts", str(recording), "--roads", str(roads))
    assert done.returncode == 2
    assert "are local" in done.stderr


def test_what_a_detector_pipes_in_is_linked_while_it_runs_and_a_line_that_is_too_long_spoils_no_other() -> None:
    command = [sys.executable, "-c", "from dyknow.console.main import app; app()", "link", "--percepts", "-", "--json"]
    with Popen(command, stdin=PIPE, stdout=PIPE, stderr=PIPE, bufsize=0) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stderr is not None
        for t_ms in range(0, 1100, 100):
            process.stdin.write(f"{json.dumps(percept(t_ms, 'vp1', t_ms / 100))}\n\n".encode())
        events = iter(process.stdout.readline, b"")
        lines = [json.loads(next(events)) for _ in range(11)]
        assert [each["t_ms"] for each in lines] == list(range(0, 1100, 100))
        assert lines[-1]["event"] == "established"
        process.stdin.write(b"x" * 2_500_000 + b"\n" + json.dumps(percept(1100, "vp1", 11.0)).encode())
        process.stdin.close()
        assert [json.loads(line)["t_ms"] for line in events] == [1000, 1100]
        said = process.stderr.read().decode()
    assert process.returncode == 2
    assert "standard input:23:1: the line is longer" in said
    assert said.count("left out") == 1


def test_objects_of_percepts_in_degrees_are_in_degrees_and_the_origin_of_metres_is_told(
    dyknow: Run, tmp_path: Path
) -> None:
    file = tmp_path / "percepts.jsonl"
    lines = [
        {"t_ms": t, "percept": 1, "latitude_deg": 58.4 + t * 1e-7, "longitude_deg": 15.6} for t in range(0, 1500, 100)
    ]
    file.write_text("\n".join(map(json.dumps, lines)))
    done = dyknow("link", "--percepts", str(file), "--json")
    state = json.loads(done.stdout.splitlines()[-1])
    assert "latitude 58.4000000, longitude 15.6000000" in done.stderr
    assert state["linked_to"] == ["1"]
    for each in (state, *state["hypotheses"]):
        assert each["latitude_deg"] == pytest.approx(58.4 + 1400 * 1e-7, abs=1e-5)
        assert each["longitude_deg"] == pytest.approx(15.6, abs=1e-5)
        assert each["y_m"] == pytest.approx((each["latitude_deg"] - 58.4) * 111_400, abs=0.1)


UNITS = """
from dyknow import Field, Sort, value_unit

CAR = Sort("car", (Field("symbol", "text"), Field("x_m", "m"), Field("y_m", "m")))


@value_unit(CAR, "world", name="Ahead")
def ahead(world):
    return "", world[1] + 1.0 / SHARE, world[2]
"""
AHEAD = """
strmgen world = link(vision_percept, WorldObject, eventually [1s, oo] true, eventually [0, 1s] xy_dist[from, to] < thresh, true)
strmgen cars = link(world, Ahead, true, eventually [0, 1s] xy_dist[from, to] < thresh, true)
"""


@pytest.mark.parametrize("share", ["0.1", "0.0"])
def test_links_take_units_of_modules_and_tell_what_they_raise(
    dyknow: Run, recording: Path, tmp_path: Path, share: str
) -> None:
    module, file = tmp_path / "ahead.py", tmp_path / "ahead.kpl"
    module.write_text(UNITS.replace("SHARE", share))
    file.write_text(AHEAD)
    done = dyknow("link", str(file), "--percepts", str(recording), "--units", str(module), "--json")
    states = [each for each in map(json.loads, done.stdout.splitlines()) if each.get("type") == "cars"]
    assert states
    if share == "0.1":
        assert done.returncode == 0
        seen = [each for each in states if each["t_ms"] < 3000]
        assert all(each["x_m"] == pytest.approx(each["t_ms"] / 100 + 10.0, abs=1.0) for each in seen)
    else:
        assert done.returncode == 2
        assert "Ahead has failed" in done.stderr
        assert "ahead.py:9" in done.stderr


@pytest.mark.parametrize(
    ("establish", "column", "said", "repair"),
    [
        ('eventually[1s, oo] colr[from] = "red"', 70, "no percept has colr; their attributes: colour", "colour[from]"),
        ("eventually[1s, oo] colour = 3", 70, "colour is no variable, constant, object or stream", ""),
        (
            "eventually[1s, oo] level > 5",
            70,
            "level is a stream, and there are recorded percepts only",
            "dyknow kpl run",
        ),
        ("eventually xy_dist[self, from] < 9", 62, "xy_dist[self, from] is a stream", "dyknow kpl run"),
        ("speed[to] > 5", 51, "a condition to establish is of `from` alone", "speed[from]"),
        ("forall o in nobody: speed[o] > 5", 63, "there is no domain nobody", ""),
    ],
)
def test_a_condition_that_can_have_no_value_is_told_with_its_place_and_the_reason(
    dyknow: Run, tmp_path: Path, establish: str, column: int, said: str, repair: str
) -> None:
    file, percepts = tmp_path / "cars.kpl", tmp_path / "percepts.jsonl"
    reestablish = "eventually[0, 1s] xy_dist[from, to] < 4"
    links = f"strmgen world = link(vision_percept, WorldObject, {establish}, {reestablish}, true)\n"
    file.write_text(f"source number levels\nstrmgen level = levels\n{links}", encoding="utf-8")
    percepts.write_text("\n".join(json.dumps(percept(t, "a", t / 100, colour="red")) for t in range(0, 3000, 100)))
    done = dyknow("link", str(file), "--percepts", str(percepts))
    assert done.returncode != 0
    assert f"{file}:3:{column}: {said}" in done.stderr.replace("\n", " ").replace("  ", " ")
    assert repair in done.stderr


def test_a_condition_over_the_other_objects_is_evaluated(dyknow: Run, tmp_path: Path) -> None:
    file, percepts = tmp_path / "lonely.kpl", tmp_path / "percepts.jsonl"
    alone = "eventually[1s, oo] forall o in vision_percept - {from}: xy_dist[o, from] > 5"
    file.write_text(f"strmgen world = link(vision_percept, WorldObject, {alone}, false, true)\n", encoding="utf-8")
    places = {"a": 0.0, "b": 3.0, "c": 40.0}
    seen = [percept(t, name, t / 100 + x_m) for t in range(0, 3000, 100) for name, x_m in places.items()]
    percepts.write_text("\n".join(map(json.dumps, seen)))
    done = dyknow("link", str(file), "--percepts", str(percepts), "--json")
    assert {each["from"] for each in map(json.loads, done.stdout.splitlines()) if "event" in each} == {"c"}
