import pytest

from dyknow.kpl import lint, parse_specification, read_formula
from tests.kpl.specifications import check_specification

NOISY = """source float speedometer
strmgen speed = speedometer
compunit float Smooth(float)
strmgen calm = Smooth(speed)
monitor slow = always {} <= 30
"""


def told(text):
    return [(one.message, one.repair) for one in lint(read_formula(text))]


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("always speed <= 30", "always eventually[0, 500ms] speed <= 30"),
        (
            "always forall u in uavs: speed[u] <= 30 or height[u] > 5",
            "always forall u in uavs: eventually[0, 500ms] (speed[u] <= 30 or height[u] > 5)",
        ),
    ],
)
def test_7_9_a_bare_always_over_a_measured_value_is_told_with_a_formula_that_one_wrong_sample_does_not_violate(
    text, meant
):
    ((message, repair),) = told(text)
    assert "one wrong sample of speed" in message
    assert repair == meant


@pytest.mark.parametrize(
    "text",
    [
        "always eventually[0, 500] speed <= 30",
        "always (speed > 30 -> eventually[0, 1000] always[0, 500] speed <= 30)",
        "always[0, 1000] speed <= 30",
        "always landed",
        "always mode = 3",
        "eventually (speed > 30 and landed)",
    ],
)
def test_what_is_robust_bounded_or_not_measured_is_left_alone(text):
    assert told(text) == []


def test_an_implication_under_eventually_or_exists_is_told():
    ((message, repair),) = told("eventually (airborne -> landed)")
    assert "left side" in message
    assert repair == "eventually (airborne and landed)"
    assert [repair for _, repair in told("exists u in uavs: airborne[u] -> landed[u]")] == [
        "exists u in uavs: airborne[u] and landed[u]"
    ]


@pytest.mark.parametrize(("feature", "warned"), [("speed", True), ("calm", False)])
def test_a_monitor_is_warned_of_what_comes_from_a_source_as_it_is_not_of_what_is_made_from_it(feature, warned):
    text = NOISY.format(feature)
    findings = check_specification(parse_specification(text), text=text)
    assert [one.line for one in findings.warnings if "wrong sample" in one.message] == ([5] if warned else [])


KINDS = """sort seen(symbol in text, x_m in m, y_m in m, length_m in m)
source seen camera
strmgen world = camera
strmgen car = link(world, SameState, always[0, 1s] length_m[from] < 7, {}, true) with exclusive kind
"""


@pytest.mark.parametrize(
    ("again", "repair"),
    [
        (
            "eventually[0, 1s] xy_dist[from, to] < 5",
            "(eventually[0, 1s] xy_dist[from, to] < 5) and always[0, 1s] length_m[from] < 7",
        ),
        ("eventually[0, 1s] (xy_dist[from, to] < 5 and length_m[from] < 7)", None),
    ],
)
def test_an_exclusive_link_that_would_be_back_at_once_is_warned_of(again, repair):
    def warned(reestablish):
        text = KINDS.format(reestablish)
        every = check_specification(parse_specification(text), text=text).warnings
        return [each.repair for each in every if "never begin" in each.message]

    assert warned(again) == ([] if repair is None else [repair])
    assert repair is None or warned(repair) == []
