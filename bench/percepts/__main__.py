"""`python -m bench.percepts`: processor seconds a second with 50 to 400 percepts; `--hours 2`: memory; table and JSON.

There are five vehicles for three percepts, since two of five are hidden. They drive in a town that grows with their number,
or `packed` in that of 50 percepts, where each is near more objects. Next to the time stands what it was spent for: how many
conditions were evaluated at a tick.
"""

import argparse
import gc
import json
import sys
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import numpy as np
import psutil

from bench.machine import machine
from bench.percepts.drives import CYCLE_S, PERIOD_US, SEEN_S, Drive, drives, percept, ticks, town_for
from dyknow.anchoring.links.structures import ObjectLinkage
from dyknow.anchoring.ready import ready_specification

_RESULTS = Path(__file__).parent.parent / "results"
NUMBERS: Final = (50, 100, 200, 400)
"""Percepts that are there at a time, on average."""
SETTLES_S: Final = 10.0
"""Not measured: the first objects are made."""
BAR: Final = 0.5
"""Of one core, for 200 percepts."""
APPEAR: Final = 10_000
LIVES_S: Final = 10.0
SLOW_US: Final = 500_000
FLAT_MB: Final = 5.0
"""Resident memory may differ by so much between the first quarter and the end."""


def vehicles_for(percepts: int) -> int:
    """How many vehicles have to drive so that on average this number of percepts is seen."""
    return round(percepts * CYCLE_S / SEEN_S)


def cost(percepts: int, seconds: float, *, roads: bool, packed: bool) -> dict[str, Any]:
    """Of one run; percepts are made before they are counted."""
    network = town_for(vehicles_for(NUMBERS[0] if packed else percepts))
    vehicles, rng = vehicles_for(percepts), np.random.default_rng((percepts, packed))
    made = list(ticks(drives(network, vehicles, rng), SETTLES_S + seconds, rng))
    linkage = ObjectLinkage(ready_specification(network if roads else None), PERIOD_US)
    settled = round(SETTLES_S * 1e6 / PERIOD_US)
    for valid_us, seen in made[:settled]:
        linkage.on_percepts(valid_us, seen)
    gc.collect()
    evaluations, slowest_s, began_s = 0, 0.0, time.process_time()
    for valid_us, seen in made[settled:]:
        tick_s = time.process_time()
        linkage.on_percepts(valid_us, seen)
        slowest_s = max(slowest_s, time.process_time() - tick_s)
        evaluations += sum(each.evaluations for some in linkage.into.values() for each in some)
    spent_s = time.process_time() - began_s
    shown = sum(len(each) for _, each in made[settled:]) / len(made[settled:])
    return {
        "percepts": percepts, "shown": round(shown, 1), "vehicles": vehicles, "roads": roads, "packed": packed,
        "cpu_s_per_s": round(spent_s / seconds, 4), "slowest_tick_ms": round(slowest_s * 1e3, 1),
        "evaluations_per_tick": round(evaluations / len(made[settled:]), 1),
        "us_per_percept": round(spent_s / len(made[settled:]) / shown * 1e6, 1),
    }  # fmt: skip


def show_costs(seconds: float) -> list[dict[str, Any]]:
    print(
        f"{'vehicles':>8} {'roads':>6} {'packed':>6} {'s/s':>8} {'us/percept':>11} {'evaluations':>12} {'slowest ms':>11}"
    )
    rows = []
    for packed in (False, True):
        for roads in (False, True):
            for percepts in NUMBERS:
                row = cost(percepts, seconds, roads=roads, packed=packed)
                rows.append(row)
                print(
                    f"{percepts:8} {'yes' if roads else 'no':>6} {'yes' if packed else 'no':>6} {row['cpu_s_per_s']:8.3f} "
                    f"{row['us_per_percept']:11.0f} {row['evaluations_per_tick']:12.1f} {row['slowest_tick_ms']:11.1f}",
                    flush=True,
                )
    return rows


def hours(count: float, appear: int = APPEAR) -> dict[str, Any]:
    """That long, twice a second, with percepts that appear and vanish, each after 10 s; resident memory twenty times."""
    network = town_for(vehicles_for(NUMBERS[0]))
    rng = np.random.default_rng(1)
    linkage = ObjectLinkage(ready_specification(network), SLOW_US)
    process, lasts_us = psutil.Process(), round(count * 3600e6)
    begins_us = np.sort(rng.uniform(0.0, lasts_us - LIVES_S * 1e6, appear)).tolist()
    live: list[tuple[str, int, Drive]] = []
    appeared = objects = 0
    memory: list[dict[str, float]] = []
    began_s = time.process_time()
    for valid_us in range(0, lasts_us, SLOW_US):
        while appeared < appear and begins_us[appeared] <= valid_us:
            [drive] = drives(network, 1, rng, 200.0)
            live.append((f"vp{appeared}", valid_us, drive))
            appeared += 1
        seen = [percept(name, valid_us, drive.at((valid_us - since_us) / 1e6), rng) for name, since_us, drive in live]
        outcome = linkage.on_percepts(valid_us, seen)
        objects += sum(event.kind == "established" for event in outcome.events)
        live = [each for each in live if valid_us - each[1] < LIVES_S * 1e6]
        if (valid_us + SLOW_US) % (lasts_us // 20) == 0:
            gc.collect()
            resident_mb = process.memory_info().rss / 1e6
            memory.append({"hours": (valid_us + SLOW_US) / 3600e6, "resident_mb": round(resident_mb, 2)})
            print(f"{memory[-1]['hours']:6.2f} h  {resident_mb:8.1f} MB  {appeared:6} percepts", flush=True)
    quarter, end = memory[len(memory) // 4 - 1]["resident_mb"], memory[-1]["resident_mb"]
    return {
        "hours": count, "percepts": appeared, "established": objects, "memory": memory, "grows_mb": round(end - quarter, 2),
        "cpu_s": round(time.process_time() - began_s, 1), "met": end - quarter <= FLAT_MB,
    }  # fmt: skip


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m bench.percepts", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=20.0, help="of each run that are measured (20)")
    parser.add_argument("--hours", type=float, default=0.0, help="instead: resident memory over this long")
    parser.add_argument("--out", type=Path, default=_RESULTS, help="directory for the JSON")
    chosen = parser.parse_args()
    taken = datetime.now(UTC)
    report: dict[str, Any] = {
        "taken": taken.isoformat(timespec="seconds"),
        "command": " ".join(["python -m bench.percepts", *sys.argv[1:]]),
        "machine": machine(),
    }
    if chosen.hours:
        report["memory"] = hours(chosen.hours)
        met = report["memory"]["met"]
    else:
        report["costs"] = show_costs(chosen.seconds)
        met = all(row["cpu_s_per_s"] <= BAR for row in report["costs"] if row["percepts"] <= 200)
    chosen.out.mkdir(parents=True, exist_ok=True)
    path = chosen.out / f"{taken:%Y%m%dT%H%M%S}-percepts.json"
    path.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(f"{'met' if met else 'NOT met'}; kept in {path}")
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
