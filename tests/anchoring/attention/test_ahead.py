"""Top-down attention keeps track of cars better than a camera that looks down: one scene in five of the bench unless DYKNOW_FULL."""

import os

import pytest

from bench.attention.__main__ import AHEAD, row
from bench.attention.scenes import SCENES

FULL = bool(os.environ.get("DYKNOW_FULL"))


@pytest.mark.parametrize("name", [*SCENES] if FULL else ["low"])
def test_gaps_are_covered_and_cars_found_again_at_least_ten_points_more_often(name: str) -> None:
    found = row(name, 5 if FULL else 1)
    assert found.attention.gap >= found.down.gap + AHEAD
    assert found.attention.reacquired >= found.down.reacquired + AHEAD
    assert found.attention.known >= found.down.known + AHEAD
