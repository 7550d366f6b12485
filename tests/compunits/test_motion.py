"""Distances against the arc in the earth-centred frame, directions and rates against where things were put."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import NO_VALUE
from dyknow.compunits.motion import offset_m, turn_deg
from dyknow.navigation import LocalFrame, distance_m
from dyknow.navigation.geodesy import to_ecef
from tests.compunits.units import outputs, process, stream, value_of, values

LATITUDES, LONGITUDES = st.floats(-80, 80), st.floats(-180, 180)
ALTITUDES, OFFSETS = st.floats(-400, 9_000), st.floats(-3_000, 3_000)
PLACES = st.tuples(LATITUDES, LONGITUDES)
HERE = (58.4, 15.6)


def moved(place: tuple[float, float], north_m: float, east_m: float) -> tuple[float, float]:
    return LocalFrame(*place, 0.0).from_ned(north_m, east_m, 0.0)[:2]


@given(PLACES, OFFSETS, OFFSETS)
def test_distance_xy_is_the_distance_in_the_earth_centred_frame(place, north, east) -> None:
    there = moved(place, north, east)
    straight = math.dist(to_ecef(*place, 0.0), to_ecef(*there, 0.0))
    found = value_of("DistanceXY", place, there)
    assert found == distance_m(*place, *there)
    assert found == pytest.approx(straight, abs=0.01)
    assert value_of("DistanceXY", there, place) == pytest.approx(found, abs=1e-6)


@given(PLACES, OFFSETS, OFFSETS, ALTITUDES, ALTITUDES)
def test_distance_3d_is_made_of_xy_and_z(place, north, east, low, high) -> None:
    there = moved(place, north, east)
    xy, z = value_of("DistanceXY", place, there), value_of("DistanceZ", (low,), (high,))
    assert z == abs(low - high)
    assert value_of("Distance3D", place, (low,), there, (high,)) == pytest.approx(math.hypot(xy, z))


def test_a_simple_value_is_as_good_as_a_record_of_one_field() -> None:
    assert value_of("DistanceZ", 100.0, (130.0,)) == 30.0


@given(*[st.floats(-300, 300)] * 3)
def test_speeds_and_the_climb_rate_of_a_velocity(north, east, down) -> None:
    velocity = (north, east, down)
    assert value_of("GroundSpeed", velocity) == pytest.approx(math.sqrt(north**2 + east**2))
    assert value_of("Speed3D", velocity) == pytest.approx(math.sqrt(north**2 + east**2 + down**2))
    assert value_of("ClimbRate", velocity) == -down


@pytest.mark.parametrize(
    ("velocity", "heading"),
    [((1, 0, 0), 0), ((1, 1, 0), 45), ((0, 1, 9), 90), ((-1, 0, 0), 180), ((0, -1, 0), 270), ((5, -5e-20, 0), 0)],
)
def test_the_track_counts_clockwise_from_north(velocity, heading) -> None:
    found = value_of("Track", velocity)
    assert found == pytest.approx(heading)
    assert 0 <= found < 360


def test_what_stands_still_has_no_track_and_what_is_at_one_place_no_bearing() -> None:
    assert value_of("Track", (0.001, 0.001, 3.0)) is NO_VALUE
    assert value_of("Bearing", HERE, HERE) is NO_VALUE


def test_the_heading_is_the_yaw() -> None:
    assert value_of("Heading", (0.1, -0.2, -math.pi / 2)) == pytest.approx(270)
    assert value_of("Heading", (0.0, 0.0, -1e-18)) == 0


@given(PLACES, st.floats(-179, 180), st.floats(1, 3_000))
def test_the_bearing_is_where_the_other_was_put(place, heading, distance) -> None:
    north, east = distance * math.cos(math.radians(heading)), distance * math.sin(math.radians(heading))
    there = moved(place, north, east)
    assert turn_deg(heading, value_of("Bearing", place, there)) == pytest.approx(0, abs=1e-3)
    assert offset_m(place, there) == pytest.approx((north, east), abs=0.01)


@given(PLACES, st.floats(-50, 50), st.floats(-50, 50), st.lists(st.floats(0.05, 2.0), min_size=1, max_size=10))
def test_speed_est_tells_the_speed_of_steady_motion(place, north, east, steps) -> None:
    times = [sum(steps[:i]) for i in range(len(steps) + 1)]
    samples = stream(*[(t, moved(place, north * t, east * t)) for t in times])
    found = outputs("SpeedEst", samples)
    assert found[0] is None
    for made, sample in zip(found[1:], samples[1:], strict=True):
        assert made.valid_us == sample.valid_us
        assert made.value == pytest.approx(math.hypot(north, east), rel=1e-3, abs=1e-3)


@given(
    st.lists(st.tuples(st.integers(-1, 5), st.floats(-100, 100)), max_size=30),
    st.sampled_from([0, 1, 3, 10]),
)
def test_climb_est_compares_with_the_last_sample_that_is_old_enough(steps, tenths) -> None:
    """Slow transcription: among those taken, the last with t' <= t - seconds and t' < t."""
    at, readings = 0, []
    for step, altitude in steps:
        at += step
        readings.append((at / 10, altitude))
    samples = stream(*readings)
    found = outputs("ClimbEst", samples, seconds=tenths / 10)
    taken: list = []
    for made, sample in zip(found, samples, strict=True):
        if taken and sample.valid_us <= taken[-1].valid_us:
            assert made is None
            continue
        old = [s for s in taken if s.valid_us <= sample.valid_us - max(1, tenths * 100_000)]
        taken.append(sample)
        if not old:
            assert made is None
        else:
            seconds = (sample.valid_us - old[-1].valid_us) / 1e6
            assert made.value == pytest.approx((sample.value - old[-1].value) / seconds)


def test_a_longer_base_is_less_moved_by_noise() -> None:
    samples = stream(*[(t / 10, moved(HERE, t + (-1) ** t * 0.5, 0.0)) for t in range(40)])
    jumping = [v for v in values(outputs("SpeedEst", samples)) if v is not None]
    calm = [v for v in values(outputs("SpeedEst", samples, seconds=1.0)) if v is not None]
    assert max(jumping) - min(jumping) > 5
    assert max(calm) - min(calm) < 0.1
    assert calm == pytest.approx([10.0] * len(calm), abs=0.1)


def test_late_positions_and_those_that_are_none_do_not_disturb_the_speed() -> None:
    a, b = HERE, moved(HERE, 10, 0)
    samples = stream((0, a), (1, NO_VALUE), (1, (99.0, 0.0)), (2, b), (1, a), (2, b))
    found = values(outputs("SpeedEst", samples))
    assert found == [None, NO_VALUE, NO_VALUE, pytest.approx(5.0, rel=1e-3), None, None]


def test_track_est_tells_the_track_after_every_stretch_and_nothing_for_what_wavers() -> None:
    path = [(0, 0), (0.1, 0.1), (0.3, 0), (1, 0), (1.2, 0.1), (1, 1), (1, 1), (1, 3)]
    samples = stream(*[(t, moved(HERE, n, e)) for t, (n, e) in enumerate(path)])
    found = values(outputs("TrackEst", samples))
    assert [v is None for v in found] == [True, True, True, False, True, False, True, False]
    assert turn_deg(0, found[3]) == pytest.approx(0, abs=1e-3)
    assert found[5] == pytest.approx(90, abs=1e-3)
    assert found[7] == pytest.approx(90, abs=1e-3)


def test_each_process_has_a_memory_of_its_own() -> None:
    one, other = process("SpeedEst"), process("SpeedEst")
    first, second = stream((0, HERE), (1, moved(HERE, 10, 0)))
    assert one.on_sample(0, first, 0) is None
    assert other.on_sample(0, second, 0) is None


@pytest.mark.parametrize("seconds", [-1.0, float("nan"), float("inf"), True, "1"])
def test_a_base_that_is_no_time_is_refused(seconds) -> None:
    with pytest.raises(ValueError, match="seconds"):
        process("SpeedEst", seconds=seconds)
    with pytest.raises(ValueError, match="metres"):
        process("TrackEst", metres=0.0)
