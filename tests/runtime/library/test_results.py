"""Answers as notebooks and pandas have them."""

import pytest

from dyknow import Quality
from dyknow.runtime.library.results import MOST_ROWS, QueryResult, UnitSample

EVIL = "<script>alert(1)</script>"
SAMPLES = [
    UnitSample("0", "heli-altitude", {"altitude_m": 60.5}, 1_700_000_000_000_000, 0, Quality(certainty=0.9)),
    UnitSample(EVIL, "heli-altitude", {"altitude_m": EVIL}, 1_700_000_000_100_000, 0),
]


def test_a_notebook_shows_a_table_in_which_all_names_are_text() -> None:
    shown = QueryResult(SAMPLES, {"2": f"gone {EVIL}"})._repr_html_()
    assert "<th>altitude_m</th>" in shown
    assert "<td>60.5</td>" in shown
    assert "<script" not in shown
    assert shown.count("&lt;script&gt;") == 3
    assert "platform 2 is missing" in shown
    assert "7 more samples" in QueryResult([SAMPLES[0]] * (MOST_ROWS + 7), {})._repr_html_()


def test_a_frame_has_a_row_a_sample_by_valid_time() -> None:
    pandas = pytest.importorskip("pandas")
    frame = QueryResult(SAMPLES, {}).frame()
    assert [*frame.columns] == ["unit", "label", "altitude_m", "certainty"]
    assert frame.index[1] - frame.index[0] == pandas.Timedelta("100ms")
    assert frame["certainty"].tolist() == [0.9, 1.0]
    assert QueryResult([], {}).frame().empty
