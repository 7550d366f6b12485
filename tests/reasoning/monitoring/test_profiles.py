import pytest

from dyknow.kpl import print_formula, profile_formula, read_formula, unit_vocabulary
from dyknow.model.errors import TextError
from dyknow.reasoning import (
    Derivation,
    Monitor,
    builtin_profiles,
    instantiate,
    parse_profiles,
    required_labels,
    split_growing,
)
from dyknow.reasoning.monitoring.profiles import AIRCRAFT

SEMANTICS = {
    "proximity": "always forall other in units - {self} growing: xy_dist[self, other] >= 15.0 or z_dist[self, other] >= 10.0",
    "proximity-warn": (
        "always forall other in units - {self} growing: "
        "not (cpa_time[self, other] <= 10s and cpa_xy[self, other] < 15.0 and cpa_z[self, other] < 10.0) "
        "and not (xy_dist[self, other] < 60.0 and z_dist[self, other] < 20.0)"
    ),
    "proximity-thesis": (
        "always forall other in units - {self} growing: xy_dist[self, other] >= 15.0 and z_dist[self, other] >= 10.0"
    ),
    "separation-20m": "always forall other in units - {self} growing: dist_3d[self, other] >= 20.0",
}


def pair_monitor(name):
    """The monitor of units 0 and 1, and the derivation that feeds it."""
    profile = builtin_profiles()[name]
    variable, _, body = split_growing(profile_formula(profile, "0"))
    formula = instantiate(body, variable, "1")
    derivation = Derivation(required_labels(formula), profile.vertical, volume=profile.volume)
    one = Monitor(name, formula, ("0", "1"), profile.sample_us, profile.max_delay_us, inputs=derivation.input_names)
    return one, derivation


def alarmed(name, *, north_m, up_m=0.0, closing_m_s=0.0):
    one, derivation = pair_monitor(name)
    world = {
        "heli-position[0]": (58.0, 15.0),
        "heli-position[1]": (58.0 + north_m / 111_376.5, 15.0),
        "heli-altitude[0]": (100.0,),
        "heli-altitude[1]": (100.0 + up_m,),
        "heli-velocity[0]": (closing_m_s, 0.0, 0.0),
        "heli-velocity[1]": (0.0, 0.0, 0.0),
    }
    values = derivation.values([world[each] for each in derivation.input_names])
    return bool(one.on_state(0, 0, values))


@pytest.mark.parametrize("name", sorted(SEMANTICS))
def test_the_proximity_profiles_are_the_agreed_formulas(name):
    profile = builtin_profiles()[name]
    assert profile_formula(profile, "3") == read_formula(SEMANTICS[name], unit_vocabulary("3"))


@pytest.mark.parametrize("name", sorted(builtin_profiles()))
def test_every_profile_reads_and_its_features_can_be_derived(name):
    profile = builtin_profiles()[name]
    formula = profile_formula(profile, "0")
    split = split_growing(formula)
    assert profile.pairwise == (split is not None)
    if split is not None:
        variable, domain, body = split
        assert print_formula(body).startswith("always ")
        assert (domain.base, domain.minus) in {("units", (("0",),)), (AIRCRAFT, ())}
        formula = instantiate(body, variable, "1")
    derivation = Derivation(required_labels(formula), profile.vertical, profile.fence)
    assert {one.label for one in derivation.inputs} == set(profile.labels)
    assert profile.meaning
    assert profile.sample_us > 0


@pytest.mark.parametrize(
    ("name", "situation", "expected"),
    [
        ("proximity", {"north_m": 14.0}, True),
        ("proximity", {"north_m": 16.0}, False),
        ("proximity", {"north_m": 14.0, "up_m": 11.0}, False),
        ("proximity-thesis", {"north_m": 500.0}, True),
        ("proximity-thesis", {"north_m": 500.0, "up_m": 11.0}, False),
        ("proximity-warn", {"north_m": 90.0, "closing_m_s": 10.0}, True),
        ("proximity-warn", {"north_m": 120.0, "closing_m_s": 10.0}, False),
        ("proximity-warn", {"north_m": 59.0}, True),
        ("proximity-warn", {"north_m": 59.0, "up_m": 21.0}, False),
        ("separation-20m", {"north_m": 15.0, "up_m": 12.0}, True),
        ("separation-20m", {"north_m": 15.0, "up_m": 14.0}, False),
        ("nmac", {"north_m": 150.0, "up_m": 30.0}, True),
        ("nmac", {"north_m": 153.0, "up_m": 30.0}, False),
        ("snmac", {"north_m": 15.0, "up_m": 5.0}, False),
        ("do365-en-route", {"north_m": 1_200.0}, True),
        ("do365-en-route", {"north_m": 1_300.0}, False),
        ("do365-en-route", {"north_m": 4_000.0, "closing_m_s": 110.0}, True),  # modified tau 33 s
        ("do365-en-route", {"north_m": 4_000.0, "closing_m_s": 100.0}, False),  # modified tau 36 s
        ("do365-en-route", {"north_m": 4_000.0, "closing_m_s": 110.0, "up_m": 140.0}, False),
        ("well-clear", {"north_m": 11.0}, True),
        ("well-clear", {"north_m": 13.0}, False),
        ("well-clear", {"north_m": 11.0, "up_m": 8.5}, False),
        ("well-clear", {"north_m": 62.0, "closing_m_s": 10.0}, True),  # modified tau 5.97 s
        ("well-clear", {"north_m": 63.0, "closing_m_s": 10.0}, False),  # modified tau 6.07 s
        ("well-clear", {"north_m": 40.0, "closing_m_s": -10.0}, False),
        ("well-clear-ahead", {"north_m": 360.0, "closing_m_s": 10.0}, True),  # in 29.8 s
        ("well-clear-ahead", {"north_m": 370.0, "closing_m_s": 10.0}, False),
        ("well-clear-crewed", {"north_m": 600.0, "up_m": 70.0}, True),
        ("well-clear-crewed", {"north_m": 600.0, "up_m": 80.0}, False),
        ("well-clear-crewed", {"north_m": 3_600.0, "closing_m_s": 51.0}, True),  # in 58.6 s
        ("well-clear-crewed", {"north_m": 3_600.0, "closing_m_s": 49.0}, False),
        ("ardupilot-avoidance", {"north_m": 600.0, "closing_m_s": 20.1}, True),
        ("ardupilot-avoidance", {"north_m": 600.0, "closing_m_s": 19.0}, False),
    ],
)
def test_a_profile_alarms_where_its_thresholds_say(name, situation, expected):
    assert alarmed(name, **situation) == expected


def energy(**world):
    profile = builtin_profiles()["energy"]
    formula = profile_formula(profile, "0")
    derivation = Derivation(required_labels(formula))
    values = derivation.values([world[one.label] for one in derivation.inputs])
    one = Monitor("energy", formula, ("0",), profile.sample_us, profile.max_delay_us)
    return bool(one.on_state(0, 0, values))


def test_energy_alarms_when_the_way_home_costs_more_than_the_charge_above_the_reserve():
    far = {"heli-position": (58.0, 15.0), "heli-home": (58.0359, 15.0), "heli-height": (60.0,)}  # 4 km
    # 250 W x (4000 m / 8 m/s + 60 m / 1.5 m/s) = 135 kJ, of 277 kJ that is 0.487 above the reserve of 0.2
    assert not energy(battery=(0.70,), **far)
    assert energy(battery=(0.67,), **far)
    assert not energy(battery=(0.67,), **far | {"heli-home": (58.001, 15.0)})


FENCE = """
[field]
formula = "always (fence_margin[self] >= MARGIN and height[self] <= 120)"
sample = "200ms"
max_delay = "1s"
thresholds = { margin = 10 }
fence = [[58.40, 15.60], [58.41, 15.60], [58.41, 15.62], [58.40, 15.62]]
close_after = 3
no_value = "skip"
"""


def test_a_person_can_define_a_profile():
    profile = parse_profiles(FENCE)["field"]
    assert profile.labels == ("heli-position", "heli-height")
    assert (profile.close_after, profile.no_value, profile.pairwise) == (3, "skip", False)
    formula = profile_formula(profile, "uav1")
    assert print_formula(formula) == "always (fence_margin[uav1] >= 10.0 and height[uav1] <= 120)"
    derivation = Derivation(required_labels(formula), fence=profile.fence)
    near = derivation.values(
        [{"heli-position": (58.405, 15.6001), "heli-height": 5.0}[one.label] for one in derivation.inputs]
    )
    assert 0 < near["fence_margin[uav1]"] < 10


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('sample = "200ms"\n', "", "sample is missing"),
        ('sample = "200ms"', 'sample = "soon"', "not a duration"),
        ("close_after = 3", "close_after = 0", "close_after: a whole number from 1 to 1000000 is expected, got 0"),
        ('no_value = "skip"', 'no_value = "maybe"', "no_value: one of"),
        ("close_after = 3", "colour = 3", "colour: unknown key"),
        ("margin = 10", "margin = [10]", "thresholds.margin: a number or a time"),
        (
            "[[58.40, 15.60], [58.41, 15.60], [58.41, 15.62], [58.40, 15.62]]",
            "[[1, 2], [3, 4]]",
            "three corners are expected, got 2",
        ),
        ("[[58.40, 15.60], [58.41, 15.60], [58.41, 15.62], [58.40, 15.62]]", "[1, 2, 3]", "list of corners"),
        ("[field]", "[field", "no TOML"),
        (
            "close_after = 3",
            'vertical = "depth"',
            'vertical: one of heli-altitude, heli-height is expected, got "depth"',
        ),
    ],
)
def test_a_profile_that_is_wrong_says_where(old, new, message):
    with pytest.raises(TextError, match=message.replace("[", r"\[")):
        parse_profiles(FENCE.replace(old, new), "mine.toml")


def test_the_volume_of_well_clear_is_made_of_thresholds_by_their_names():
    text = """
    [mine]
    formula = "always forall other in units - {self} growing: well_clear[self, other] = 1"
    sample = "100ms"
    max_delay = "500ms"
    thresholds = { DMOD = 30, TAUMOD_S = "4s" }
    """
    assert parse_profiles(text)["mine"].volume == (30.0, 8.0, 4.0, 6.0)
