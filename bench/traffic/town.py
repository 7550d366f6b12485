"""Minutes of traffic in a town, from seeds, as a tracker sees it: slow cars, queues at crossings, drop-outs after which a car has another name."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final, NamedTuple

import numpy as np

from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.sim_uavs.roads.drivers import RoadState, drawn
from dyknow.sim_uavs.roads.traffic import SimulatedTraffic

STEP_MS: Final = 100
GONE_S: Final = (1.0, 3.0)
LEAST_S: Final = 1.5
MOST_UNSEEN: Final = 5
SLACK_MS: Final = 4000
LATE_MS: Final = 10_000
"""A slow car needs so long for the 15 m between the end of its curve and the border of the crossing on the map."""
MISSED: Final = 0.03


class Passage(NamedTuple):
    """A car came from a link through a crossing onto another one.

    Attributes:
        is_clear: it was seen for 1.5 s before and after, and in between without a gap of half a second.
    """

    way: tuple[str, str, str]
    enters_ms: int
    leaves_ms: int
    is_clear: bool


class TownMinute(NamedTuple):
    """What happened, and the samples of the tracker."""

    passages: list[Passage]
    lines: list[dict[str, Any]]


def minute(network: RoadNetwork, seed: int, sd_m: float, cars: int = 18, seconds: float = 60.0) -> TownMinute:
    """The minute of a seed: every fourth car is slow."""
    rng = np.random.default_rng((seed, 13))
    streets = sorted((str(link.start), str(link.end)) for link in network.links.values())
    streets += [(end, start) for start, end in streets]
    drivers = []
    for number, index in enumerate(rng.permutation(len(streets))[:cars]):
        driver = drawn(f"car{number}", streets[int(index)], rng, start_m=float(rng.uniform(5.0, 60.0)))
        drivers.append(driver._replace(cruise_m_s=float(rng.uniform(2.0, 5.0))) if number % 4 == 0 else driver)
    traffic = SimulatedTraffic(network, drivers, rng)
    seen: dict[str, list[tuple[RoadState, bool]]] = {}
    lines: list[dict[str, Any]] = []
    hidden = _drop_outs([driver.name for driver in drivers], rng, seconds)
    for step in range(1, round(seconds * 1000 / STEP_MS)):
        at_ms = step * STEP_MS
        traffic.advance(at_ms * 1000)
        for state in traffic.states():
            spans = hidden[state.name]
            hides = any(begin <= at_ms / 1000 < end for begin, end in spans)
            is_seen = not hides and rng.random() >= MISSED
            seen.setdefault(state.name, []).append((state, is_seen))
            if is_seen:
                times = sum(end <= at_ms / 1000 for _, end in spans)
                x_m, y_m = (round(float(each + rng.normal(0.0, sd_m)), 2) for each in (state.x_m, state.y_m))
                lines.append({"t_ms": at_ms, "tracker": [f"{state.name}t{times}", x_m, y_m, True]})
    return TownMinute([each for states in seen.values() for each in _passages(states)], lines)


def _drop_outs(names: Iterable[str], rng: np.random.Generator, seconds: float) -> dict[str, list[tuple[float, float]]]:
    """When each is not seen, s."""
    found = {}
    for name in names:
        begins = np.sort(rng.uniform(3.0, seconds, rng.integers(0, 4)))
        found[name] = [(float(begin), float(begin + rng.uniform(*GONE_S))) for begin in begins]
    return found


def _passages(states: list[tuple[RoadState, bool]]) -> Iterator[Passage]:
    runs: list[list[Any]] = []
    for i, (state, _) in enumerate(states):
        area = (state.link, state.crossing)
        if not runs or runs[-1][0] != area:
            runs.append([area, i, i])
        runs[-1][2] = i
    for before, inside, after in zip(runs, runs[1:], runs[2:], strict=False):
        if before[0][0] and inside[0][1] and after[0][0]:
            least = round(LEAST_S * 1000 / STEP_MS)
            is_long = min(before[2] - before[1], after[2] - after[1]) >= least
            near = [is_seen for _, is_seen in states[inside[1] - least : inside[2] + least + 1]]
            way = before[0][0], inside[0][1], after[0][0]
            yield Passage(
                way, STEP_MS * (inside[1] + 1), STEP_MS * (inside[2] + 1), is_long and _longest_gap(near) < MOST_UNSEEN
            )


def _longest_gap(seen: Iterable[bool]) -> int:
    longest = now = 0
    for each in seen:
        now = 0 if each else now + 1
        longest = max(longest, now)
    return longest


def judged(
    made: TownMinute, reports: Iterable[tuple[tuple[str, str, str], int]], names: Mapping[str, str]
) -> tuple[list[tuple[tuple[str, str, str], int]], list[Passage], int]:
    """False reports, clear passages that were missed, and how many clear ones there are.

    Args:
        reports: way and time, ms.
        names: what links and crossings are called in events.
    """
    left, wrong = list(made.passages), []
    for way, at_ms in reports:
        match = next(
            (
                each
                for each in left
                if tuple(names[one] for one in each.way) == way
                and each.enters_ms - SLACK_MS <= at_ms <= each.leaves_ms + LATE_MS
            ),
            None,
        )
        if match is None:
            wrong.append((way, at_ms))
        else:
            left.remove(match)
    clear = sum(each.is_clear for each in made.passages)
    return wrong, [each for each in left if each.is_clear], clear
