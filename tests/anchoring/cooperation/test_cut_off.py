"""A platform is cut off for 5 to 40 s while it alone sees some cars: afterwards each is found again, and none is another."""

import os

import numpy as np
import pytest

from tests.anchoring.cooperation.skies import START_US, Sky

RUNS = 500 if os.environ.get("DYKNOW_FULL") else 20
HEALED_S = 2.0


class Circling:
    """Cars that circle at speeds of their own, about places that are near each other."""

    def __init__(self, rng: np.random.Generator, count: int, x_m: float) -> None:
        self._cars = [
            (
                x_m + rng.uniform(-40, 40),
                rng.uniform(-40, 40),
                rng.uniform(12, 30),
                rng.uniform(6, 12),
                rng.uniform(0, 6),
            )
            for _ in range(count)
        ]

    def at(self, t: float) -> dict[str, tuple[float, float, float, float]]:
        found = {}
        for number, (x_m, y_m, radius_m, speed_m_s, phase) in enumerate(self._cars):
            angle = phase + speed_m_s / radius_m * t
            east, north = np.cos(angle), np.sin(angle)
            place = x_m + radius_m * east, y_m + radius_m * north, -speed_m_s * north, speed_m_s * east
            found[f"car{number}"] = tuple(map(float, place))
        return found


@pytest.mark.parametrize("seed", range(RUNS))
def test_t40_an_object_of_a_platform_that_was_cut_off_is_found_again_within_two_seconds_and_is_no_other(seed) -> None:
    sky = Sky(seed=seed)
    alone, others = Circling(sky.rng, 4, 0.0), Circling(sky.rng, 3, 300.0)
    cut_s = float(sky.rng.uniform(5.0, 40.0 if seed % 5 == 0 else 15.0))

    def seen(t):
        return {"0": others.at(t), "1": alone.at(t)}

    sky.run(4.0, seen)
    names = {symbol: sky.name(symbol, "1") for symbol in alone.at(0.0)}
    assert len({*names.values()}) == 4
    sky.wire.cut("1", sky.now_us)
    sky.run(cut_s, seen)
    kept = {row.name: row for row in sky.pictures["0"].rows(sky.now_us)}
    assert all(kept[name].by == () for name in names.values())
    sky.wire.heal("1", sky.now_us)
    sky.run(HEALED_S, seen)
    truth = alone.at((sky.now_us - START_US) / 1e6)
    rows = {row.name: row for row in sky.pictures["0"].rows(sky.now_us)}
    for symbol, name in names.items():
        assert rows[name].by == ("1",)
        assert np.hypot(rows[name].state.x_m - truth[symbol][0], rows[name].state.y_m - truth[symbol][1]) < 5.0
    assert len(rows) == 7
