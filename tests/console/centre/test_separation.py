import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.console.centre.separation import ALTITUDE, POSITION, Separation
from dyknow.navigation.geodesy import LocalFrame

FRAME = LocalFrame(55.7, 13.5, 0.0)
OFFSETS = st.floats(min_value=-500, max_value=500)


def _say(apart: Separation, unit: str, valid_us: int, north_m: float, east_m: float, altitude_m: float) -> None:
    latitude, longitude, _ = FRAME.from_ned(north_m, east_m, 0.0)
    apart.on_sample(unit, POSITION, valid_us, (latitude, longitude))
    apart.on_sample(unit, ALTITUDE, valid_us, (altitude_m,))


@given(OFFSETS, OFFSETS, OFFSETS)
def test_it_is_the_distance_in_three_dimensions(north_m: float, east_m: float, up_m: float) -> None:
    apart = Separation(("0", "1"))
    _say(apart, "0", 100, 0.0, 0.0, 50.0)
    _say(apart, "1", 100, north_m, east_m, 50.0 + up_m)
    assert apart.latest_m == pytest.approx((north_m**2 + east_m**2 + up_m**2) ** 0.5, abs=0.2)


def test_the_smallest_is_kept_and_late_samples_count() -> None:
    apart = Separation(("0", "1"))
    for valid_us, away_m in ((100, 50.0), (200, 12.0), (300, 40.0)):
        _say(apart, "0", valid_us, 0.0, 0.0, 50.0)
        if valid_us != 200:
            _say(apart, "1", valid_us, away_m, 0.0, 50.0)
    assert apart.smallest_m == pytest.approx(40.0, abs=0.1)
    _say(apart, "1", 200, 12.0, 0.0, 50.0)
    assert apart.smallest_m == pytest.approx(12.0, abs=0.1)
    assert apart.latest_m == pytest.approx(40.0, abs=0.1), "what came late is not the latest"


def test_others_and_half_a_state_say_nothing() -> None:
    apart = Separation(("0", "1"))
    _say(apart, "2", 100, 0.0, 0.0, 50.0)
    _say(apart, "0", 100, 0.0, 0.0, 50.0)
    assert apart.latest_m is None
