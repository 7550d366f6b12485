"""Where a dropped box can lie: what has to hold of every such prior."""

from math import cos, nan, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow.model.errors import WrongCall
from dyknow.navigation.searching.landing import GROUNDS, Drop, landing
from tests.strategies import examples

speeds = st.floats(-12.0, 12.0)
grounds = st.sampled_from(sorted(GROUNDS))
places = st.floats(-500.0, 500.0)
drops = st.tuples(places, places, st.floats(0.0, 60.0), speeds, speeds, speeds, speeds).map(lambda each: Drop(*each))


@settings(max_examples=examples(60))
@given(drops, grounds)
def test_a_covariance_is_symmetric_and_no_less_certain_than_the_place_of_the_drop(drop: Drop, ground: str) -> None:
    prior = landing(drop, ground)
    assert np.allclose(prior.covariance, prior.covariance.T)
    assert np.linalg.eigvalsh(prior.covariance).min() >= drop.place_sd_m**2 - 1e-6


@settings(max_examples=examples(60))
@given(drops, st.floats(0.0, 6.28), grounds)
def test_a_turned_drop_has_a_turned_prior(drop: Drop, angle: float, ground: str) -> None:
    turn = np.array([[cos(angle), -sin(angle)], [sin(angle), cos(angle)]])
    pairs = ((drop.x_m, drop.y_m), (drop.vx_m_s, drop.vy_m_s), (drop.wind_x_m_s, drop.wind_y_m_s))
    (x, y), (vx, vy), (wx, wy) = ((turn @ np.array(pair)).tolist() for pair in pairs)
    turned = landing(Drop(x, y, drop.height_m, vx, vy, wx, wy), ground)
    prior = landing(drop, ground)
    assert np.allclose(turned.mean, turn @ prior.mean, atol=1e-6)
    # What is not known is carried through the fall along the axes, past the speed at which friction stops a box.
    shares = np.linalg.eigvals(np.linalg.solve(turned.covariance, turn @ prior.covariance @ turn.T)).real
    assert 0.4 <= shares.min() <= shares.max() <= 2.5


@settings(max_examples=examples(40))
@given(st.floats(1.0, 40.0), st.floats(0.5, 20.0))
def test_from_higher_it_is_less_certain_and_with_wind_it_goes_where_that_blows(height_m: float, more_m: float) -> None:
    low, high = (landing(Drop(0, 0, each, wind_x_m_s=3.0)) for each in (height_m, height_m + more_m))
    assert np.linalg.det(high.covariance) > np.linalg.det(low.covariance)
    assert high.mean[0] > low.mean[0] > 0.0
    assert abs(low.mean[1]) < 1e-9


def test_without_speed_and_wind_it_lies_below_and_with_speed_ahead() -> None:
    assert np.allclose(landing(Drop(3.0, 4.0, 7.0)).mean, [3.0, 4.0])
    ahead = landing(Drop(0.0, 0.0, 7.0, vx_m_s=8.0))
    assert 3.0 < ahead.mean[0] < 12.0
    assert ahead.covariance[0, 0] > ahead.covariance[1, 1]


@pytest.mark.parametrize(
    "drop",
    [
        Drop(nan, 0, 1),
        Drop(0, 0, -1),
        Drop(0, 0, 2000),
        Drop(0, 0, 1, vx_m_s=nan),
        Drop(0, 0, 1, 1e9),
        Drop(0, 0, 1, when_sd_s=-1),
    ],
)
def test_what_is_no_drop_is_refused(drop: Drop) -> None:
    with pytest.raises(WrongCall, match="is no drop"):
        landing(drop)


def test_an_unknown_ground_is_named_with_those_there_are() -> None:
    with pytest.raises(WrongCall, match=r"no ground 'lawn'; there are asphalt, grass, gravel"):
        landing(Drop(0, 0, 1), "lawn")
