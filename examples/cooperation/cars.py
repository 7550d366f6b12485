"""Two UAVs over one road that leads to the east: what `west` and `east` see of the cars on it, each under symbols of its own.

Every 15 s two cars come from the west. The one behind is 5 m/s faster, and overtakes the other where the area of `west` ends.
"""

from collections.abc import Iterator

import numpy as np

from dyknow import US_PER_S, Field, Sort, Value, source

BORDER_M, COMMON_M = 100.0, 6.0
FAST_M_S, SLOW_M_S, LEVEL_S, LANE_M = 20.0, 15.0, 7.0, 1.75
ROUND_US, LASTS_US, PERIOD_US = 15 * US_PER_S, 14 * US_PER_S, US_PER_S // 10
SD_M, SD_M_S = 0.4, 0.4
TRACKED_OBJECT = Sort(
    "tracked-object",
    (
        Field("symbol", "text"), Field("x_m", "m"), Field("y_m", "m"), Field("vx_m_s", "m/s"), Field("vy_m_s", "m/s"),
        Field("xx_m2", "m2"), Field("xy_m2", "m2"), Field("yy_m2", "m2"), Field("v_sd_m_s", "m/s"),
        Field("colour", "text"), Field("anchored", "bool"), Field("end", "bool"),
    ),
)  # fmt: skip

CAMERA_PERCEPT = Sort(
    "camera-percept",
    (
        Field("symbol", "text"), Field("x_m", "m"), Field("y_m", "m"), Field("sd_m", "m"), Field("colour", "text"),
        Field("end", "bool"),
    ),
)  # fmt: skip


def places(at_s: float) -> Iterator[tuple[str, float, float, float]]:
    """Colour, place and speed of both cars `at_s` seconds after the round began."""
    side_m = LANE_M if abs(at_s - LEVEL_S) < 3.0 else -LANE_M  # it overtakes on the left
    yield "red", BORDER_M + FAST_M_S * (at_s - LEVEL_S), side_m, FAST_M_S
    yield "blue", BORDER_M + SLOW_M_S * (at_s - LEVEL_S), -LANE_M, SLOW_M_S


def seen(from_us: int, letter: str, west_m: float, east_m: float) -> Iterator[tuple[int, Value]]:
    """The cars between two places, ten times a second."""
    rng = np.random.default_rng(len(letter))
    valid_us = -(-from_us // PERIOD_US) * PERIOD_US
    while True:
        number, within_us = divmod(valid_us, ROUND_US)
        for at, (colour, x_m, y_m, speed_m_s) in enumerate(places(within_us / US_PER_S)):
            if west_m <= x_m <= east_m and within_us < LASTS_US:
                dx, dy, dvx, dvy = rng.standard_normal(4).tolist()
                state = x_m + SD_M * dx, y_m + SD_M * dy, speed_m_s + SD_M_S * dvx, SD_M_S * dvy
                variance = SD_M * SD_M
                symbol = f"{letter}{number % 1000 * 2 + at}"
                yield valid_us, (symbol, *state, variance, 0.0, variance, SD_M_S, colour, True, False)
        valid_us += PERIOD_US


@source(TRACKED_OBJECT)
def west(from_us: int) -> Iterator[tuple[int, Value]]:
    """What the UAV in the west sees."""
    return seen(from_us, "w", BORDER_M - 250.0, BORDER_M + COMMON_M / 2)


@source(TRACKED_OBJECT)
def east(from_us: int) -> Iterator[tuple[int, Value]]:
    """What the UAV in the east sees."""
    return seen(from_us, "e", BORDER_M - COMMON_M / 2, BORDER_M + 250.0)


@source(CAMERA_PERCEPT)
def detected(from_us: int) -> Iterator[tuple[int, Value]]:
    """The same as it comes from detectors: places alone."""
    for valid_us, (symbol, x_m, y_m, *_) in seen(from_us, "p", BORDER_M - COMMON_M / 2, BORDER_M + 250.0):
        yield valid_us, (symbol, x_m, y_m, SD_M, "grey", False)
