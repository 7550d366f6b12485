"""`python -m bench.load UNITS [--busy N] [--seconds S]`: UAVs that monitor each other, on more or less machine than they need.

Platforms are started with `dyknow up`, in processes of their own, and asked to monitor proximity. Measured are how long
until every monitor is fresh, processor time, what `ls` and `monitors` report and how long they take: at rest, beside
processes that do nothing but run, and until all is fresh again afterwards. The table is printed and kept as JSON.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import psutil

from bench.machine import machine

_RESULTS = Path(__file__).parent / "results"
_CLI = "from dyknow.console.main import main; main()"


class Fleet:
    """Platforms of one federation of their own, and what they cost."""

    def __init__(self, units: int) -> None:
        self.units, self.federation = units, f"load{os.getpid()}"
        self.up_s, _ = self.call("up", str(units), "--scenario", "hover", "--seed", "5", "--detach")
        self.processes = [each for each in psutil.process_iter(["cmdline"]) if self.federation in _line(each)]

    def call(self, *words: str) -> tuple[float, list[dict[str, Any]]]:
        """Run a command: how long it took, and its records."""
        began = time.monotonic()
        argv = [sys.executable, "-c", _CLI, *words, "--federation", self.federation, "--json"]
        done = subprocess.run(argv, capture_output=True, text=True, check=False)
        return time.monotonic() - began, [json.loads(line) for line in done.stdout.splitlines() if line[:1] == "{"]

    def seen(self) -> dict[str, Any]:
        """What `ls` and `monitors` report of it now, and how long they take."""
        ls_s, listed = self.call("ls")
        monitors_s, monitors = self.call("monitors")
        platforms = [each for each in listed if "state" in each]
        return {
            "ls_s": round(ls_s, 2),
            "states": dict(Counter(each["state"] for each in platforms)),
            "too busy": sum("too busy" in json.dumps(each.get("conditions", ())) for each in platforms),
            "monitors_s": round(monitors_s, 2),
            "inputs": dict(Counter(each["inputs"] for each in monitors if "inputs" in each)),
        }

    def used(self, seconds: float) -> dict[str, float]:
        """Processors used for so long, all platforms together, and the memory of the greatest."""
        before, began = self._cpu_s(), time.monotonic()
        time.sleep(seconds)
        cores = (self._cpu_s() - before) / (time.monotonic() - began)
        return {
            "cores": round(cores, 2),
            "most_mb": round(max(each.memory_info().rss for each in self.processes) / 1e6),
        }

    def _cpu_s(self) -> float:
        return sum(sum(each.cpu_times()[:2]) for each in self.processes)

    def fresh_s(self, at_most_s: float) -> float | None:
        """How long until every monitor of every pair, two each, is fresh."""
        began = time.monotonic()
        passed = 0.0
        while passed < at_most_s:
            found = self.seen()["inputs"]
            passed = time.monotonic() - began
            if found == {"fresh": found.get("fresh", 0)} and found.get("fresh", 0) >= 2 * self.units * (self.units - 1):
                return round(passed, 1)
        return None


def _line(process: psutil.Process) -> str:
    return " ".join(process.info["cmdline"] or ())


@contextmanager
def busy(processes: int) -> Iterator[None]:
    """Processes that compute without a pause."""
    running = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(processes)]
    try:
        yield
    finally:
        for each in running:
            each.kill()
            each.wait()


def measured(units: int, loops: int, seconds: float) -> dict[str, Any]:
    fleet = Fleet(units)
    try:
        found: dict[str, Any] = {"units": units, "up_s": round(fleet.up_s, 1)}
        fleet.call("delegate", "monitor-proximity", "--to", "0")
        found["fresh_s"] = fleet.fresh_s(60.0)
        found["rest"] = [{**fleet.used(20.0), **fleet.seen()} for _ in range(2)]
        if loops:
            began = time.monotonic()
            with busy(loops):
                found["busy"] = []
                while time.monotonic() < began + seconds:
                    found["busy"].append({**fleet.used(5.0), **fleet.seen()})
            found["fresh_again_s"] = fleet.fresh_s(60.0)
            found["after"] = {**fleet.used(10.0), **fleet.seen()}
        return found
    finally:
        fleet.call("down")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m bench.load", description=__doc__)
    parser.add_argument("units", type=int)
    parser.add_argument("--busy", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=60.0)
    chosen = parser.parse_args()
    about = {"machine": machine(), "at": datetime.now(UTC).isoformat(timespec="seconds")}
    found = measured(chosen.units, chosen.busy, chosen.seconds)
    for name, value in found.items():
        for line in value if isinstance(value, list) else [value]:
            sys.stdout.write(f"{name:14} {line}\n")
    path = _RESULTS / f"{datetime.now(UTC):%Y%m%dT%H%M%S}-load-{chosen.units}-{chosen.busy}.json"
    path.write_text(json.dumps({**about, **found}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
