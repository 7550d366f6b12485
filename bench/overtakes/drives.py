"""Cars on a straight road, as drives from seeds, and where a camera sees them.

A drive is where a car is at some times, linear in between: metres along the road, and to the right of its middle. Cars
drive on the right. All cars of a run are seen from its beginning to its end.
"""

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

LANE_M = 1.75
SHOULDER_M = 5.25

Floats: TypeAlias = NDArray[np.float64]


class Drive(NamedTuple):
    """Times (s), metres along the road and metres to the right of its middle."""

    at_s: Sequence[float]
    along_m: Sequence[float]
    right_m: Sequence[float]


class Run(NamedTuple):
    """What happens in one run.

    Attributes:
        drives: of each car.
        last_s: how long it is.
        level_s: when car a is level with car b.
    """

    drives: Mapping[str, Drive]
    last_s: float
    level_s: float


class Seen(NamedTuple):
    """The positions of each car, (n, 2), x east and y north in metres, at n valid times, on a road in one direction.

    Attributes:
        links: of each car, where all are not on one link.
    """

    at_us: list[int]
    places: Mapping[str, Floats]
    road_deg: float
    links: Mapping[str, Sequence[str]] = MappingProxyType({})


def seen(run: Run, period_ms: int, most_m: float, rng: np.random.Generator) -> Seen:
    """The run every `period_ms`, with errors of up to `most_m` in x and in y, uniform and independent."""
    at_s = np.arange(0.0, run.last_s, period_ms / 1000)
    road_deg = rng.uniform(0.0, 360.0)
    sine, cosine = math.sin(math.radians(road_deg)), math.cos(math.radians(road_deg))
    places = {}
    for car, drive in run.drives.items():
        along_m, right_m = np.interp(at_s, drive.at_s, drive.along_m), np.interp(at_s, drive.at_s, drive.right_m)
        true = np.stack([along_m * sine + right_m * cosine, along_m * cosine - right_m * sine], axis=1)
        places[car] = true + rng.uniform(-most_m, most_m, true.shape)
    return Seen([round(each * 1e6) for each in at_s], places, road_deg)


def overtake(speed_m_s: float, rng: np.random.Generator) -> Run:
    """The run of Table 8.2: car a, at that speed, passes car b, which is 5 m/s slower, in the lane to the left.

    It is out of its lane from 20 m behind to 20 m ahead, and is seen from about 40 m behind to 40 m ahead.
    """
    return _passing(speed_m_s - 5.0, 5.0, rng.uniform(38.0, 42.0), 20.0, -LANE_M)


def decent(rng: np.random.Generator) -> Run:
    """Car a passes car b, on the left; in every second run it meets a car c, ten seconds or more after it is back."""
    run = _some_passing(rng, -LANE_M)
    return _meeting(run, run.last_s - rng.uniform(2.0, 4.0), rng) if rng.random() < 0.5 else run


def wrong_side(rng: np.random.Generator) -> Run:
    """Car a passes car b on the shoulder."""
    return _some_passing(rng, SHOULDER_M)


def oncoming_too_near(rng: np.random.Generator) -> Run:
    """Car a passes car b, and car c comes towards it and goes by, on the shoulder, within 2 s after a and b are level."""
    run = _some_passing(rng, -LANE_M)
    return _meeting(run, run.level_s + rng.uniform(0.0, 2.0), rng, -SHOULDER_M)


def again_and_again(rng: np.random.Generator) -> Run:
    """Car a draws level with car b and falls back, three times within a minute."""
    speed_m_s, gap_m = rng.uniform(12.0, 20.0), rng.uniform(14.0, 18.0)
    at_s, behind_m, right_m = [0.0, 4.0], [gap_m, gap_m], [LANE_M, LANE_M]
    for _ in range(3):
        for seconds, gap, right in ((2, gap_m, -LANE_M), (3, 0.5, -LANE_M), (3, 0.5, -LANE_M), (3, gap_m, -LANE_M)):
            at_s.append(at_s[-1] + seconds)
            behind_m.append(gap)
            right_m.append(right)
        at_s.append(at_s[-1] + rng.uniform(3.0, 5.0))
        behind_m.append(gap_m)
        right_m.append(LANE_M)
    last_s = at_s[-1] + 3.0
    along_m = [speed_m_s * at + gap_m - behind for at, behind in zip(at_s, behind_m, strict=True)]
    at_s.append(last_s)
    along_m.append(speed_m_s * last_s)
    right_m.append(LANE_M)
    other = Drive((0.0, last_s), (gap_m, gap_m + speed_m_s * last_s), (LANE_M, LANE_M))
    return Run({"a": Drive(at_s, along_m, right_m), "b": other}, last_s, 9.0)


def _some_passing(rng: np.random.Generator, side_m: float) -> Run:
    """With 3 to 6 m/s more than car b."""
    more_m_s = rng.uniform(3.0, 6.0)
    run = _passing(rng.uniform(12.0, 20.0), more_m_s, rng.uniform(40.0, 60.0), rng.uniform(15.0, 25.0), side_m)
    return run._replace(last_s=run.last_s + 10.0)


def _passing(slow_m_s: float, more_m_s: float, gap_m: float, out_m: float, side_m: float) -> Run:
    fast_m_s, level_s = slow_m_s + more_m_s, gap_m / more_m_s
    out_s, back_s = (gap_m - out_m) / more_m_s, (gap_m + out_m) / more_m_s
    at_s = (0.0, out_s - 2.0, out_s, back_s, back_s + 2.0, back_s + 60.0)
    right_m = (LANE_M, LANE_M, side_m, side_m, LANE_M, LANE_M)
    passing = Drive(at_s, tuple(fast_m_s * each for each in at_s), right_m)
    passed = Drive((0.0, at_s[-1]), (gap_m, gap_m + slow_m_s * at_s[-1]), (LANE_M, LANE_M))
    return Run({"a": passing, "b": passed}, 2 * level_s, level_s)


def _meeting(run: Run, meets_s: float, rng: np.random.Generator, right_m: float = -LANE_M) -> Run:
    """A car c comes from ahead and is level with car a at that time."""
    towards_m_s = rng.uniform(12.0, 22.0)
    where_m = float(np.interp(meets_s, run.drives["a"].at_s, run.drives["a"].along_m))
    begin_m, end_m = where_m + towards_m_s * meets_s, where_m + towards_m_s * (meets_s - run.last_s)
    meeting = Drive((0.0, run.last_s), (begin_m, end_m), (right_m, right_m))
    return run._replace(drives={**run.drives, "c": meeting})
