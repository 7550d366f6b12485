"""Percepts from detections: one for what is found again, none for what is found once, a new one after a gap."""

import numpy as np
import pytest

from dyknow.anchoring.links.structures import Percept
from dyknow.anchoring.percepts.tracking import CONFIRMED, LOST_US, PerceptTracker
from dyknow.navigation.cameras.channels import GroundDetection

STEP_US = 40_000


def at(north_m: float, east_m: float, **attributes: str) -> GroundDetection:
    return GroundDetection(north_m, east_m, np.diag([0.5, 0.3]), np.diag([0.1, 0.1]), ("colour",), attributes)


def run(looks: list[list[GroundDetection]], tracker: PerceptTracker | None = None) -> list[list[Percept]]:
    tracker = tracker or PerceptTracker()
    return [tracker.on_detections(number * STEP_US, look) for number, look in enumerate(looks)]


def symbols(out: list[list[Percept]]) -> list[str]:
    return list(dict.fromkeys(percept.symbol for look in out for percept in look))


def test_what_is_found_again_where_it_was_expected_is_one_percept_at_its_period() -> None:
    out = run([[at(0.0, 0.4 * n, colour="red")] for n in range(100)])
    assert symbols(out) == ["vp1"]
    states = [percept.state for look in out for percept in look]
    assert len(states) == pytest.approx(39, abs=2)
    last = states[-1]
    assert last is not None
    assert (last.y_m, last.x_m) == pytest.approx((0.0, 0.4 * last.valid_us / STEP_US))
    assert last.covariance[0, 0] == 0.3
    assert last.covariance[1, 1] == 0.5
    assert last.attributes == {"colour": "red"}


def test_what_is_found_a_few_times_only_is_no_percept() -> None:
    rng = np.random.default_rng(1)
    out = run([[at(*rng.uniform(-60, 60, 2))] if n % 3 == 0 else [] for n in range(500)])
    assert not symbols(out)
    assert not symbols(run([[at(0.0, 0.0)]] * (CONFIRMED - 1) + [[]] * 50))


def test_a_short_gap_is_bridged_and_after_a_long_one_there_is_a_new_percept() -> None:
    def looks(gap_us: int) -> list[list[GroundDetection]]:
        gap = range(50, 50 + gap_us // STEP_US)
        return [[] if n in gap else [at(0.0, 0.4 * n)] for n in range(120)]

    assert symbols(run(looks(LOST_US - 2 * STEP_US))) == ["vp1"]
    out = run(looks(LOST_US + 2 * STEP_US))
    assert symbols(out) == ["vp1", "vp2"]
    assert [percept.symbol for look in out for percept in look if percept.state is None] == ["vp1"]


def test_two_that_pass_each_other_a_lane_apart_keep_their_symbols() -> None:
    out = run([[at(0.0, 0.4 * n - 20.0), at(3.5, 20.0 - 0.4 * n)] for n in range(100)])
    norths = {(p.symbol, p.state.y_m) for look in out for p in look if p.state is not None}
    assert norths == {("vp1", 0.0), ("vp2", 3.5)}


def test_the_order_of_detections_does_not_matter() -> None:
    looks = [[at(0.0, 0.4 * n), at(3.5, 0.4 * n), at(7.0, 0.4 * n)] for n in range(30)]
    forward, backward = run(looks), run([look[::-1] for look in looks])
    places = [
        [{(p.state.x_m, p.state.y_m) for p in look if p.state is not None} for look in out]
        for out in (forward, backward)
    ]
    assert places[0] == places[1]
    assert len(symbols(backward)) == 3


def test_far_away_where_detections_err_by_metres_along_the_ray_one_thing_is_one_percept() -> None:
    rng = np.random.default_rng(3)
    covariance, shares = np.diag([30.0, 4.0]), (0.9, 0.8)

    def seen(north_m: float, channel: str) -> GroundDetection:
        north, east = rng.multivariate_normal((north_m, 0.0), covariance)
        return GroundDetection(float(north), float(east), covariance, covariance / 2.0, (channel,), {})

    looks = [
        [seen(0.4 * n, channel) for channel, share in zip(("colour", "thermal"), shares, strict=True) if rng.random() < share][:1]
        for n in range(500)
    ]  # fmt: skip
    assert symbols(run(looks)) == ["vp1"]
