"""`python -m bench.crossings [--runs 500]`: turns in simulated crossings, and straight passes, twice as many."""

import argparse
import json
import sys
from datetime import UTC, datetime
from pathlib import Path

from bench.crossings.recognition import counted
from bench.machine import machine

_RESULTS = Path(__file__).parent.parent / "results"


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m bench.crossings", description=__doc__.partition("\n")[0])
    parser.add_argument("--runs", type=int, default=500, help="turns (500)")
    parser.add_argument("--out", type=Path, default=_RESULTS, help="directory for the JSON")
    asked = parser.parse_args()
    found = []
    for hidden in (False, True):
        for straight in (False, True):
            runs = 2 * asked.runs if straight else asked.runs
            made = {"right": 0, "predicted": 0, "wrong": 0, **counted(runs, straight=straight, hidden=hidden)}
            found.append({"straight": straight, "hidden": hidden, "runs": runs, **made})
            what = f"{'straight' if straight else 'turns':9}{'hidden in the crossing' if hidden else 'anchored':24}"
            print(what + "  ".join(f"{name} {number}" for name, number in {"runs": runs, **made}.items()), flush=True)
    path = asked.out / f"{datetime.now(UTC):%Y%m%dT%H%M%S}-crossings.json"
    report = {"taken": datetime.now(UTC).isoformat(timespec="seconds"), "machine": machine(), "passes": found}
    path.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(f"kept in {path}")
    return 0 if all(one["right"] >= 0.98 * one["runs"] and not one["wrong"] for one in found) else 1


if __name__ == "__main__":
    sys.exit(main())
