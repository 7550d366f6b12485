"""Observations are read strictly; what is unusable is left out with its place, cause and remedy."""

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.anchoring.belief.description import RelationKind
from dyknow.anchoring.belief.environment import EnvironmentModel
from dyknow.anchoring.belief.files.lines import ObservationReader, SensorLook
from dyknow.anchoring.belief.observations import ReportedRelation
from dyknow.model.errors import TextError
from tests.anchoring.belief.worlds import sensor, world

MODEL = world(sensor(births=0.5, clutter=0.5), sensor("radar"), relations=(RelationKind("on"),), kept_per_s=0.9)


def read(*lines: Any) -> tuple[list[SensorLook], list[TextError]]:
    errors: list[TextError] = []
    texts = [each if isinstance(each, str) else json.dumps(each) for each in lines]
    return [*ObservationReader("seen.jsonl", MODEL, errors.append).looks(texts)], errors


def at(t_ms: float, **about: Any) -> dict[str, Any]:
    return {"t_ms": t_ms, "sensor": "camera", "position_m": [1.0, 2.0], **about}


def test_lines_of_one_time_and_sensor_are_one_look() -> None:
    looks, errors = read(
        at(0), at(100, colour="red"), at(100, sensor="radar"), at(100, position_m=[3, 4]),
        {"t_ms": 200, "sensor": "camera", "nothing": True},
        {"t_ms": 300, "sensor": "camera", "type": "car", "relations": {"on": {"i2": True, "i3": False}}},
    )  # fmt: skip
    assert errors == []
    assert [(each.valid_us, each.sensor, len(each.observations)) for each in looks] == [
        (0, "camera", 1), (100_000, "camera", 2), (100_000, "radar", 1), (200_000, "camera", 0), (300_000, "camera", 1)
    ]  # fmt: skip
    assert looks[-1].observations[0].relations == (
        ReportedRelation("on", "i2"),
        ReportedRelation("on", "i3", holds=False),
    )
    assert looks[1].observations[1].values["position_m"] == pytest.approx([3.0, 4.0])


WRONG = [
    ('{"t_ms": 1, "sensor": "camera", "position_m": [NaN, 1]}', "NaN is no value", "t_ms"),
    ('{"t_ms": 1, "sensor": "camera", "position_m": [1e999, 1]}', "2 finite numbers", "position_m"),
    (at(1, position_m=[1.0, 1e12]), "at most 1e+07", "position_m"),
    (at(1, position_m=[1.0]), "2 finite numbers", "position_m"),
    (at(1, position_m=[True, False]), "2 finite numbers", "position_m"),
    (at(1, position_m="here"), "2 finite numbers", "position_m"),
    (at(1, covariance_m2=[[1.0, 0.0], [0.0, -1.0]]), "positive definite", "covariance_m2"),
    (at(1, covariance_m2=[[1.0, 0.5], [0.0, 1.0]]), "symmetric", "covariance_m2"),
    (at(1, covariance_m2=[[1e11, 0.0], [0.0, 1e-11]]), "positive definite", "covariance_m2"),
    (at(1, covariance_m2=[[1.0]]), "2 rows of 2", "covariance_m2"),
    ({"t_ms": 1, "sensor": "camera", "colour": "red", "covariance_m2": [[1, 0], [0, 1]]}, "is of position_m", "t_ms"),
    (at(1, colour="rad"), "Did you mean 'red'?", "colour"),
    (at(1, colour=["red"]), "reports no colour", "colour"),
    (at(1, type="house"), "reports no type", "type"),
    (at(1, color="red"), "Did you mean 'colour'?", "attributes"),
    (at(1, sensor="camra"), "Did you mean 'camera'?", "sensor"),
    (at(1, sensor=None), "has no sensor", "sensor"),
    (at(1, nothing=True), "nothing was seen", "nothing"),
    ({"t_ms": 1, "sensor": "camera"}, "nothing is observed", "position_m"),
    ({"t_ms": 1, "position_m": [1, 2]}, "has no sensor", "sensor"),
    (at(1, relations={"under": {"i1": True}}), "no relation 'under'", "relations"),
    (at(1, relations={"on": "i1"}), "true or false", "relations"),
    (at(1, relations={"on": {"i1": 0.5}}), "true or false", "relations"),
    (at(1, relations={"on": {f"i{i}": True for i in range(100)}}), "at most 64", "relations"),
    (at(True), "has a time", "t_ms"),
    (at(1e300), "has a time", "t_ms"),
    ("[1, 2]", "JSON object", "t_ms"),
    ("{", "no JSON", "t_ms"),
    ("[" * 100_000, "no JSON", "t_ms"),
]  # fmt: skip


@pytest.mark.parametrize(("line", "message", "remedy"), WRONG)
def test_a_line_that_cannot_be_used_is_left_out_with_place_cause_and_remedy(
    line: Any, message: str, remedy: str
) -> None:
    looks, errors = read(at(0), line, at(2))
    assert [each.valid_us for each in looks] == [0, 2000]
    assert len(errors) == 1
    assert message in errors[0].message
    assert remedy in errors[0].repair
    assert str(errors[0]).startswith("seen.jsonl:2:")


def test_time_that_goes_backwards_is_left_out_and_one_line_far_ahead_does_not_lose_the_others() -> None:
    looks, errors = read(at(0), at(1000), at(900), at(1100))
    assert [each.valid_us for each in looks] == [0, 1_000_000, 1_100_000]
    assert ["backwards" in each.message for each in errors] == [True]
    looks, errors = read(at(0), at(1000), at(9_000_000), at(1100), at(1200))
    assert [each.valid_us for each in looks] == [0, 1_000_000, 1_100_000, 1_200_000]
    assert ["8998.9 s ahead" in each.message for each in errors] == [True]


def test_an_observation_that_calls_itself_exact_to_less_than_a_micrometre_is_left_out() -> None:
    looks, errors = read(
        at(0, covariance_m2=[[1e-20, 0.0], [0.0, 1e-20]]), at(1, covariance_m2=[[1e-12, 0], [0, 1e-12]])
    )
    assert [each.line for each in errors] == [1]
    assert len(looks) == 1


@given(
    st.lists(
        st.text(max_size=60)
        | st.fixed_dictionaries(
            {"t_ms": st.floats() | st.integers(0, 5000)},
            optional={
                "sensor": st.sampled_from(["camera", "radar", "x", 3]),
                "position_m": st.lists(st.floats() | st.integers(-50, 50), max_size=3),
                "covariance_m2": st.lists(st.lists(st.floats(-10, 10), min_size=2, max_size=2), min_size=2, max_size=2),
                "colour": st.sampled_from(["red", "blue", "mauve", None]),
                "relations": st.dictionaries(st.sampled_from(["on", "in"]), st.dictionaries(st.text(max_size=3), st.booleans())),
                "nothing": st.booleans(),
            },
        ).map(json.dumps),
        max_size=12,
    )
)  # fmt: skip
def test_whatever_the_lines_are_beliefs_stay_beliefs_and_each_line_counts_or_is_reported(lines: list[str]) -> None:
    looks, errors = read(*lines)
    environment = EnvironmentModel(MODEL)
    for look in looks:
        environment.on_look(*look)
    table = environment.table
    assert ((table.existence > 0.0) & (table.existence <= 1.0)).all()
    assert np.isfinite(table.gaussian["position_m"].mean).all()
    assert [each.valid_us for each in looks] == sorted(each.valid_us for each in looks)
    assert len(errors) <= len([each for each in lines if each.strip()]) + len(lines)


def test_a_time_alone_lets_time_pass_without_a_look() -> None:
    looks, errors = read({"t_ms": 0}, at(100), {"t_ms": 10_000})
    assert not errors
    assert looks == [(0, "", []), looks[1], (10_000_000, "", [])]
    wrong = read(at(100), {"t_ms": 50}, {"t_ms": 200, "sensor": "camera"})[1]
    assert [each.line for each in wrong] == [2, 3]
