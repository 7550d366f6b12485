"""A specification that is changed while its platform runs, printed back, drawn, and restored from elsewhere."""

from pathlib import Path

import pytest

from tests.live.command_line.command import Dyknow, lines

pytestmark = pytest.mark.live
EXAMPLES = Path(__file__).parents[3] / "examples"
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
    refused = next(
        line for line in said if line.get("event") == "note" and "the previous one keeps running" in line["text"]
    )
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
    assert "expected a number from 0 to 2, got 7" in err
    del out


def test_simulated_uavs_run_a_specification_that_is_changed_from_elsewhere(dyknow: Dyknow, tmp_path: Path) -> None:
    spec = tmp_path / "low.kpl"
    spec.write_text("monitor low = always height[self] > -1000\n", encoding="utf-8")
    dyknow.run("up", "2", "--scenario", "hover", "--spec", str(spec), "--detach")
    for unit in ("0", "1"):
        [held] = dyknow.run("kpl", "show", "--unit", unit)
        assert held["specification"].startswith("monitor low = always height[self]")
    _, err = dyknow.raw("kpl", "add", "stream h = heigt[self]", "--unit", "0", code=1)
    assert "TEXT:1:12: nothing makes heigt[self]" in err
    [said] = dyknow.run("kpl", "add", "stream h = height[self] with sample every 500", "--unit", "0")
    assert (said["number"], said["added"]) == (1, ["stream h = height[self] with sample every 500"])
    [graph] = dyknow.run("kpl", "graph", "--unit", "0")
    assert "h" in {node["name"] for node in graph["nodes"]}
    [said] = dyknow.run("kpl", "remove", "low", "stream h", "--unit", "0")
    assert len(said["removed"]) == 2
    dyknow.run("kpl", "show", "--unit", "0", "--restore", "0")
    [held] = dyknow.run("kpl", "show", "--unit", "0")
    assert held["specification"].startswith("monitor low = always height[self]")

    dyknow.run("kpl", "add", "monitor under = always height[self] < -1000", "--unit", "1")
    alarm = next(line for line in lines(dyknow.start("alarms", "--follow", "--json")) if line.get("monitor") == "under")
    [reason] = alarm["because"]
    assert (reason["part"], reason["holds"]) == ("height[1] < -1000", False)
    out, _ = dyknow.raw("alarms", "--explain")
    assert "because height[1] < -1000 is false: height[1]" in " ".join(out.split())
    [explained] = [each for each in dyknow.run("monitors", "--explain") if each.get("monitor") == "under"]
    assert explained["because"][0]["part"] == "height[1] < -1000"
    out, _ = dyknow.raw("monitors", "--explain")
    assert "under of 1 by 1: because height[1] < -1000 is false: height[1]" in " ".join(out.split())
    dyknow.run("kpl", "remove", "under", "--unit", "1")
    told = {each["event"]: each["id"] for each in dyknow.run("alarms") if each.get("monitor") == "under"}
    assert told["ended"] == told["opened"]
    out, _ = dyknow.raw("alarms")
    assert "still open" not in out

    near = (
        "monitor near = always forall other in units - {self} growing: xy_dist[self, other] >= 5 with starts avoidance"
    )
    dyknow.run("kpl", "add", near, "--unit", "0", "--unit", "1")
    task = dyknow.start("delegate", "monitor-proximity", "profile=near", "--to", "0", "--json")
    conversation = next(line["conversation"] for line in lines(task) if line.get("conversation"))
    listed = dyknow.until("tasks", task="monitor-proximity", state="running")
    assert {entry["unit"] for entry in listed} >= {0}
    _, err = dyknow.raw("kpl", "remove", "near", "--unit", "0", code=1)
    assert f"monitor near belongs to task {conversation}" in err
    dyknow.run("cancel", conversation)
    dyknow.run("kpl", "remove", "near", "--unit", "0")
    log = dyknow.run("acts", "--unit", "0")
    assert [each for each in log if "add-declarations" in (each["act"] or "") and each["outcome"] == "accepted"]


CAR = '''
from dyknow import source

PERIOD_US = 250_000


@source("link")
def links(from_us):
    """A car that turns every half second."""
    for n in range(1_000_000):
        valid_us = (from_us // PERIOD_US + 1 + n) * PERIOD_US
        yield valid_us, ("l1", "no_link", "l2", "no_link")[valid_us // PERIOD_US % 4]
'''
TURNS = """
chronicle turns[?car, ?from, ?to] {
    event(link[?car]:(?from, no_link), t1)
    event(link[?car]:(no_link, ?to), t2)
    t1 < t2
    t2 - t1 <= 400
}
"""


def test_chronicles_are_recognised_in_the_live_streams_of_a_platform(dyknow: Dyknow, tmp_path: Path) -> None:
    units, spec, chronicles = tmp_path / "cars.py", tmp_path / "cars.kpl", tmp_path / "turns.chr"
    units.write_text(CAR, encoding="utf-8")
    chronicles.write_text(TURNS, encoding="utf-8")
    spec.write_text(
        'source link links\nstrmgen link[a] = links\nchronicle file "turns.chr" with max delay 100\n'
        "stream turned = chronicle[turns]\nstream may_turn = partial[turns]\n",
        encoding="utf-8",
    )
    joined = dyknow.start("join", "--unit", "0", "--spec", str(spec), "--units", str(units), "--json")
    declared = next(line for line in lines(joined) if line.get("stream") == "turned" and line["event"] == "sample")
    assert declared["value"][0] in [["a", "l1", "l2"], ["a", "l2", "l1"]]
    watched = dyknow.run("chronicle", str(chronicles), "--unit", "0", "--timeout", "3s", "--max-delay", "200ms")
    assert {(each["bindings"]["?from"], each["bindings"]["?to"]) for each in watched} == {("l1", "l2"), ("l2", "l1")}
    assert all(each["instants"]["t2"] - each["instants"]["t1"] == 250 for each in watched)
    told = dyknow.run(
        "chronicle", str(chronicles), "--unit", "0", "--timeout", "3s", "--max-delay", "100ms", "--partial"
    )
    waiting = [each for each in told if "partial" in each and not each["over"] and set(each["instants"]) == {"t1"}]
    assert {each["bindings"]["?from"] for each in waiting} == {"l1", "l2"}
    assert all(each["dies_ms"] == each["instants"]["t1"] + 401 for each in waiting)
    assert {each["partial"] for each in told if each.get("over")} == {"turns"}
    out, _ = dyknow.raw("query", "partial[turns]", "--unit", "0", "--last", "4")
    assert "link[?car]:(no_link, ?to)" in " ".join(out.split())
    [graph] = dyknow.run("kpl", "graph", "--unit", "0")
    [counted] = [node["counted"] for node in graph["nodes"] if node["kind"] == "chronicles"]
    assert "late" not in counted


def test_a_formula_is_checked_over_the_live_streams_of_a_specification(dyknow: Dyknow, tmp_path: Path) -> None:
    units, spec = tmp_path / "cars.py", tmp_path / "cars.kpl"
    units.write_text(CAR, encoding="utf-8")
    spec.write_text(
        'source link links\nstrmgen link[a] = links\ndefine crossing[c] = link[c] = "no_link"\n'
        "monitor driving = always not crossing[a] with sample every 50, max delay 100\n",
        encoding="utf-8",
    )
    joined = dyknow.start("join", "--unit", "0", "--spec", str(spec), "--units", str(units), "--json")
    assert next(line for line in lines(joined) if line.get("event") == "alarm-opened")
    [told] = dyknow.run("check", "eventually crossing[a]", "--unit", "0")
    assert (told["verdict"], told["because"][0]["samples"]) == ("true", {"link[a]": "no_link"})
    assert told["states"].startswith("strmgen check_states = state(link[a] with max delay 500) with sample every 100")
    [told] = dyknow.run("check", "always not crossing[a]", "--unit", "0", code=1)
    assert told["verdict"] == "false"
    _, err = dyknow.raw("check", "always not crosing[a]", "--unit", "0", code=2)
    assert "write: crossing" in err
    [graph] = dyknow.run("kpl", "graph", "--unit", "0")
    states = next(node["states"] for node in graph["nodes"] if node["name"] == "driving")
    assert states.startswith("strmgen driving_states = state(link[a] with max delay 100) with sample every 50")
