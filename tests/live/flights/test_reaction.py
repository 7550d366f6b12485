"""From the position that shows a meeting to the order: the row of the benchmark that flies three processes."""

import pytest

from bench.__main__ import measured
from bench.rows import Options

pytestmark = pytest.mark.live


def test_three_processes_note_how_long_their_manoeuvres_take_to_begin() -> None:
    found = measured("b22", Options(rounds=1, effort=0.01))
    assert {bar["what"] for bar in found["bars"]}
