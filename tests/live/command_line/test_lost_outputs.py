"""A full disk, a closed terminal and a reader that has gone end no platform, and each is reported."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from dyknow.runtime.configuration.config import NodeConfig, SimulatedVehicleConfig, WireConfig
from tests.live.command_line.command import PATIENCE_S, Dyknow, gone, lines

pytestmark = pytest.mark.live
FULL = Path("/dev/full")


def test_a_platform_on_a_full_disk_flies_on_and_is_listed_with_what_it_lost(dyknow: Dyknow, tmp_path: Path) -> None:
    config = NodeConfig(
        unit="0",
        wire=WireConfig(federation=dyknow.federation),
        vehicle=SimulatedVehicleConfig(),
        journal=FULL,
    )
    (tmp_path / "0.json").write_text(config.model_dump_json())
    command = [
        sys.executable,
        "-m",
        "dyknow.runtime.node",
        "--vehicles",
        "dyknow.sim_uavs.simulated",
        "--config",
        str(tmp_path / "0.json"),
    ]
    with FULL.open("wb") as full:
        platform = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=full, stderr=full)
    try:
        (listed,) = dyknow.until("ls", unit=0, state="alive")
        for _ in range(20):
            texts = [condition["text"] for condition in listed.get("conditions", ())]
            if len(texts) == 2:
                break
            (listed,) = dyknow.run("ls")
        assert sorted(text.partition(":")[0] for text in texts) == [
            "records of this platform cannot be written",
            "there is no journal",
        ]
        assert all("No space left on device" in text for text in texts)
        shown, _ = dyknow.raw("ls")
        assert "No space left on device" in " ".join(shown.split())
        assert dyknow.run("query", "heli-position", "--unit", "0"), "and it serves what it knows"
        assert platform.poll() is None
        platform.send_signal(signal.SIGTERM)
        assert platform.wait(timeout=PATIENCE_S) == 0
    finally:
        platform.kill()
        platform.wait(timeout=PATIENCE_S)


def test_a_terminal_that_is_closed_leaves_the_platforms_to_down(dyknow: Dyknow) -> None:
    up = dyknow.start("up", "2", "--scenario", "hover", "--json")
    pids = list(next(lines(up))["pids"].values())
    assert up.stdout is not None
    assert up.stderr is not None
    up.stdout.close()
    up.stderr.close()
    up.send_signal(signal.SIGHUP)
    subprocess.run(["kill", "-KILL", str(pids[0])], check=True)
    until = time.monotonic() + PATIENCE_S
    while {line["unit"]: line["state"] for line in dyknow.run("ls")} != {0: "gone", 1: "alive"}:
        assert time.monotonic() < until
    assert up.poll() is None
    assert dyknow.run("down") == [{"event": "stopped", "units": [1], "ended_before": [0]}]
    assert up.wait(timeout=PATIENCE_S) == 130
    assert gone(pids)


def test_a_join_whose_terminal_was_closed_is_found_and_ended_by_down(dyknow: Dyknow) -> None:
    joined = dyknow.start("join", "--unit", "7", "--mavlink", "udpin:127.0.0.1:0", "--json")
    assert joined.stdout is not None
    assert joined.stderr is not None
    assert next(lines(joined))["event"] == "joined"
    (platform,) = psutil.Process(joined.pid).children()
    joined.stdout.close()
    joined.stderr.close()
    joined.send_signal(signal.SIGHUP)
    assert [line["unit"] for line in dyknow.until("ls", state="alive")] == [7]
    assert joined.poll() is None
    assert dyknow.run("down") == [{"event": "stopped", "units": [7]}]
    assert joined.wait(timeout=PATIENCE_S) == 130
    assert gone([platform.pid])
    assert dyknow.run("down", code=1) == [{"event": "stopped", "units": []}]
