"""`python -m bench.campaign --seeds 1-40 --jobs 2`: fly drawn situations in the simulated world, and judge each by where the vehicles really were.

A line for each seed, then a table by cause. `--keep` keeps all of it as lines of JSON in `bench/results`.
"""

import argparse
import json
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

from bench.campaign.running import CampaignRun, run
from bench.campaign.tables import by_cause, printed
from bench.machine import machine

_RESULTS = Path(__file__).parent.parent / "results"


def seeds(text: str) -> list[int]:
    """`1-40`, `7`, or `1-3,9`."""
    found: list[int] = []
    for part in text.split(","):
        first, _, last = part.partition("-")
        found += range(int(first), int(last or first) + 1)
    return found


def shown(found: CampaignRun, *, details: bool) -> str:
    """Its line, and what is wrong in it."""
    wrong = (
        ("breach", found.breaches), ("untold", found.untold), ("stuck", found.stuck), ("violation", found.violations),
        ("told", found.told), ("why not", found.explained),
    )  # fmt: skip
    return "\n".join([found.line(), *(f"        {name}: {each}" for name, all_ in wrong if details for each in all_)])


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m bench.campaign", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seeds", type=seeds, default=seeds("1-40"), help="1-40 (the default), 7, or 1-3,9")
    parser.add_argument("--jobs", type=int, default=1, help="processes at once (1)")
    parser.add_argument("--details", action="store_true", help="show what happened below each line")
    parser.add_argument("--keep", action="store_true", help="keep the runs as lines of JSON")
    parser.add_argument("--out", type=Path, default=_RESULTS, help="directory for that")
    asked = parser.parse_args()
    runs: list[CampaignRun] = []
    with ProcessPoolExecutor(asked.jobs) as pool:
        for found in pool.map(run, asked.seeds):
            print(shown(found, details=asked.details), flush=True)
            runs.append(found)
    rows = by_cause(runs)
    print(f"\n{printed(rows)}\n")
    cpu_s, flown_s = sum(each.cpu_s for each in runs), sum(each.flown_s for each in runs)
    print(
        f"{sum(each.is_met for each in runs)} of {len(runs)} met; {cpu_s / len(runs):.1f} CPU s a run "
        f"(most {max(each.cpu_s for each in runs):.1f}), {flown_s / len(runs):.0f} simulated s a run"
    )
    if asked.keep:
        path = asked.out / f"{datetime.now(UTC):%Y%m%dT%H%M%S}-campaign.jsonl"
        head = {"taken": datetime.now(UTC).isoformat(timespec="seconds"), "machine": machine()}
        lines = [head, *map(asdict, runs), *({"cause": row.cause, **row._asdict()} for row in rows)]
        path.write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")
        print(f"kept in {path}")
    return 0 if all(each.is_met for each in runs) else 1


if __name__ == "__main__":
    sys.exit(main())
