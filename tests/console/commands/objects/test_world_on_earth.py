"""`dyknow world` with places on earth: an origin in the model, latitude and longitude in lines, and in what it brings."""

import json
import random
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.anchoring.belief.files.lines import ObservationReader
from dyknow.anchoring.belief.files.models import read_world_model
from dyknow.model.errors import TextErrors
from dyknow.navigation import LocalFrame
from tests.console.conftest import Run

ORIGIN = LocalFrame(47.4, 8.5, 430.0)
MODEL = """
[origin]
latitude_deg = 47.4
longitude_deg = 8.5
altitude_m = 430.0

[types.aircraft]

[region]
x_m = [-300000.0, 300000.0]
y_m = [-300000.0, 300000.0]

[attributes.position_m]
motion = "velocity"
rate_sd = [100.0]

[sensors.adsb]
detects = 0.9
births = 0.3
clutter = 0.01
noise_sd = { position_m = 30.0 }
"""
FLAT = MODEL
HIGH = MODEL + "\n[attributes.altitude_m]\nmean = [5000.0]\nsd = [5000.0]\n"
WITHOUT = FLAT[FLAT.index("[types") :]


def observed(model: str, *lines: object) -> tuple[list[list[float]], list[str]]:
    """Positions, and what is wrong with lines."""
    wrong: list[str] = []
    reader = ObservationReader("seen", read_world_model(model), lambda error: wrong.append(str(error)))
    looks = list(reader.looks(json.dumps(each) for each in lines))
    return [one.values["position_m"].tolist() for look in looks for one in look.observations], wrong


PLACES = st.tuples(st.floats(46.0, 49.0), st.floats(6.5, 10.5), st.floats(0.0, 12000.0))


def line_of(place: tuple[float, float, float], model: str) -> dict[str, float]:
    return dict(zip(("t_ms", "latitude_deg", "longitude_deg", "altitude_m")[: 3 + (model is HIGH)], (0, *place)))  # noqa: B905


@given(place=PLACES, model=st.sampled_from([FLAT, HIGH]))
def test_degrees_are_metres_about_the_origin(place: tuple[float, float, float], model: str) -> None:
    ((east_m, north_m),), wrong = observed(model, line_of(place, model))
    assert not wrong
    altitude_m = place[2] if model is HIGH else 430.0
    assert (north_m, east_m) == pytest.approx(ORIGIN.to_ned(*place[:2], altitude_m)[:2])


@pytest.mark.parametrize("seed", range(4))
def test_what_is_seen_in_degrees_is_believed_in_there(seed: int, dyknow: Run, tmp_path: Path) -> None:
    rng = random.Random(seed)
    place = rng.uniform(46.0, 49.0), rng.uniform(6.5, 10.5), rng.uniform(0.0, 12000.0)
    model = FLAT if seed % 2 else HIGH
    (tmp_path / "model.toml").write_text(model)
    (tmp_path / "seen.jsonl").write_text(json.dumps(line_of(place, model)) + "\n")
    done = dyknow("world", str(tmp_path / "model.toml"), "--observations", str(tmp_path / "seen.jsonl"), "--json")
    assert (done.returncode, done.stderr) == (0, "")
    (instance,) = json.loads(done.stdout)["instances"]
    found = instance["attributes"]["position_m"]
    assert (found["latitude_deg"], found["longitude_deg"]) == pytest.approx(place[:2], abs=2e-6)
    assert ("altitude_m" in instance["attributes"]) is (model is HIGH)


@pytest.mark.parametrize(
    ("model", "lines", "says"),
    [
        (WITHOUT, [{"latitude_deg": 47.5, "longitude_deg": 8.5}], "seen:1:1: the model does not say where on earth"),
        (FLAT, [{"latitude_deg": 47.5}], "seen:1:1: longitude_deg is missing"),
        (FLAT, [{"latitude_deg": 97.5, "longitude_deg": 8.5}], "seen:1:1: latitude_deg is a number within 90"),
        (FLAT, [{"latitude_deg": -47.5, "longitude_deg": 8.5}], "seen:1:1: more than 1000 km from the origin"),
        (
            FLAT,
            [{"latitude_deg": 47.5, "longitude_deg": 8.5, "altitude_m": 90.0}],
            "seen:1:1: the model has no attribute 'altitude_m'",
        ),
        (
            HIGH,
            [{"latitude_deg": 47.5, "longitude_deg": 8.5, "altitude_m": 1e6}],
            "seen:1:1: altitude_m is a number within 100000",
        ),
        (FLAT, [{"latitude_deg": 47.5, "longitude_deg": 8.5, "position_m": [1, 2]}], "are two positions"),
        (
            FLAT,
            [{"position_m": [1, 2]}, {"latitude_deg": 47.5, "longitude_deg": 8.5}],
            "seen:2:1: positions of this file are position_m",
        ),
        (
            FLAT,
            [{"latitude_deg": 47.5, "longitude_deg": 8.5}, {"position_m": [1, 2]}],
            "seen:2:1: positions of this file are latitude and longitude",
        ),
    ],
)
def test_what_is_missing_or_mixes_both_frames_is_refused_with_its_place(
    model: str, lines: list[dict[str, object]], says: str
) -> None:
    places, wrong = observed(model, *({"t_ms": 100 * n, **each} for n, each in enumerate(lines)))
    assert len(places) == len(lines) - 1
    assert len(wrong) == 1
    assert says in wrong[0]


@pytest.mark.parametrize("key", ["latitude_deg = 47.4", "longitude_deg = 8.5"])
def test_an_origin_has_both_degrees(key: str) -> None:
    with pytest.raises(TextErrors, match=r"origin: l\w+_deg is missing"):
        read_world_model(FLAT.replace(key + "\n", "", 1))
    with pytest.raises(TextErrors, match="unknown key"):
        read_world_model(FLAT.replace("altitude_m = 430.0", "hight_m = 430.0"))
