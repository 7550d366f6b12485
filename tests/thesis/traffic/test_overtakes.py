"""Table 8.2 and the reckless overtakes of Example 8.2.2, at a tenth and on fewer cells unless DYKNOW_FULL is set."""

import os
from collections import Counter

import pytest

from bench.overtakes import reckless
from bench.overtakes.table import (
    ERRORS_M,
    PERIODS_MS,
    READINGS,
    RUNS,
    SPEEDS_M_S,
    THESIS,
    Cell,
    Counted,
    cells,
    counted,
    is_below_the_thesis,
    is_met,
    wilson,
)
from tests.thesis.traffic import written

FULL = bool(os.environ.get("DYKNOW_FULL"))
SHOWN = [Cell(15, 100, 5, "maximum", True), Cell(25, 100, 5, "maximum", True), Cell(20, 200, 7, "maximum", True)]


@pytest.mark.parametrize("cell", cells(filtered=True) if FULL else SHOWN, ids=str)
def test_table_8_2_no_cell_is_below_the_thesis_and_at_100_ms_and_5_m_all_but_one_in_twenty_are_recognised(cell) -> None:
    found = counted(cell, RUNS if FULL else RUNS // 10)
    assert is_met(cell, found), found


def test_table_8_2_raw_relations_tell_more_than_there_is() -> None:
    """Without an error one overtake; with 5 m some are recognised in every run, and hardly ever the one that happened."""
    assert counted(Cell(15, 100, 0, "maximum", False), 3) == Counted(3, 3, 3)
    noisy = counted(Cell(15, 100, 5, "maximum", False), 10)
    assert noisy.recognised == 10
    assert noisy.successes <= 2


def test_table_8_2_has_all_cells_once() -> None:
    assert len(set(cells(filtered=True))) == len(SPEEDS_M_S) * len(PERIODS_MS) * len(ERRORS_M) * len(READINGS) == 72
    assert {len(row) for row in THESIS.values()} == {len(ERRORS_M)}


def test_a_cell_far_below_the_thesis_is_noticed() -> None:
    cell = Cell(15, 200, 0, "square", True)
    assert is_below_the_thesis(cell, Counted(200, 120, 120))
    assert not is_below_the_thesis(cell, Counted(200, 195, 195))
    assert not is_met(Cell(25, 100, 5, "square", True), Counted(200, 189, 200))


@pytest.mark.parametrize(
    ("successes", "runs", "expected"),
    [(200, 200, (0.981, 1.0)), (0, 10, (0.0, 0.278)), (5, 10, (0.237, 0.763))],  # as statsmodels gives them
)
def test_wilson_intervals_are_those_of_the_textbook(successes, runs, expected) -> None:
    assert wilson(successes, runs) == pytest.approx(expected, abs=5e-4)


@pytest.mark.parametrize("variant", reckless.VARIANTS)
def test_example_8_2_2_each_reckless_overtake_is_recognised(variant) -> None:
    runs = 200 if FULL else 5
    assert reckless.counted(variant, runs)[variant] >= 0.95 * runs


def test_example_8_2_2_no_decent_overtake_is_reckless() -> None:
    runs = 1000 if FULL else 8
    found = reckless.counted("decent", runs)
    assert found == Counter(overtake=runs, passes=runs)


def test_the_recorded_files_of_the_examples_are_those_of_their_seeds() -> None:
    for name, text in written.written().items():
        assert (written.EXAMPLES / name).read_text(encoding="utf-8") == text
