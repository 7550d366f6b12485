"""A search pattern covers what it should, and a search ends: found, or exhausted, never neither."""

from itertools import pairwise
from math import hypot, pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow.model.errors import WrongCall
from dyknow.navigation.searching.landing import Drop, Floats, LandingPrior, landing
from dyknow.navigation.searching.pattern import MOST_STOPS, expanding_square
from dyknow.navigation.searching.search import PlacedPercept, SightSearch
from tests.strategies import examples

deviations = st.floats(0.3, 25.0)


def prior(along_m: float, across_m: float, turned: float = 0.0) -> LandingPrior:
    axes = np.array([[np.cos(turned), -np.sin(turned)], [np.sin(turned), np.cos(turned)]])
    return LandingPrior(np.array([100.0, -50.0]), axes @ np.diag([along_m**2, across_m**2]) @ axes.T)


def square(at: Floats, half_m: float) -> Floats:
    return at + half_m * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


@settings(max_examples=examples(60))
@given(deviations, deviations, st.floats(0.0, pi), st.floats(4.0, 30.0), st.integers(0, 999))
def test_every_place_within_four_deviations_is_in_a_square_around_a_stop(
    along_m: float, across_m: float, turned: float, swath_m: float, seed: int
) -> None:
    where = prior(along_m, across_m, turned)
    stops = expanding_square(where, swath_m)
    if len(stops) == MOST_STOPS:
        return
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0.0, 2.0 * pi, 50)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1) * rng.uniform(0.0, 4.0, (50, 1))
    points = where.mean + ring @ np.linalg.cholesky(where.covariance).T
    _, axes = np.linalg.eigh(where.covariance)
    off = np.abs((points[:, None, :] - np.array(stops)[None]) @ axes).max(axis=2).min(axis=1)
    assert off.max() <= swath_m / 2.0 + 1e-6


@settings(max_examples=examples(40))
@given(deviations, deviations, st.floats(4.0, 30.0))
def test_it_begins_in_the_middle_goes_outwards_and_visits_no_place_twice(a: float, b: float, swath_m: float) -> None:
    where = prior(a, b)
    stops = expanding_square(where, swath_m)
    cells = [tuple(np.round((stop - where.mean) / swath_m).astype(int).tolist()) for stop in stops]
    assert cells[0] == (0, 0)
    assert len(set(cells)) == len(cells)
    rings = [max(map(abs, cell)) for cell in cells]
    assert all(later >= ring - 1 for ring, later in pairwise(rings))


def test_a_swath_of_nothing_is_refused() -> None:
    with pytest.raises(WrongCall, match="cannot expand"):
        expanding_square(prior(1, 1), 0.0)


def looked(search: SightSearch, percepts_at: object = None, most_s: float = 4000.0) -> float:
    """Look straight down from each place, ten times a second, as long as it wants; the seconds that took."""
    now_us = 1_000_000
    while (place := search.waypoint) is not None and now_us < most_s * 1e6:
        now_us += 100_000
        view_m = square(np.array([place.x_m, place.y_m]), 0.5 * 1.35 * place.height_m)
        percepts = percepts_at(view_m) if callable(percepts_at) else []
        search.on_look(now_us, view_m, percepts)
    return now_us / 1e6


def showing(x_m: float, y_m: float, colour: str, symbol: str = "vp1") -> object:
    def percepts(view_m: Floats) -> list[PlacedPercept]:
        low, high = view_m.min(axis=0), view_m.max(axis=0)
        inside = low[0] <= x_m <= high[0] and low[1] <= y_m <= high[1]
        return [PlacedPercept(symbol, x_m, y_m, 0.3, colour)] if inside else []

    return percepts


def test_what_lies_where_it_can_lie_is_found_with_its_place() -> None:
    search = SightSearch(landing(Drop(0, 0, 20, vx_m_s=6.0)), colour="red")
    looked(search, showing(8.0, 3.0, "red"))
    assert search.found is not None
    assert hypot(search.found.x_m - 8.0, search.found.y_m - 3.0) < 0.01
    assert not search.is_exhausted
    assert search.waypoint is None


@pytest.mark.parametrize(
    ("percepts", "known"),
    [
        (None, ()),
        (showing(2.0, 1.0, "blue"), ()),
        (showing(2.0, 1.0, "red"), ((2.3, 1.2),)),
        (showing(300.0, 1.0, "red"), ()),
    ],
)
def test_without_it_the_search_is_exhausted_and_says_how_much_it_saw(percepts: object, known: tuple) -> None:
    search = SightSearch(landing(Drop(0, 0, 20, vx_m_s=6.0)), known, "red")
    took_s = looked(search, percepts)
    assert search.is_exhausted
    assert search.found is None
    assert search.coverage > 0.99
    assert took_s < 300.0


def test_a_percept_that_is_seen_for_a_moment_only_or_is_no_number_is_not_the_box() -> None:
    search = SightSearch(landing(Drop(0, 0, 5)))
    for number in range(5):
        search.on_look(1_000_000 + number * 100_000, square(np.zeros(2), 8.0), [PlacedPercept("v", 0.5, 0.0, 0.1)])
    for number in range(40):
        nowhere = [PlacedPercept("w", float("nan"), 0.0, 0.1), PlacedPercept(f"f{number}", 0.5, 0.0, 0.1)]
        search.on_look(2_000_000 + number * 100_000, square(np.zeros(2), 8.0), nowhere)
    assert search.found is None


@settings(max_examples=examples(40))
@given(
    st.lists(
        st.tuples(
            st.integers(-5, 400_000), st.floats(allow_nan=True), st.floats(allow_nan=True), st.sampled_from("abc")
        ),
        max_size=60,
    )
)
def test_whatever_is_seen_the_search_goes_on_or_has_ended(looks: list) -> None:
    search, now_us = SightSearch(landing(Drop(0, 0, 10)), colour="red"), 0
    for after_us, x, y, symbol in looks:
        now_us += after_us
        search.on_look(now_us, square(np.zeros(2), 9.0), [PlacedPercept(symbol, x, y, 0.2, "red")])
        assert (search.found is not None) + search.is_exhausted + (search.waypoint is not None) == 1
