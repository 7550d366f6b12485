"""Overtakes that really happened in a minute, and how right reports of them are."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise, permutations
from typing import Any, Final, NamedTuple

from bench.traffic.motorway import CarAt, Minute

CLEAR_MS: Final = 1500
SLACK_MS: Final = 4000
LONGEST_MS: Final = 55_000
UNSEEN_MS: Final = 1000


class Pass(NamedTuple):
    """The first car was behind the second until `out_ms`, and is in front from `past_ms` on.

    `is_clear`: both were seen for 1.5 s while it was behind, and again while it was in front, from then on it can be known.
    """

    pair: tuple[str, str]
    out_ms: int
    past_ms: int
    is_clear: bool
    known_ms: int


class Score(NamedTuple):
    """Numbers of reports and of what happened.

    Attributes:
        unseen: reports that rest on a car that was not seen for a second.
    """

    reported: int = 0
    false: int = 0
    clear: int = 0
    found: int = 0
    unseen: int = 0

    def plus(self, other: "Score") -> "Score":
        return Score(*(one + more for one, more in zip(self, other, strict=True)))

    @property
    def precision(self) -> float:
        return 1.0 - self.false / max(1, self.reported)

    @property
    def recall(self) -> float:
        return self.found / max(1, self.clear)


def _sector(one: CarAt, other: CarAt) -> str:
    ahead_m, right_m = one.along_m - other.along_m, one.right_m - other.right_m
    return "beside" if abs(ahead_m) <= abs(right_m) else "behind" if ahead_m < 0.0 else "in front"


def passes(minute: Minute) -> list[Pass]:
    """All that happened while both cars were there."""
    found: list[Pass] = []
    names = {name for cars in minute.cars for name in cars}
    spans = {name: [i for i, cars in enumerate(minute.cars) if name in cars] for name in names}
    for pair in permutations(sorted(names), 2):
        both = sorted(set(spans[pair[0]]) & set(spans[pair[1]]))
        found += _passes_of(pair, minute, both)
    return found


def _passes_of(pair: tuple[str, str], minute: Minute, both: Sequence[int]) -> list[Pass]:
    """One car may pass the other several times, if that passes it in between."""
    runs: list[list[Any]] = []
    for i in both:
        one, other = (minute.cars[i][name] for name in pair)
        sector = _sector(one, other)
        if sector == "beside":
            continue
        if not runs or runs[-1][0] != sector:
            runs.append([sector, minute.at_ms[i], minute.at_ms[i], 0, 0, None])
        run = runs[-1]
        run[2] = minute.at_ms[i]
        run[3] = run[3] + 100 if one.is_seen and other.is_seen else max(0, run[3] - 100)
        run[4] = max(run[4], run[3])
        if run[5] is None and run[3] >= CLEAR_MS:
            run[5] = minute.at_ms[i]
    found = []
    for before, after in pairwise(runs):
        if before[0] == "behind":
            is_clear = min(before[4], after[4]) >= CLEAR_MS and after[1] - before[2] <= LONGEST_MS
            found.append(Pass(pair, before[2], after[1], is_clear, after[1] if after[5] is None else after[5]))
    return found


def score(minute: Minute, reports: Iterable[tuple[tuple[str, str], int]]) -> Score:
    """How right reports are, (pair, when the first came in front, ms); each stands for one pass."""
    return judged(minute, reports)[0]


def judged(
    minute: Minute, reports: Iterable[tuple[tuple[str, str], int]]
) -> tuple[Score, list[tuple[tuple[str, str], int]], list[Pass]]:
    """The score, the false reports, and the clear passes that were missed."""
    truth = passes(minute)
    left, wrong, unseen, made = list(truth), [], 0, 0
    for pair, at_ms in sorted(reports, key=lambda each: each[1]):
        made += 1
        unseen += not all(_was_seen(minute, name, at_ms) for name in pair)
        match = next((each for each in left if each.pair == pair and _fits(each, at_ms)), None)
        if match is None:
            wrong.append((pair, at_ms))
        else:
            left.remove(match)
    missed = [each for each in left if each.is_clear]
    clear = sum(each.is_clear for each in truth)
    return Score(made, len(wrong), clear, clear - len(missed), unseen), wrong, missed


def _fits(one: Pass, at_ms: int) -> bool:
    return one.out_ms - SLACK_MS <= at_ms <= one.known_ms + SLACK_MS


def _was_seen(minute: Minute, name: str, at_ms: int) -> bool:
    near = (cars for at, cars in zip(minute.at_ms, minute.cars, strict=True) if at_ms - UNSEEN_MS <= at <= at_ms)
    return any(name in cars and cars[name].is_seen for cars in near)


def reported(records: Iterable[Mapping[str, Any]], stream: str) -> list[tuple[tuple[str, str], int]]:
    """What `dyknow kpl run --json` printed of a stream of overtakes."""
    found = []
    for record in records:
        if record.get("stream") == stream:
            one, other = record["value"][0][:2]
            found.append(((str(one), str(other)), int(record["valid_us"]) // 1000))
    return found
