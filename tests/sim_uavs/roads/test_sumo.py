"""Floating car data of SUMO: where vehicles are, on which edge or in which junction, and what is no such data."""

import json
from math import pi
from pathlib import Path

import numpy as np
import pytest

from dyknow.model.errors import WrongCall
from dyknow.sim_uavs.roads.__main__ import main
from dyknow.sim_uavs.roads.percepts import PerceptSource, Seeing
from dyknow.sim_uavs.roads.sumo import floating_cars

TEXT = """<?xml version="1.0" encoding="UTF-8"?>
<fcd-export xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance">
    <timestep time="0.00"/>
    <timestep time="0.10">
        <vehicle id="v0" x="100.00" y="-1.60" angle="90.00" type="DEFAULT_VEHTYPE" speed="10.00" lane="-e1_0" slope="0.00"/>
        <vehicle id="v1" x="20.00" y="50.00" angle="180.00" type="my_truck" speed="0.00" lane=":J1_0_0" slope="0.00"/>
    </timestep>
</fcd-export>
"""


def test_the_middle_of_a_vehicle_lies_half_its_length_behind_its_bumper() -> None:
    (first_us, nothing), (then_us, (car, truck)) = floating_cars(TEXT)
    assert (first_us, nothing, then_us) == (0, [], 100_000)
    assert (car.name, car.kind, car.link, car.crossing, car.speed_m_s) == ("v0", "car", "-e1", None, 10.0)
    assert (car.x_m, car.y_m, car.heading_rad) == pytest.approx((97.75, -1.6, 0.0))
    assert (truck.name, truck.kind, truck.link, truck.crossing) == ("v1", "truck", None, "J1")
    assert (truck.x_m, truck.y_m, truck.heading_rad) == pytest.approx((20.0, 54.5, -pi / 2))


def test_what_sumo_drove_is_seen_like_traffic_of_our_own() -> None:
    source = PerceptSource(Seeing(hidden_us=0), (0.0, 0.0, 1.0, 1.0), np.random.default_rng(1))
    percepts = [percept for now_us, states in floating_cars(TEXT.encode()) for percept in source.look(states, now_us)]
    assert [(percept.percept, percept.of) for percept in percepts] == [("vp1", "v0"), ("vp2", "v1")]


def test_the_command_writes_percepts_and_truth_of_a_file_and_says_what_is_wrong_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "town.xml").write_text(TEXT)
    monkeypatch.setattr("sys.argv", ["roads", "--sumo", str(tmp_path / "town.xml"), "--out", str(tmp_path / "out")])
    assert main() == 0
    percepts, truth = (Path(line).read_text().splitlines() for line in capsys.readouterr().out.splitlines())
    assert [json.loads(line)["crossing"] for line in truth] == [None, "J1"]
    assert all(json.loads(line)["t_ms"] == 100 for line in percepts)
    (tmp_path / "town.xml").write_text("<net/>")
    with pytest.raises(SystemExit):
        main()
    assert "the root is <fcd-export>" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<net></net>", "the root is <fcd-export>"),
        ("<fcd-export><timestep", "no XML"),
        ("<!DOCTYPE a><fcd-export/>", "document type"),
        ('<fcd-export><timestep time="soon"/></fcd-export>', 'timestep has time="soon"'),
        ('<fcd-export><timestep time="nan"/></fcd-export>', 'timestep has time="nan"'),
        ('<fcd-export><timestep time="1"><vehicle id="v"/></timestep></fcd-export>', 'vehicle v has x=""'),
    ],
)
def test_what_is_no_floating_car_data_is_refused(text: str, message: str) -> None:
    with pytest.raises(WrongCall, match=message):
        list(floating_cars(text))
