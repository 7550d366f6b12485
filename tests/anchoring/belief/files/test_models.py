"""World models are read as they are written, or refused with everything that is wrong."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.anchoring.belief.environment import EnvironmentModel
from dyknow.anchoring.belief.files.models import read_world_model
from dyknow.model.errors import TextErrors

YARD = (Path(__file__).parents[4] / "examples" / "world" / "yard.toml").read_text(encoding="utf-8")

MODEL = """
reading = "share"
[region]
x_m = [0.0, 10.0]
y_m = [-5.0, 5.0]
[existence]
kept_per_s = 0.9
[thresholds]
create = 0.1
confirm = 0.8
delete = 0.05
[types.cup]
prior = 0.7
observed = [{attributes = ["colour", "position_m"], probability = 0.4}, {attributes = ["colour"], probability = 0.6}]
[types.plate]
prior = 0.3
observed = [{attributes = ["position_m"], probability = 1.0}]
[attributes.position_m]
motion = "velocity"
noise = 0.1
rate_sd = [2.0]
[attributes.size_cm]
mean = 10.0
sd = 4.0
create_sd = 1.0
drop_sd = 3.0
[attributes.colour]
values = ["red", "blue"]
prior = {red = 0.8, blue = 0.2}
ageing_s = 60.0
create = 0.9
drop = 0.6
[relations.on]
ageing_s = 30.0
[sensors.camera]
births = 0.2
clutter = 0.8
noise_sd = {position_m = [0.5, 1.0], size_cm = 2.0}
view_m = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
[sensors.camera.confusion.colour]
red = {red = 0.7, "dark red" = 0.3}
blue = {blue = 1.0}
[[initial]]
id = "i3"
existence = 0.9
type = {cup = 0.9}
attributes.position_m = {mean = [5.0, 1.0], sd = 0.5}
attributes.colour = {red = 1.0}
"""


def test_a_model_is_read_as_it_is_written() -> None:
    model = read_world_model(MODEL)
    place, size = model.gaussian
    assert model.reading == "share"
    assert np.exp(-1.0 / model.lifetime_s) == pytest.approx(0.9)
    assert (place.axes, place.order, place.volume) == (2, 2, 100.0)
    assert (size.axes, size.volume, size.create_sd) == (1, None, 1.0)
    assert model.types.probability(frozenset({"colour", "position_m"})) == pytest.approx([0.4, 1e-6])
    camera = model.sensors["camera"]
    assert np.diag(camera.noise["position_m"]) == pytest.approx([0.25, 1.0])
    assert camera.confusion["colour"].symbols == ("red", "dark red", "blue")
    assert camera.confusion["colour"].matrix == pytest.approx(np.array([[0.7, 0.3, 0.0], [0.0, 0.0, 1.0]]))
    cup = EnvironmentModel(model, 0).instance(0)
    assert cup.type == pytest.approx({"cup": 0.9, "plate": 0.1})
    assert cup.gaussian["position_m"].covariance == pytest.approx(np.diag([0.25, 0.25, 4.0, 4.0]))
    assert "size_cm" not in cup.gaussian


WRONG = [
    ("delete = 0.05", "delete = 0.85", "delete = 0.85 is not below confirm = 0.8", "confirm = 0.9 and delete = 0.05"),
    ("delete = 0.05", "delete = 0.2", "would be born dead", "create = 0.1"),
    ("confirm = 0.8", "confirm = 1.0", "no existence is certain", "confirm = 0.9"),
    ("births = 0.2", "births = 0.01", "no instance could ever be created", "create and delete below 0.01235"),
    ("existence = 0.9", "existence = 0.01", "it would be deleted at once", "existence = 0.9"),
    ("create = 0.9", "create = 0.75", "it would be created before anything is observed", "create = 0.9"),
    ("drop = 0.6", "drop = 0.45", "it would never be dropped", "no ageing_s"),
    ("drop = 0.6", "drop = 0.95", "it would come and go", "create = 0.8 and drop = 0.6"),
    ("drop_sd = 3.0", "drop_sd = 0.5", "it would come and go", "create_sd = 1.0"),
    ("create_sd = 1.0", "create_sd = 2.9\nx = 1", "unknown key", "leave it out"),
    ("sd = 4.0", "sd = 0.5", "it would be created before anything is observed", "create_sd = 0.25"),
    ("ageing_s = 30.0", "ageing_s = 30.0\ndrop = 0.4", "it would never be dropped", "no ageing_s"),
    ("ageing_s = 30.0", "right = 0.1\nwrong = 0.9", "would be no evidence", "right = 0.9"),
    ("prior = 0.7", "prior = 0.8", "priors of types sum to 1.1", "sum to 1"),
    ("probability = 0.6", "probability = 0.7", "sum to 1.1, more than 1", "sum to 1"),
    ("prior = {red = 0.8", "prior = {red = 0.9", "sum to 1.1", "sum to 1"),
    ("red = 0.7", "red = nan", "a number from 0 to 1 is expected, got NaN", "red = 0.5"),
    ("[existence]\n", "[existence]\nlifetime_s = 3.0\n", "say the same", "one of them"),
    ("births = 0.2", "births = 0.2\ndetects = 0.001", "would speak against existence", "detects = 0.9"),
    ("births = 0.2", "birth = 0.2", "Did you mean 'births'?", "leave it out"),
    ('reading = "share"', 'reading = "shares"', "one of event, share is expected, got \"shares\". Did you mean 'share'?", 'reading = "event"'),
    ("x_m = [0.0, 10.0]", "x_m = [10.0, 0.0]", "from a lower to a higher", "x_m ="),
    ("x_m = [0.0, 10.0]", "", "has no x_m", "x_m ="),
    ('motion = "velocity"', 'motion = "fast"', 'one of place, velocity, acceleration is expected, got "fast"', 'motion = "place"'),
    ("rate_sd = [2.0]", "", "needs rate_sd", "rate_sd = [10.0]"),
    ("view_m = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]", "view_m = [[0.0, 0.0]]", "at least three corners", "view_m ="),
    ("births = 0.2", f"births = 1{'0' * 400}", "a number from 0 to 1e+06 is expected, got 1000", "births = "),
    ("births = 0.2", f"births = 1{'0' * 5000}", "no TOML", "[region]"),
    ("births = 0.2", "births = 0.2\ntrust = 0.05", "as far as it is trusted", "create and delete below"),
    ("noise_sd = {position_m = [0.5, 1.0]", "noise_sd = {position_m = 0.0", "from 1e-06", "position_m = 0.5"),
    ("blue = {blue = 1.0}", "", "the value blue is missing", "blue = {"),
    ('id = "i3"', 'id = "new"', "is kept for associations", 'id = "i1"'),
    ("attributes.colour = {red = 1.0}", "attributes.colour = {green = 1.0}", "is no value of colour", "declared"),
    ("mean = [5.0, 1.0], sd = 0.5", "mean = [5.0, 1.0], sd = -1", "sd is from 1e-06", "sd = 1.0"),
    ("mean = [5.0, 1.0], sd = 0.5", "mean = [5.0, 1.0], covariance = [[1.0, 2.0], [2.0, 1.0]]", "positive definite", "sd"),
    ('attributes = ["colour"]', 'attributes = ["color"]', "there is no attribute color", "[attributes]"),
    ("[types.plate]", "[types.plate", "no TOML", "[region]"),
]  # fmt: skip


@pytest.mark.parametrize(("right", "wrong", "message", "remedy"), WRONG)
def test_what_cannot_be_is_refused_with_place_cause_and_remedy(
    right: str, wrong: str, message: str, remedy: str
) -> None:
    assert right in MODEL
    text = MODEL.replace(right, wrong, 1)
    with pytest.raises(TextErrors) as refused:
        read_world_model(text, "model.toml")
    found = [each for each in refused.value.errors if message in each.message]
    assert found, str(refused.value)
    assert remedy in found[0].repair
    assert str(found[0]).startswith(f"model.toml:{found[0].line}:")
    where = text.splitlines()[found[0].line - 1]
    if message == "no TOML":
        assert where.startswith(wrong[:20]), "the line that is none"
    else:
        assert found[0].line == 1 or found[0].message.split(":")[0].split(".")[-1] in where or where.startswith("[")


def test_all_errors_are_listed_in_the_order_of_the_text_and_twice_the_same_name_is_one() -> None:
    text = MODEL.replace("create = 0.1", "create = -1").replace("noise = 0.1", 'noise = "much"').replace("0.4}", "4}")
    text += '[[initial]]\nid = "i3"\nexistence = 0.5\n'
    with pytest.raises(TextErrors) as refused:
        read_world_model(text, "model.toml")
    lines = [each.line for each in refused.value.errors]
    assert lines == sorted(lines)
    assert len(lines) >= 4
    last = refused.value.errors[-1]
    assert "i3 is there twice" in last.message
    assert text.splitlines()[last.line - 1] == 'id = "i3"'
    assert last.line > text.count("\n") - 3


def test_a_model_without_anything_says_what_is_missing() -> None:
    with pytest.raises(TextErrors) as refused:
        read_world_model("", "model.toml")
    told = str(refused.value)
    assert all(each in told for each in ("no attributes", "no types", "no sensors"))
    with pytest.raises(TextErrors, match="finds anything new"):
        read_world_model(YARD.replace("births = 0.3", "births = 0.0"))


@given(
    st.integers(0, len(YARD) - 1),
    st.integers(0, 40),
    st.sampled_from(["", "=", "[", "nan", "-1", '"', "1e400", "\x00"]),
)
def test_any_damage_is_refused_as_an_error_of_the_text_or_read(start: int, length: int, by: str) -> None:
    text = YARD[:start] + by + YARD[start + length :]
    try:
        model = read_world_model(text, "yard.toml")
    except TextErrors as refused:
        assert all(each.line >= 1 and each.repair for each in refused.errors)
    else:
        EnvironmentModel(model, 0)


@pytest.mark.parametrize("text", ["a=" + "[" * 5000, "x" * 5_000_000, "types = 3", "types = []", "sensors = {a = 1}"])
def test_hostile_texts_are_refused(text: str) -> None:
    with pytest.raises(TextErrors):
        read_world_model(text)
