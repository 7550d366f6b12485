"""Table 8.2 of the thesis (8.7.6): how often an overtake is recognised, by speed, sample period and error of positions.

"The error has a uniform distribution with a known maximum value e and is added independently to the x and y
coordinates, i.e. the observed position is within an e x e meter square centered on the true position." That can be
read in two ways: `maximum`, the error of a coordinate is in [-e, e], and `square`, it is in [-e / 2, e / 2].

A run is a success if exactly one overtake is recognised, of car b by car a, from 3 s before to 6 s after they are level.
Where `recognised` is counted, any overtake of b by a will do, however often and whenever, which is what the thesis asks.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from bench.overtakes.drives import overtake, seen
from bench.overtakes.recognition import recognised

SPEEDS_M_S: Final = (15, 20, 25)
PERIODS_MS: Final = (200, 100)
ERRORS_M: Final = (0, 2, 3, 4, 5, 7)
READINGS: Final = {"maximum": 1.0, "square": 0.5}
"""The largest error of a coordinate, as a multiple of e."""
RUNS: Final = 200
THESIS_RUNS: Final = 10
THESIS: Final = {
    (15, 200): (100, 70, 60, 50, 40, 20),
    (20, 200): (100, 60, 70, 50, 50, 20),
    (25, 200): (100, 100, 50, 40, 10, 0),
    (15, 100): (100, 60, 90, 60, 90, 0),
    (20, 100): (100, 90, 90, 90, 80, 20),
    (25, 100): (100, 90, 80, 70, 80, 0),
}
"""Per cent of ten runs, by the error."""


class Cell(NamedTuple):
    """One cell of the table, in one reading, with filtered or raw relations."""

    speed_m_s: int
    period_ms: int
    error_m: int
    reading: str
    is_filtered: bool


class Counted(NamedTuple):
    """Runs of a cell: all, the successes, and those in which an overtake of b by a was recognised at all."""

    runs: int
    successes: int
    recognised: int


def cells(*, filtered: bool) -> list[Cell]:
    return [
        Cell(speed_m_s, period_ms, error_m, reading, filtered)
        for reading in READINGS
        for period_ms in PERIODS_MS
        for speed_m_s in SPEEDS_M_S
        for error_m in ERRORS_M
    ]


def counted(cell: Cell, runs: int = RUNS) -> Counted:
    """Run number n of a cell has the seed (n, speed, period, error), so that both variants see the same."""
    each = [run(cell, number) for number in range(runs)]
    return Counted(runs, sum(success for success, _ in each), sum(is_there for _, is_there in each))


def run(cell: Cell, number: int) -> tuple[bool, bool]:
    """Whether run `number` is a success, and whether an overtake of b by a was recognised at all."""
    rng = np.random.default_rng((number, cell.speed_m_s, cell.period_ms, cell.error_m))
    made = overtake(cell.speed_m_s, rng)
    positions = seen(made, cell.period_ms, READINGS[cell.reading] * cell.error_m, rng)
    found = recognised(positions, filtered=cell.is_filtered, names=("overtake",))
    of_b_by_a = [one.recognised_ms / 1000 - made.level_s for one in found if one.bindings["?car1"] == "a"]
    return len(found) == 1 and len(of_b_by_a) == 1 and -3.0 <= of_b_by_a[0] <= 6.0, bool(of_b_by_a)


def wilson(successes: int, runs: int, z: float = 1.96) -> tuple[float, float]:
    """Bounds of a share, by Wilson's score interval."""
    share, spread = successes / runs, z * z / runs
    middle = (share + spread / 2) / (1 + spread)
    half = z / (1 + spread) * math.sqrt(share * (1 - share) / runs + spread / (4 * runs))
    return middle - half, middle + half


def thesis(cell: Cell) -> float:
    """The thesis' own share."""
    return THESIS[cell.speed_m_s, cell.period_ms][ERRORS_M.index(cell.error_m)] / 100


def is_below_the_thesis(cell: Cell, found: Counted) -> bool:
    """Whether it is below by more than two standard errors of the difference.

    The standard error of a share s of n runs is sqrt(s (1 - s) / n), with one success and one failure more, so that it is
    not 0 where all ten runs went well.
    """

    def variance(successes: float, runs: int) -> float:
        share = (successes + 1) / (runs + 2)
        return share * (1 - share) / (runs + 2)

    theirs = thesis(cell)
    ours = found.successes / found.runs
    error = math.sqrt(variance(found.successes, found.runs) + variance(theirs * THESIS_RUNS, THESIS_RUNS))
    return ours < theirs - 2 * error


def is_met(cell: Cell, found: Counted) -> bool:
    """The bar: not below the thesis, and at 100 ms and errors up to 5 m at least 95 %."""
    wanted = 0.95 if cell.period_ms == 100 and cell.error_m <= 5 else 0.0
    return not is_below_the_thesis(cell, found) and found.successes >= wanted * found.runs
