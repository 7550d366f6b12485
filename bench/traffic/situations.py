"""Cars that change lanes, cut in, follow too closely and turn back on a link, and others that nearly do, as drives from seeds."""

from collections.abc import Iterator, Mapping
from math import cos, radians, sin
from typing import Any, Final, NamedTuple

import numpy as np

from bench.traffic.motorway import LANE_M, LENGTH_M

STEP_MS: Final = 100
Floats = np.ndarray[Any, np.dtype[np.float64]]


class Situation(NamedTuple):
    """Where cars are, metres along the road and in lanes from the right one, 0, at times; what happens in it.

    Attributes:
        happens: names of chronicles with their arguments.
    """

    at_s: Floats
    along_m: Mapping[str, Floats]
    side: Mapping[str, Floats]
    happens: frozenset[tuple[str, ...]]


def drawn(seed: int) -> Situation:
    """The situation of a seed: five kinds take turns."""
    rng = np.random.default_rng((seed, 11))
    return (changing, cutting_in, following, turning_back, crawling)[seed % 5](rng)


def changing(rng: np.random.Generator) -> Situation:
    """One car changes its lane and back, or begins to and stays."""
    at_s, speed = np.arange(0.0, 30.0, 0.1), rng.uniform(12.0, 30.0)
    takes_s, begins = rng.uniform(2.0, 5.0), sorted((rng.uniform(5.0, 9.0), rng.uniform(18.0, 22.0)))
    far = 1.0 if rng.random() < 0.7 else 0.25
    side = np.interp(at_s, [begins[0], begins[0] + takes_s, begins[1], begins[1] + takes_s], [0.0, far, far, 0.0])
    happens = {("lane_change", "a", "0", "1"), ("lane_change", "a", "1", "0")} if far == 1.0 else set()
    return Situation(at_s, {"a": speed * at_s}, {"a": side}, frozenset(happens))


def cutting_in(rng: np.random.Generator) -> Situation:
    """Car c passes car a and comes into its lane, closely in front of it or far ahead."""
    at_s, speed = np.arange(0.0, 36.0, 0.1), rng.uniform(15.0, 28.0)
    is_close = bool(rng.random() < 0.5)
    gap_s = rng.uniform(0.25, 0.55) if is_close else rng.uniform(1.2, 2.0)
    goal_m, faster = gap_s * speed + LENGTH_M, rng.uniform(3.0, 5.0)
    ahead_m = np.minimum(-40.0 + faster * at_s, goal_m)
    begins_s = (goal_m + 40.0) / faster - 0.5
    side = np.interp(at_s, [begins_s, begins_s + rng.uniform(2.0, 4.0)], [1.0, 0.0])
    happens: set[tuple[str, ...]] = {("lane_change", "c", "1", "0")}
    if is_close:
        happens |= {("cuts_in", "c", "a"), ("follows_too_closely", "a", "c")}
    along_m = {"a": speed * at_s, "c": speed * at_s + ahead_m}
    return Situation(at_s, along_m, {"a": np.zeros(len(at_s)), "c": side}, frozenset(happens))


def following(rng: np.random.Generator) -> Situation:
    """Car a follows car b for a while, too closely or not, with another one next to both."""
    at_s, speed = np.arange(0.0, 25.0, 0.1), rng.uniform(12.0, 30.0)
    is_close = bool(rng.random() < 0.5)
    gap_s = rng.uniform(0.2, 0.55) if is_close else rng.uniform(1.1, 2.0)
    far_s, lasts_s = rng.uniform(1.5, 2.0), rng.uniform(6.0, 10.0)
    gap_m = LENGTH_M + speed * np.interp(at_s, [5.0, 9.0, 9.0 + lasts_s, 13.0 + lasts_s], [far_s, gap_s, gap_s, far_s])
    along_m = {"a": speed * at_s - gap_m, "b": speed * at_s, "d": speed * at_s - 8.0}
    side = {"a": np.zeros(len(at_s)), "b": np.zeros(len(at_s)), "d": np.ones(len(at_s))}
    return Situation(at_s, along_m, side, frozenset({("follows_too_closely", "a", "b")} if is_close else ()))


def turning_back(rng: np.random.Generator) -> Situation:
    """Car a stops, and turns back or drives on; on a road with a lane each way."""
    at_s, speed = np.arange(0.0, 45.0, 0.1), rng.uniform(6.0, 14.0)
    turns = bool(rng.random() < 0.6)
    stops_s, waits_s = rng.uniform(10.0, 14.0), rng.uniform(0.0, 8.0)
    onward = -1.0 if turns else 1.0
    speeds = np.interp(
        at_s,
        [stops_s - 4.0, stops_s, stops_s + waits_s, stops_s + waits_s + 5.0],
        [speed, 0.0, 0.0, onward * speed],
    )
    along_m = np.cumsum(0.1 * speeds)
    begins_s = stops_s + waits_s - 0.5
    side = np.interp(at_s, [begins_s, begins_s + 3.0], [0.0, 1.0 if turns else 0.0])
    happens = {("u_turn", "a", "l1"), ("lane_change", "a", "0", "1")} if turns else set()
    return Situation(at_s, {"a": along_m}, {"a": side}, frozenset(happens))


def crawling(rng: np.random.Generator) -> Situation:
    """A queue in one lane, bumper to bumper, and a car that passes it: nothing of all that, for gaps in time are for cars that drive."""
    at_s = np.arange(0.0, 30.0, 0.1)
    along_m = {name: 20.0 - 8.0 * i + rng.uniform(0.3, 1.5) * at_s for i, name in enumerate("abc")}
    first = np.minimum.reduce(list(along_m.values()))
    crawls = {name: first + 20.0 - 8.0 * i for i, name in enumerate("abc")}
    crawls["e"] = -60.0 + rng.uniform(8.0, 14.0) * at_s
    side = {name: np.zeros(len(at_s)) for name in "abc"} | {"e": np.ones(len(at_s))}
    return Situation(at_s, crawls, side, frozenset())


def lines(situation: Situation, seed: int, sd_m: float) -> Iterator[dict[str, Any]]:
    """The feed of manoeuvres.kpl: where cars are seen, with an error, and in which lane they seem to be by that."""
    rng = np.random.default_rng((seed, 12))
    road_deg = float(rng.uniform(0.0, 360.0))
    heading = radians(road_deg)
    for i in range(len(situation.at_s)):
        for car, along in situation.along_m.items():
            along_m, right_m = along[i], -LANE_M * situation.side[car][i]
            ahead_m, aside_m = along_m + rng.normal(0.0, sd_m), right_m + rng.normal(0.0, sd_m)
            x_m, y_m = ahead_m * sin(heading) + aside_m * cos(heading), ahead_m * cos(heading) - aside_m * sin(heading)
            lane = str(min(1, max(0, round(-aside_m / LANE_M))))
            seen = [car, round(x_m, 2), round(y_m, 2), round(road_deg, 2), "l1", "no_crossing", lane]
            yield {"t_ms": STEP_MS * i, "seen": seen}
