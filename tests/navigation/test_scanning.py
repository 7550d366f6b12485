"""Lanes over an area bring all of it into view, and what was seen is shared as a text."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dyknow.navigation.scanning import SEEN_US, ScanGrid, lawn_mower, within

FIELD = np.array([(-145.0, 20.0), (145.0, 20.0), (145.0, 205.0), (-145.0, 205.0)])


def test_the_cells_are_those_inside_the_border():
    triangle = np.array([(0.0, 0.0), (100.0, 0.0), (0.0, 100.0)])
    cells = ScanGrid(triangle).cells
    assert 400 < len(cells) <= 1000
    assert (cells.sum(axis=1) < 100.0).all()


@given(st.floats(20.0, 80.0), st.floats(-300.0, 300.0))
def test_every_cell_is_near_a_lane_and_lanes_follow_the_longer_side(apart_m, start_m):
    cells = ScanGrid(FIELD).cells
    places = np.array(lawn_mower(cells, apart_m, (start_m, 0.0)))
    assert len(places) % 2 == 0
    lanes = places.reshape(-1, 2, 2)
    assert np.allclose(lanes[:, 0, 1], lanes[:, 1, 1])
    assert (np.abs(cells[:, 1:2] - lanes[None, :, 0, 1]).min(axis=1) <= apart_m / 2.0 + 1e-6).all()
    assert np.hypot(places[0, 0] - start_m, places[0, 1]) <= np.hypot(places[-1, 0] - start_m, places[-1, 1]) + 1e-6


def test_a_place_is_seen_after_five_seconds_in_view_and_gaps_are_none():
    grid, view = ScanGrid(FIELD), np.array([(-20.0, 50.0), (20.0, 50.0), (20.0, 90.0), (-20.0, 90.0)])
    for at_us in range(0, SEEN_US, 100_000):
        grid.look(at_us, view)
    assert not grid.seen.any()
    grid.look(SEEN_US + 10_000_000, view)
    assert not grid.seen.any()
    grid.look(SEEN_US + 10_100_000, view)
    assert (grid.seen == within(view, grid.cells)).all()
    assert grid.seen.any()


def test_what_was_seen_is_merged_and_a_text_of_another_area_changes_nothing():
    one, other = ScanGrid(FIELD), ScanGrid(FIELD)
    one.seen[:10], other.seen[5:20] = True, True
    assert one.merge(other.text())
    assert one.seen.sum() == 20
    for wrong in ("", "zz", "ff", other.text() + "ff", "\x00" * 40):
        assert not one.merge(wrong)
    assert one.seen.sum() == 20


def test_nothing_left_is_no_way_and_one_cell_is_one_place():
    assert lawn_mower(np.zeros((0, 2)), 40.0, (0.0, 0.0)) == []
    assert np.allclose(lawn_mower(np.array([(3.0, 4.0)]), 40.0, (0.0, 0.0)), (3.0, 4.0))
