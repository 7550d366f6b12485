"""Vehicles and recordings of one's own, rosters with certificates, and the demo."""

import os
import socket
from pathlib import Path

import pytest

from tests.live.command_line.command import Dyknow, lines

pytestmark = pytest.mark.live


def test_a_mavlink_vehicle_joins_and_is_queried(dyknow: Dyknow) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    joined = dyknow.start("join", "--unit", "visitor", "--mavlink", f"udpin:127.0.0.1:{port}", "--json")
    told = next(lines(joined))
    assert (told["event"], told["unit"]) == ("joined", "visitor")
    assert "heli-position" in told["labels"]
    dyknow.run("up", "1", "--scenario", "hover", "--gcs", f"127.0.0.1:{port}", "--detach")
    [seen] = dyknow.until("query", "heli-altitude", "--unit", "visitor", unit="visitor", label="heli-altitude")
    assert 55 < seen["value"]["altitude_m"] < 65


def test_a_port_that_is_taken_is_told_with_its_remedy_and_nothing_else(dyknow: Dyknow) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        endpoint = f"udpin:127.0.0.1:{taken.getsockname()[1]}"
        out, err = dyknow.raw("join", "--unit", "visitor", "--mavlink", endpoint, code=3)
    assert "joined" not in out
    assert f"MAVLink endpoint {endpoint}" in err
    assert "choose another port" in err
    assert "Traceback" not in err


def test_two_recordings_share_one_time(dyknow: Dyknow) -> None:
    data = os.environ.get("DYKNOW_FLIGHT_DATA")
    if data is None:
        pytest.skip("DYKNOW_FLIGHT_DATA names no directory with flight logs")
    import time

    epoch = str(time.time_ns() // 1000 + 5_000_000)
    for unit, name, start in (("0", "dronekit_copter_flight.tlog", "600s"), ("1", "dronekit_la_log171.bin", "5s")):
        joined = dyknow.start(
            "join", "--unit", unit, "--replay", f"{data}/{name}", "--from", start, "--epoch", epoch, "--json"
        )
        assert next(lines(joined))["unit"] == int(unit)
    found = dyknow.until("query", "heli-position", label="heli-position")
    assert {line["unit"] for line in found} <= {0, 1}


def test_a_federation_with_a_roster_and_certificates_listens_to_its_members_alone(
    dyknow: Dyknow, tmp_path: Path
) -> None:
    roster = tmp_path / "trust" / "roster.toml"
    trusted = Dyknow(dyknow.directory, dyknow.federation, ("--roster", str(roster)))
    try:
        _roster(trusted, "init", "0", "1")
        [ready] = trusted.run("up", "2", "--scenario", "hover", "--discover", "none", "--detach")
        assert ready["units"] == [0, 1]
        assert [line["unit"] for line in trusted.until("ls", state="alive")] == [0, 1]
        assert {line["unit"] for line in trusted.run("query", "battery")} == {0, 1}
        [agreed] = trusted.run("delegate", "monitor-proximity", "--to", "1")
        assert agreed["performative"] == "agree"
        _, err = dyknow.raw("ls", code=2)
        assert "roster" in err
    finally:
        trusted.close()


def test_without_its_roster_a_federation_that_has_one_is_out_of_reach_and_the_command_names_the_remedy(
    dyknow: Dyknow, tmp_path: Path
) -> None:
    roster = tmp_path / "trust" / "roster.toml"
    signed = Dyknow(dyknow.directory, dyknow.federation, ("--roster", str(roster)))
    try:
        _roster(signed, "init", "0")
        signed.run("up", "1", "--scenario", "hover", "--detach")
        assert signed.until("ls", state="alive")[0]["unit"] == 0
        _, err = dyknow.raw("ls", code=1)
        assert "--roster" in err
    finally:
        signed.close()


def _roster(dyknow: Dyknow, what: str, *units: str) -> None:
    import subprocess
    import sys

    subprocess.run(
        [sys.executable, "-c", "from dyknow.console.main import main; main()", "roster", what, *units, *dyknow.options,
         "--federation", dyknow.federation],
        check=True, capture_output=True, timeout=60,
    )  # fmt: skip


def test_the_demo_does_every_step_and_leaves_nobody_behind(dyknow: Dyknow) -> None:
    said = dyknow.run("demo")
    assert [line["step"] for line in said[:-1]] == [
        "up", "ls", "delegate", "encounter", "avoidance", "queries", "cancel", "down",
    ]  # fmt: skip
    assert all(line["ok"] for line in said)
    summary = said[-1]
    assert summary["event"] == "summary"
    assert summary["smallest_separation_m"] > 10.0
    assert summary["took_ms"] < 120_000, "under a minute on a machine that has nothing else to do"
