"""`python -m bench.encounters [--cases LIST] [--only REGEX]`: fly encounters of ArduCopters, print the table, keep it as JSON.

Each is flown in real time, by platforms in processes of their own; `DYKNOW_SITL` names the folder with ArduCopter.
"""

import argparse
import json
import re
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from bench.encounters.arducopter import folder
from bench.encounters.cases import LISTS, Case
from bench.encounters.encounters import flown
from bench.encounters.judging import Flown
from bench.machine import machine

_RESULTS = Path(__file__).parent.parent / "results"


def line(found: Flown) -> str:
    factors = " ".join("-" if factor is None else f"{factor:.2f}" for factor in found.factors)
    stops = " ".join(str(count) for count in found.stops)
    neither = "" if found.neither_s is None else f"  neither can: {found.least_at_s - found.neither_s:.1f} s before"
    if found.told_s:
        neither += "  told " + " ".join("-" if told is None else f"{told:.1f} s" for told in found.told_s)
    met = ("met    " if found.met else "NOT met") if found.counts else "too slow"
    apart = f"{found.least_m:6.1f} m ({found.level_m:.1f}, {found.upright_m:.1f})"
    latency = " ".join("-" if each is None else f"{each:.2f}" for each in found.latency_s)
    return f"{met}  {found.case.name:52}  {apart:24}  x {factors:14}  stops {stops}  latency {latency}{neither}"


def _tried(case: Case) -> Flown:
    """Fly it; a machine that was too busy to get it started, or to fly it in real time, gets a second try."""
    try:
        found = flown(case)
    except TimeoutError:
        return flown(case)
    return found if found.counts else flown(case)


def _commit() -> str:
    """Of this tree; with a plus where it has been changed since."""
    git = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--abbrev=10", "--dirty=+"]
    return subprocess.run(git, capture_output=True, text=True, check=False).stdout.strip()


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m bench.encounters", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--cases", choices=LISTS, default="common", help="which list (common)")
    parser.add_argument("--only", default="", help="cases whose name matches this regular expression")
    parser.add_argument("--jobs", type=int, default=1, help="how many at once (1); the machine must keep up")
    parser.add_argument("--out", type=Path, default=_RESULTS, help="directory for the JSON")
    parser.add_argument("--tracks", action="store_true", help="keep where each was, too, twice a second")
    asked = parser.parse_args()
    try:
        folder()
    except LookupError as missing:
        parser.error(str(missing))
    report: dict[str, Any] = {
        "taken": datetime.now(UTC).isoformat(timespec="seconds"), "commit": _commit(), "machine": machine(),
        "command": " ".join(["python -m bench.encounters", *sys.argv[1:]]), "encounters": [],
    }  # fmt: skip
    results: list[dict[str, Any]] = report["encounters"]
    asked.out.mkdir(parents=True, exist_ok=True)
    path = (
        asked.out
        / f"{datetime.now(UTC):%Y%m%dT%H%M%S}-encounters{'' if asked.cases == 'common' else f'-{asked.cases}'}.json"
    )
    with ProcessPoolExecutor(asked.jobs) as pool:
        flying = [
            (case, pool.submit(_tried, case)) for case in LISTS[asked.cases]() if re.search(asked.only, case.name)
        ]
        for case, flight in flying:
            if (wrong := flight.exception()) is not None:
                print(f"not flown: {case.name}: {wrong}", flush=True)
                continue
            found = flight.result()
            print(line(found), flush=True)
            results.append({**asdict(found), "case": found.case._asdict(), "met": found.met, "counts": found.counts})
            if not asked.tracks:
                results[-1].pop("track")
            path.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(f"{sum(each['met'] for each in results)} of {len(results)} met; kept in {path}")
    return 0 if len(results) == len(flying) and all(each["met"] for each in results) else 1


if __name__ == "__main__":
    sys.exit(main())
