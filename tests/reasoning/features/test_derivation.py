import math

import pytest

from dyknow.model.errors import UnknownLabel
from dyknow.model.values import NO_VALUE
from dyknow.reasoning import FEATURES, Derivation, FeatureInput, needed_labels
from dyknow.reasoning.features.well_clear import Thresholds

HERE, THERE = (58.4, 15.67), (58.4009, 15.67)  # 100 m north
WORLD = {
    "heli-position[0]": HERE,
    "heli-position[1]": THERE,
    "heli-altitude[0]": (50.0,),
    "heli-altitude[1]": (57.0,),
    "heli-height[0]": (30.0,),
    "heli-height[1]": (33.0,),
    "heli-velocity[0]": (5.0, 0.0, 0.0),
    "heli-velocity[1]": (-5.0, 0.0, 0.0),
    "battery[0]": (0.8,),
    "heli-home[0]": THERE,
}


def derive(*labels, world=WORLD, **options):
    derivation = Derivation(labels, **options)
    return derivation.values([world.get(name, NO_VALUE) for name in derivation.input_names])


def test_a_derivation_names_the_inputs_its_states_must_bring():
    derivation = Derivation(["xy_dist[0, 1]", "z_dist[0, 1]"])
    assert derivation.inputs == (
        FeatureInput("heli-altitude", "0"),
        FeatureInput("heli-altitude", "1"),
        FeatureInput("heli-position", "0"),
        FeatureInput("heli-position", "1"),
    )
    assert str(derivation.inputs[0]) == "heli-altitude[0]"


def test_distances_are_metres():
    found = derive("xy_dist[0, 1]", "z_dist[0, 1]", "dist_3d[0, 1]")
    assert found["xy_dist[0, 1]"] == pytest.approx(100.25, abs=0.05)
    assert found["z_dist[0, 1]"] == 7.0
    assert found["dist_3d[0, 1]"] == pytest.approx(math.hypot(found["xy_dist[0, 1]"], 7.0))


def test_closest_approach_is_a_duration_and_two_distances():
    found = derive("cpa_time[0, 1]", "cpa_xy[0, 1]", "cpa_z[0, 1]")
    assert found["cpa_time[0, 1]"] == pytest.approx(10_025_000, abs=5_000)
    assert found["cpa_xy[0, 1]"] == pytest.approx(0.0, abs=1e-6)
    assert found["cpa_z[0, 1]"] == pytest.approx(7.0)


def test_pairs_look_the_same_from_both_sides():
    for name, feature in FEATURES.items():
        if feature.arity == 2:
            one, other = derive(f"{name}[0, 1]"), derive(f"{name}[1, 0]")
            assert one[f"{name}[0, 1]"] == pytest.approx(other[f"{name}[1, 0]"])


def test_closing_is_distance_times_closing_speed():
    found = derive("closing_xy[0, 1]", "hmd[0, 1]", "xy_dist[0, 1]")
    assert found["closing_xy[0, 1]"] == pytest.approx(10 * found["xy_dist[0, 1]"])
    assert found["hmd[0, 1]"] == pytest.approx(0.0, abs=1e-6)


def test_well_clear_is_one_or_zero_and_the_time_to_its_violation_a_duration():
    found = derive("well_clear[0, 1]", "time_to_violation[0, 1]")
    assert found["well_clear[0, 1]"] == 1.0
    assert found["time_to_violation[0, 1]"] == pytest.approx(3_794_000, abs=5_000)  # modified tau is 6 s then
    apart = {**WORLD, "heli-velocity[1]": (5.0, 0.0, 0.0)}
    assert derive("time_to_violation[0, 1]", world=apart)["time_to_violation[0, 1]"] == 180_000_000
    wide = derive("well_clear[0, 1]", "time_to_violation[0, 1]", volume=Thresholds(150.0, 8.0))
    assert wide == {"well_clear[0, 1]": 0.0, "time_to_violation[0, 1]": 0.0}
    lost = {**WORLD, "heli-velocity[1]": (math.nan, 0.0, 0.0)}
    assert derive("well_clear[0, 1]", world=lost) == {"well_clear[0, 1]": NO_VALUE}


def test_features_of_one_unit():
    found = derive("speed[0]", "altitude[0]", "height[0]", "battery[0]", "home_dist[0]")
    assert found["home_dist[0]"] == pytest.approx(100.25, abs=0.05)
    assert (found["speed[0]"], found["altitude[0]"], found["height[0]"], found["battery[0]"]) == (5.0, 50.0, 30.0, 0.8)


def test_a_simple_value_serves_as_well_as_a_record_of_one_field():
    assert derive("battery[0]", world={"battery[0]": 0.4}) == {"battery[0]": 0.4}


def test_heights_are_compared_only_when_asked():
    assert derive("z_dist[0, 1]", vertical="heli-height") == {"z_dist[0, 1]": 3.0}
    assert needed_labels(["z_dist"], "heli-height") == ("heli-height",)
    assert needed_labels(["xy_dist", "cpa_time"]) == ("heli-position", "heli-altitude", "heli-velocity")


@pytest.mark.parametrize("lost", sorted(WORLD))
def test_what_lacks_an_input_has_no_value_and_the_rest_has(lost):
    world = {name: value for name, value in WORLD.items() if name != lost}
    for name, feature in FEATURES.items():
        if name == "fence_margin":
            continue
        label = f"{name}[0, 1]" if feature.arity == 2 else f"{name}[0]"
        derivation = Derivation([label])
        inputs = [world.get(one, NO_VALUE) for one in derivation.input_names]
        needed = lost in derivation.input_names
        assert (derivation.values(inputs)[label] is NO_VALUE) == needed
        assert derivation.lacks(inputs) == ((lost,) if needed else ())


def test_a_result_that_is_not_finite_is_no_value():
    world = {**WORLD, "heli-altitude[0]": (math.nan,)}
    assert derive("z_dist[0, 1]", world=world) == {"z_dist[0, 1]": NO_VALUE}


def test_a_fence_is_part_of_the_derivation():
    fence = ((58.3, 15.6), (58.5, 15.6), (58.5, 15.8), (58.3, 15.8))
    assert derive("fence_margin[0]", fence=fence)["fence_margin[0]"] > 0
    assert derive("fence_margin[0]") == {"fence_margin[0]": NO_VALUE}


def test_a_feature_nobody_derives_is_named():
    for label in ("xy_dist[0]", "wind[0]"):
        with pytest.raises(UnknownLabel):
            Derivation([label])
