"""Overtakes that are harder than those of Table 8.2, at a twentieth unless DYKNOW_FULL is set."""

import json
import os

import pytest

from bench.overtakes.figure import EVENTS, OUT, drawing
from bench.overtakes.varied import RUNS, SITUATIONS, is_right

TIMES = RUNS if os.environ.get("DYKNOW_FULL") else RUNS // 20


@pytest.mark.parametrize("name", SITUATIONS)
def test_8_7_5_each_overtake_is_recognised_once_and_no_other_with_errors_of_up_to_2_m(name: str) -> None:
    right = sum(is_right(name, number, 2.0) for number in range(TIMES))
    assert right >= 0.95 * TIMES


def test_the_picture_in_the_documentation_is_that_of_the_recorded_run() -> None:
    events = [json.loads(line) for line in EVENTS.read_text(encoding="utf-8").splitlines()]
    assert drawing(events) == OUT.read_text(encoding="utf-8")
