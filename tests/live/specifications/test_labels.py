"""A label of one's own on running processes: from KPL on one platform, from a file on another, refused by a third."""

import subprocess
from pathlib import Path

import pytest

import dyknow as library
from tests.live.command_line.command import Dyknow, lines

pytestmark = pytest.mark.live
EXAMPLES = Path(__file__).parents[3] / "examples" / "labels"
PERIOD_US = 500_000
IN_PERCENT = """\
# The same word, and something else is meant.
[gas-level]
sort = "gas"
unit = "percent"
meaning = "gas in the air around the platform"
"""
WIND_US, WIND_PHASE_US = 200_000, 33_000
WIND = """\
source wind anemometer
label local-wind : wind (north in m/s, east in m/s) "wind around the platform"
label kept-wind : wind (north in m/s, east in m/s) "wind that is kept"
strmgen wind[self] = anemometer
export local-wind = wind[self]
"""
ANEMOMETER = f"""\
from dyknow import source

@source("wind")
def anemometer(from_us):
    valid_us = -(-from_us // {WIND_US}) * {WIND_US} + {WIND_PHASE_US}
    while True:
        yield valid_us, (1.0, 2.0)
        valid_us += {WIND_US}
"""


def spec_of_wind(folder: Path) -> Path:
    """A specification whose samples lie between the instants that others ask for, and the module of its source."""
    (folder / "anemometer.py").write_text(ANEMOMETER, encoding="utf-8")
    (spec := folder / "wind.kpl").write_text(WIND, encoding="utf-8")
    return spec


def noted(platform: "subprocess.Popen[str]", said: str) -> str:
    """The note of a platform that says this."""
    return next(line["text"] for line in lines(platform) if line["event"] == "note" and said in line["text"])


def test_a_label_of_ones_own_is_shared_by_who_means_the_same_and_refused_to_who_does_not(
    dyknow: Dyknow, tmp_path: Path
) -> None:
    other = tmp_path / "other.toml"
    other.write_text(IN_PERCENT, encoding="utf-8")
    gas, spec, watcher = str(EXAMPLES / "gas.toml"), str(EXAMPLES / "gas.kpl"), str(EXAMPLES / "watcher.kpl")
    sensor = dyknow.start("join", "--unit", "7", "--spec", spec, "--units", str(EXAMPLES / "sniffer.py"), "--json")
    specified = next(line for line in lines(sensor) if line["event"] == "specified")
    assert specified["exports"] == ["gas-level"]

    # queried without a file: the meaning comes with what platform 7 says of itself
    [latest] = dyknow.run("query", "gas-level")
    assert (latest["unit"], latest["label"]) == (7, "gas-level")
    assert 15.0 <= latest["value"]["value"] <= 65.0
    assert "ppm" in dyknow.raw("query", "gas-level")[0]
    watched = dyknow.run("watch", "gas-level", "--every", "500ms", "--count", "5")
    assert [each["valid_us"] - watched[0]["valid_us"] for each in watched] == [PERIOD_US * n for n in range(5)]
    assert all(15.0 <= each["value"]["value"] <= 65.0 for each in watched)
    [rate] = dyknow.run("hz", "gas-level", "--for", "3s")
    assert (rate["unit"], rate["rate_hz"]) == (7, 2.0)
    assert (rate["period_ms"], rate["loss"]) == (None, None), "its export declares no period"
    refused, _ = dyknow.raw("query", "gas-levl", code=1)
    assert "this node has gas-level" in " ".join(refused.split()), "and what it could have is not listed"
    by_time = {each["valid_us"]: each["value"]["value"] for each in watched}

    # imported and monitored on a platform that has the label from its file
    receiver = dyknow.start("join", "--unit", "8", "--spec", watcher, "--ontology", gas, "--json")
    seen: dict[int, float] = {}
    for line in lines(receiver):
        if line.get("stream") == "seen" and line["event"] == "sample" and line["value"] is not None:
            seen[line["valid_us"]] = line["value"]
        if line["event"] == "alarm-opened" and len(seen) >= 3:
            assert line["monitor"] == "clean"
            break
    spans = dyknow.run("query", "gas-level", "--between", "-3s", "-1s", "--unit", "7")
    assert len(spans) >= 4
    assert all(by_time.get(each["valid_us"], each["value"]["value"]) == each["value"]["value"] for each in spans)
    assert all(seen.get(each["valid_us"], each["value"]["value"]) == each["value"]["value"] for each in spans)
    [before] = dyknow.run("query", "gas-level", "--at", "-1s", "--unit", "7")
    assert before["valid_us"] % PERIOD_US == 0
    [graph] = dyknow.run("kpl", "graph", "--unit", "8")
    assert {"gas[uav7]", "seen", "clean"} <= {node["name"] for node in graph["nodes"]}
    [graph] = dyknow.run("kpl", "graph", "--unit", "7")
    assert "gas-level" in str(graph)
    shown = [each for each in dyknow.run("ontology", "show") if each["label"] == "gas-level"]
    assert [(each["units"], each["offered_by"], each["unit_of_measurement"]) for each in shown] == [
        ([7, 8], [7], "ppm")
    ]

    # refused to a platform that means something else: both say so, each with its own line
    third = dyknow.start("join", "--unit", "9", "--spec", watcher, "--ontology", str(other), "--json")
    told = noted(third, "label gas-level is not shared with 7: here it is gas in percent")
    assert "other.toml:2" in told
    told = noted(sensor, "label gas-level is not shared with 9: here it is gas in ppm")
    assert "gas.kpl:2" in told
    shown = [each for each in dyknow.run("ontology", "show", code=1) if each["label"] == "gas-level"]
    assert {each["unit_of_measurement"]: each["units"] for each in shown} == {"ppm": [7, 8], "percent": [9]}
    [refused] = dyknow.run("query", "gas-level", "--unit", "7", "--ontology", str(other), code=1)
    assert "other.toml:2" in str(refused)
    assert dyknow.run("query", "gas-level", "--unit", "7", "--ontology", gas)


def test_a_label_that_a_specification_declares_is_watched_and_measured_without_a_file(
    dyknow: Dyknow, tmp_path: Path
) -> None:
    platform = dyknow.start(
        "join",
        "--unit",
        "5",
        "--spec",
        str(spec_of_wind(tmp_path)),
        "--units",
        str(tmp_path / "anemometer.py"),
        "--json",
    )
    assert next(line for line in lines(platform) if line["event"] == "specified")["exports"] == ["local-wind"]
    [latest] = dyknow.run("query", "local-wind")
    assert latest["value"] == {"north": 1.0, "east": 2.0}
    [first, second] = dyknow.run("watch", "local-wind", "--count", "2")
    assert [each["value"] for each in (first, second)] == [latest["value"]] * 2
    assert first["valid_us"] % WIND_US == second["valid_us"] % WIND_US == WIND_PHASE_US
    [rate] = dyknow.run("hz", "local-wind", "--for", "2s")
    assert (rate["unit"], rate["rate_hz"]) == (5, 5.0), "its instants lie off the grid of the epoch"
    for command in ("query", "watch", "hz"):
        _, said = dyknow.raw(command, "kept-wind", code=1)
        assert "export kept-wind = STREAM" in " ".join(said.split()), "it is declared, and not exported"
    for command in ("watch", "hz"):
        _, said = dyknow.raw(command, "wind[self]", code=2)
        assert "dyknow query wind[self]" in " ".join(said.split())


def test_a_program_takes_labels_from_its_file_as_a_platform_and_as_a_client(dyknow: Dyknow, tmp_path: Path) -> None:
    other, gas = tmp_path / "other.toml", EXAMPLES / "gas.toml"
    other.write_text(IN_PERCENT, encoding="utf-8")
    sensor = dyknow.start(
        "join", "--unit", "7", "--spec", str(EXAMPLES / "gas.kpl"), "--units", str(EXAMPLES / "sniffer.py"), "--json"
    )
    assert next(line for line in lines(sensor) if line["event"] == "specified")
    with library.join("8", federation=dyknow.federation, ontology=gas) as platform:
        platform.declare("import gas-level from 7 as gas[uav7] with sample every 500, max delay 1000")
        platform.declare("stream seen = gas[uav7]")
        name, _, value = next(iter(platform.samples))
        assert (name, 15.0 <= value <= 65.0) == ("seen", True)
    with library.connect(federation=dyknow.federation, ontology=gas) as fed:
        [latest] = fed.query("gas-level", unit="7")
        assert 15.0 <= latest.value["value"] <= 65.0
    with library.connect(federation=dyknow.federation, ontology=other) as fed:
        refused = fed.query("gas-level", unit="7")
        assert not refused
        assert "other.toml:2" in refused.missing["7"]
    with library.join("9", federation=dyknow.federation, ontology=other) as platform:
        platform.declare(
            "import gas-level from 7 as gas[uav7] with sample every 500, max delay 1000\nstream seen = gas[uav7]"
        )
        note = next(each for each in platform.notes if "is not shared with 7" in each)
        assert "here it is gas in percent" in note
