"""What is seen of traffic: noise, cycles, clutter, rates, and the lines of JSON of it."""

import json
from collections import defaultdict
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from dyknow.anchoring.roads.files.formats import read_roads
from dyknow.model.errors import DyknowError
from dyknow.sim_uavs.roads.__main__ import main
from dyknow.sim_uavs.roads.percepts import PerceptSource, Seeing, SeenPercept
from dyknow.sim_uavs.roads.scenes import recorded


@pytest.mark.parametrize("name", ["one", "two", "clutter"])
def test_a_recording_is_that_of_its_seed(name: str) -> None:
    one, again, other = recorded(name, 3), recorded(name, 3), recorded(name, 4)
    assert one.looks == again.looks
    assert one.looks != other.looks
    assert read_roads(json.dumps(one.scene.roads)).links


@pytest.mark.parametrize(("name", "count"), [("one", 1), ("two", 2), ("six", 6), ("dense", 24)])
def test_a_scene_has_the_vehicles_it_is_named_after(name: str, count: int) -> None:
    assert max(len(look.truth) for look in recorded(name, 2).looks) == count


def test_the_car_of_figure_5_is_lost_twice_before_the_crossing_and_once_inside_it() -> None:
    for seed in range(10):
        looks = recorded("one", seed).looks
        hidden = [look.truth[0].crossing for look in looks if look.truth and not any(not p.end for p in look.percepts)]
        assert hidden[0] is None
        assert "x1" in hidden[-20:]
        assert len({percept.percept for look in looks for percept in look.percepts}) == 4


@pytest.mark.parametrize(("name", "sd_m"), [("one", 0.5), ("noise", 2.0), ("dense", 1.0)])
def test_the_error_of_positions_is_the_stated_one(name: str, sd_m: float) -> None:
    errors = []
    for seed in range(1 if name == "dense" else 5):
        for look in recorded(name, seed).looks:
            truth = {state.name: state for state in look.truth}
            errors += [(p.x_m - truth[p.of].x_m, p.y_m - truth[p.of].y_m) for p in look.percepts if p.of and not p.end]
            assert all(p.sd_m == sd_m for p in look.percepts)
    assert np.std(errors) == pytest.approx(sd_m, rel=0.1)
    assert np.mean(errors) == pytest.approx(0.0, abs=0.3 * sd_m)


@pytest.mark.parametrize(
    ("name", "seen_us", "hidden_us"), [("six", 3_000_000, 2_000_000), ("gaps", 3_000_000, 4_000_000)]
)
def test_each_is_seen_in_cycles_and_every_time_as_a_new_percept(name: str, seen_us: int, hidden_us: int) -> None:
    recording = recorded(name, 1)
    times: dict[str, list[int]] = defaultdict(list)
    ends: dict[str, int] = {}
    of: dict[str, str | None] = {}
    for look in recording.looks:
        for percept in look.percepts:
            of[percept.percept] = percept.of
            if percept.end:
                ends[percept.percept] = look.t_us
            else:
                times[percept.percept].append(look.t_us)
    by_car: dict[str | None, list[str]] = defaultdict(list)
    for percept in times:
        by_car[of[percept]].append(percept)
    for percepts in by_car.values():
        for percept, following in pairwise(percepts[1:]):
            assert ends[percept] - times[percept][0] == seen_us
            assert times[following][0] - ends[percept] == hidden_us


def test_clutter_lives_less_than_a_second_and_lies_where_the_roads_are() -> None:
    looks = recorded("clutter", 1).looks
    times: dict[str, list[int]] = defaultdict(list)
    for look in looks:
        for percept in look.percepts:
            if percept.of is None:
                times[percept.percept].append(look.t_us)
    assert 180 < len(times) < 300
    assert max(each[-1] - each[0] for each in times.values()) <= 900_000


def test_at_two_hertz_there_are_two_looks_a_second() -> None:
    looks = recorded("slow", 1).looks
    assert {b.t_us - a.t_us for a, b in pairwise(looks)} == {500_000}


def test_what_is_overlooked_leaves_its_percept_alive() -> None:
    truth = recorded("two", 1).looks[10].truth
    source = PerceptSource(Seeing(hidden_us=0, overlooked=0.3), (0.0, 0.0, 1.0, 1.0), np.random.default_rng(1))
    looks = [source.look(truth, tick * 100_000) for tick in range(500)]
    assert {percept.percept for look in looks for percept in look} == {"vp1", "vp2"}
    assert sum(map(len, looks)) == pytest.approx(700, abs=50)


def test_a_line_of_json_states_the_percept_and_never_the_truth() -> None:
    seen = SeenPercept(100_000, "vp1", "car7", 1.0, 2.0, 0.8, 9.0, 0.1, "red")
    assert seen.record() == {
        "t_ms": 100, "percept": "vp1", "type": "vision_percept", "x_m": 1.0, "y_m": 2.0, "sd_m": 0.8,
        "vx_m_s": 9.0, "vy_m_s": 0.1, "colour": "red",
    }  # fmt: skip
    end = seen._replace(end=True).record()
    assert end == {"t_ms": 100, "percept": "vp1", "type": "vision_percept", "end": True}


def test_a_scene_that_is_not_there_is_refused_with_those_that_are() -> None:
    with pytest.raises(DyknowError, match="no road scene is called 'fog'; there are one, noise, two"):
        recorded("fog", 1)


def test_a_scene_becomes_files_that_are_linked_by_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["roads", "two", "--seed", "2", "--out", str(tmp_path)])
    main()
    files = [Path(line) for line in capsys.readouterr().out.splitlines()]
    assert [file.name for file in files] == ["two.percepts.jsonl", "two.roads.geojson", "two.truth.jsonl"]
    percepts, roads, truth = (file.read_text() for file in files)
    assert [json.loads(line) for line in percepts.splitlines()] == list(recorded("two", 2).records())
    assert {json.loads(line)["vehicle"] for line in truth.splitlines()} == {"car1", "car2"}
    assert "middle" in read_roads(roads).crossings
