"""B14: what a platform process weighs, and how soon the command says what it can do."""

import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import psutil

from bench.rows import Figures, Limit, Options, Side
from dyknow.runtime.configuration.config import NodeConfig, SimulatedVehicleConfig, WireConfig

TITLE = "three platform processes of the scenario crossing, under a task; `dyknow --help`"
BARS = (
    Limit("rss_mb", 200.0, ours="platform"),
    Limit("uss_mb", 110.0, ours="platform"),
    Limit("seconds", 0.4, ours="help"),
    Limit("heavy_imports", 0.0, ours="help"),
)
PLATFORMS = 3
PATIENCE_S = 60.0
WARM_S = 10.0
"""How long the platforms fly under the task before they are weighed first."""

DYKNOW = Path(sys.executable).with_name("dyknow")
HEAVY = re.compile(r"\|\s+(zenoh|pymavlink|numpy|scipy)\b")


@contextmanager
def sides(options: Options) -> Iterator[dict[str, Side]]:
    with ExitStack() as stack:
        found: dict[str, Side] = {}
        if options.wants("platform"):
            found["platform"] = stack.enter_context(_platforms(options.effort))
        if options.wants("help"):
            found["help"] = _help
        yield found


@contextmanager
def _platforms(effort: float) -> Iterator[Callable[[], Figures]]:
    """Three processes, monitoring each other; the function says what the heaviest of them weighs now."""
    federation = f"bench-b14-{os.getpid()}"
    with tempfile.TemporaryDirectory() as directory, ExitStack() as stack:
        started = [_started(Path(directory), federation, index) for index in range(PLATFORMS)]
        for process in started:
            stack.callback(process.wait)
            stack.callback(process.terminate)
        for process in started:
            _found_all(process)
        delegated = [str(DYKNOW), "delegate", "monitor-proximity", "--to", "0", "--federation", federation]
        subprocess.run(delegated, check=True, stdout=subprocess.DEVNULL)
        time.sleep(WARM_S * effort)
        processes = [psutil.Process(process.pid) for process in started]

        def weighed() -> Figures:
            time.sleep(effort)
            found = [process.memory_full_info() for process in processes]
            return {
                "rss_mb": max(one.rss for one in found) / 1e6,
                "uss_mb": max(one.uss for one in found) / 1e6,
                "cpu_percent": max(process.cpu_percent() for process in processes),
            }

        yield weighed


def _started(directory: Path, federation: str, index: int) -> "subprocess.Popen[str]":
    config = NodeConfig(
        unit=str(index),
        wire=WireConfig(federation=federation),
        vehicle=SimulatedVehicleConfig(scenario="crossing", index=index, count=PLATFORMS, seed=1),
    )
    path = directory / f"{index}.json"
    path.write_text(config.model_dump_json(), encoding="utf-8")
    return subprocess.Popen(
        [sys.executable, "-m", "dyknow.runtime.node", "--vehicles", "dyknow.sim_uavs.simulated", "--config", str(path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def _found_all(process: "subprocess.Popen[str]") -> None:
    assert process.stdout is not None
    until = time.monotonic() + PATIENCE_S
    for line in process.stdout:
        if len(json.loads(line).get("units", ())) == PLATFORMS:
            return
        if time.monotonic() > until:
            break
    raise TimeoutError("the platforms do not find each other")


def _help() -> Figures:
    began, before = time.monotonic(), os.times()
    subprocess.run([DYKNOW, "--help"], check=True, stdout=subprocess.DEVNULL)
    seconds, after = time.monotonic() - began, os.times()
    return {
        "seconds": seconds,
        "cpu_s": after.children_user + after.children_system - before.children_user - before.children_system,
        "heavy_imports": float(len(HEAVY.findall(_imports()))),
    }


def _imports() -> str:
    """Every module that the command imports, as the interpreter lists them."""
    listing = {**os.environ, "PYTHONPROFILEIMPORTTIME": "1"}
    done = subprocess.run([DYKNOW, "--help"], env=listing, check=True, capture_output=True, text=True)
    return done.stderr
