"""A specification that is changed while its platform runs, printed back, drawn, and restored from elsewhere."""

from pathlib import Path

import pytest

from tests.live.command import Dyknow, lines

pytestmark = pytest.mark.live
EXAMPLES = Path(__file__).parents[2] / "examples"
FIRST = "source altitude barometer_0\nstrmgen alt[self] = barometer_0\nstream height = alt[self]\n"
SECOND = FIRST + "stream sometimes = alt[self] with sample every 500\n"
WRONG = FIRST + "stream none = nothing[self]\n"


def test_a_file_is_taken_in_again_when_it_changes_and_what_was_held_is_restored(dyknow: Dyknow, tmp_path: Path) -> None:
    spec = tmp_path / "mission.kpl"
    spec.write_text(FIRST, encoding="utf-8")
    units = str(EXAMPLES / "flights.py")
    joined = dyknow.start("join", "--unit", "0", "--spec", str(spec), "--units", units, "--json")
    said = lines(joined)
    assert next(line for line in said if line.get("stream") == "height")

    spec.write_text(SECOND, encoding="utf-8")
    assert next(line for line in said if line.get("stream") == "sometimes" and line["event"] == "sample")
    [held] = dyknow.run("kpl", "show", "--unit", "0")
    assert (held["number"], held["last"], held["specification"]) == (1, 1, SECOND)

    spec.write_text(WRONG, encoding="utf-8")
    refused = next(line for line in said if line.get("event") == "note" and "what ran goes on" in line["text"])
    assert "mission.kpl:4:15: nothing makes nothing[self]" in refused["text"]

    [before] = dyknow.run("kpl", "show", "--unit", "0", "--configuration", "0")
    assert before["specification"] == FIRST
    dyknow.run("kpl", "show", "--unit", "0", "--restore", "0")
    [held] = dyknow.run("kpl", "show", "--unit", "0")
    assert (held["number"], held["specification"]) == (2, FIRST)
    [graph] = dyknow.run("kpl", "graph", "--unit", "0")
    assert {node["name"] for node in graph["nodes"]} >= {"alt[0]", "height"}
    assert "sometimes" not in {node["name"] for node in graph["nodes"]}
    out, err = dyknow.raw("kpl", "show", "--unit", "0", "--restore", "7", code=1)
    assert "there are 3 configurations" in err
    del out
