"""A picture has the curves, what lacks and what was violated; what others wrote is only text in it."""

import re
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest

from dyknow.console.command import Call
from dyknow.console.commands.recordings.plot import plot
from dyknow.console.commands.texts.check import check
from dyknow.console.errors import DONE, NO
from dyknow.console.output.output import Output
from dyknow.model.errors import NothingFound, WrongCall
from dyknow.runtime.configuration.settings import Settings
from tests.box import Box
from tests.console.commands.recordings.encounter import EXAMPLE
from tests.console.conftest import Lines

pytest.importorskip("matplotlib")
ROOT = Path(__file__).parents[3]
TRACE = ROOT / "examples" / "flight.jsonl"
BEHIND = (246, 220, 199)


def words(path: Path) -> str:
    """All text of a picture as a reader sees it."""
    return " ".join(" ".join(each.itertext()) for each in ET.parse(path).iter("{http://www.w3.org/2000/svg}text"))


def amount(path: Path) -> int:
    """How many pixels have about the colour behind what is violated."""
    from matplotlib.image import imread

    picture = imread(path)[:, :, :3] * 255
    return int((abs(picture - BEHIND).max(axis=2) < 6).sum())


def test_a_recorded_label_is_drawn_with_its_platforms_its_gap_and_its_alarms(
    call: Call, lines: Lines, tmp_path: Path
) -> None:
    to = tmp_path / "a.svg"
    assert plot(call, ["heli-position", "heli-altitude"], recording=EXAMPLE, to=to) == DONE
    (told,) = lines()
    assert (told["samples"], told["panels"]) == (382, 3)
    shown = words(to)
    for wanted in ("platform 0", "platform 1", "latitude_deg", "altitude_m", "no sample", "alarm open", "unknown"):
        assert wanted in shown, wanted
    plot(call, ["heli-altitude"], unit="0", recording=EXAMPLE, between=("+18s", "+20s"), to=to)
    assert "no sample" not in words(to)
    assert "platform 1" not in words(to)


def test_what_is_violated_is_seen_in_the_picture(call: Call, tmp_path: Path) -> None:
    (tmp_path / "calm.jsonl").write_text('{"t_ms": 0, "speed[uav1]": 9}\n{"t_ms": 500, "speed[uav1]": 9}\n')
    assert check(call, "always speed[uav1] <= 15", trace=TRACE, plot=tmp_path / "a.png") == NO
    assert check(call, "always speed[uav1] <= 15", trace=tmp_path / "calm.jsonl", plot=tmp_path / "b.png") == DONE
    assert amount(tmp_path / "a.png") > 10_000
    assert amount(tmp_path / "b.png") < 100
    check(call, "always speed[uav1] <= 15", trace=TRACE, plot=tmp_path / "a.svg")
    shown = words(tmp_path / "a.svg")
    assert "always speed[uav1] <= 15" in shown
    assert re.search(r"violated by state 3.*undecided.*no sample|no sample.*undecided", shown)


def test_where_there_are_no_verdicts_since_the_trace_is_too_long_that_is_written(
    call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dyknow.console.plots.traces.MOST_STEPS", 5)
    check(call, "always speed[uav1] <= 15", trace=TRACE, plot=tmp_path / "a.svg")
    assert "no verdicts from here" in words(tmp_path / "a.svg")


def test_what_running_platforms_hold_is_drawn(world: Box, call: Call, lines: Lines, tmp_path: Path) -> None:
    world.run(3.0)
    assert plot(call, ["heli-altitude"], between=("-2s", "now"), to=tmp_path / "a.svg") == DONE
    assert 55 <= lines()[0]["samples"] <= 66
    assert "platform 2" in words(tmp_path / "a.svg")
    with pytest.raises(NothingFound):
        plot(call, ["camera-view"], to=tmp_path / "b.svg")
    assert not (tmp_path / "b.svg").exists()


def test_words_of_others_are_text_in_a_picture(call: Call, tmp_path: Path) -> None:
    from dyknow.console.plots.plot import Curve, Plot, PlotPanel, draw

    evil = "$\\frac{1}{$ <script>\x1b[2J\u202e&amp;"
    drawn = Plot(evil, [PlotPanel(evil, [Curve(evil, [0, 1_000_000], [1.0, None]), Curve("x" * 5000, [0], [2.0])])])
    drawn.marks.append((0, evil))
    draw(drawn, tmp_path / "a.svg")
    shown = words(tmp_path / "a.svg")
    assert "<script>\\x1b[2J\\u202e&amp;" in shown
    assert "x" * 200 not in shown


def test_without_matplotlib_the_extra_is_named(call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    for command in (
        lambda: plot(call, ["heli-altitude"], recording=EXAMPLE, to=tmp_path / "a.svg"),
        lambda: check(call, "always p", trace=TRACE, plot=tmp_path / "a.svg"),
    ):
        with pytest.raises(WrongCall, match=r"dyknow-federation\[plot\]"):
            command()


def test_what_cannot_be_drawn_is_a_wrong_call_with_its_repair(call: Call, tmp_path: Path) -> None:
    cases: list[tuple[Any, str]] = [
        (lambda: plot(call, ["heli-altitude"], recording=EXAMPLE, to=tmp_path / "a.mcap"), "write .*a.svg"),
        (lambda: plot(call, ["heli-altitude"], recording=EXAMPLE, to=tmp_path / "no" / "a.svg"), "cannot be written"),
        (lambda: check(call, "always p", unit="0", plot=tmp_path / "a.svg"), "--trace"),
    ]
    for command, said in cases:
        with pytest.raises(WrongCall, match=said):
            command()
    with pytest.raises(NothingFound, match="heli-altitude"):
        plot(Call(Settings(), Output(json_lines=True)), ["heli-altitud"], recording=EXAMPLE, to=tmp_path / "a.svg")
