"""`python -m bench.overtakes [--runs 200]`: Table 8.2 of the thesis and the reckless overtakes, printed and kept as JSON.

Each cell says the per cent of runs in which the overtake is recognised once and in time, with its Wilson interval at
95 %; a `-` behind it marks a cell that does not meet its bar. With raw relations there is no bar; in parentheses stands
how often any overtake is recognised.
"""

import argparse
import json
import sys
from datetime import UTC, datetime
from pathlib import Path

from bench.machine import machine
from bench.overtakes import reckless
from bench.overtakes.table import (
    ERRORS_M,
    PERIODS_MS,
    READINGS,
    RUNS,
    SPEEDS_M_S,
    THESIS,
    Cell,
    Counted,
    cells,
    counted,
    is_met,
    wilson,
)

_RESULTS = Path(__file__).parent.parent / "results"
_WIDE = 14


def measured(runs: int) -> dict[Cell, Counted]:
    found: dict[Cell, Counted] = {}
    for is_filtered in (True, False):
        for reading in READINGS:
            print(f"\n{'filtered' if is_filtered else 'raw'} relations, error read as {reading}, {runs} runs a cell")
            print("             " + "".join(f"{f'{error_m} m':{_WIDE}}" for error_m in ERRORS_M))
            for period_ms in PERIODS_MS:
                for speed_m_s in SPEEDS_M_S:
                    row = [Cell(speed_m_s, period_ms, error_m, reading, is_filtered) for error_m in ERRORS_M]
                    found |= {cell: counted(cell, runs) for cell in row}
                    said = "".join(f"{_said(cell, found[cell]):{_WIDE}}" for cell in row)
                    print(f"{speed_m_s} m/s {period_ms} ms  {said}", flush=True)
    return found


def _said(cell: Cell, found: Counted) -> str:
    percent = f"{100 * found.successes / found.runs:.0f}"
    if not cell.is_filtered:
        return f"{percent} ({100 * found.recognised / found.runs:.0f})"
    low, high = wilson(found.successes, found.runs)
    return f"{percent} [{100 * low:.0f}, {100 * high:.0f}]{'' if is_met(cell, found) else ' -'}"


def _print_thesis() -> None:
    print("the thesis' own, 10 runs a cell\n             " + "".join(f"{f'{each} m':{_WIDE}}" for each in ERRORS_M))
    for (speed_m_s, period_ms), row in THESIS.items():
        print(f"{speed_m_s} m/s {period_ms} ms  " + "".join(f"{each:<{_WIDE}}" for each in row))


def _reckless(runs: int) -> dict[str, dict[str, int]]:
    print(
        f"\nreckless overtakes, {reckless.PERIOD_MS} ms, error up to {reckless.ERROR_M:.0f} m: runs with each chronicle"
    )
    found = {}
    for situation in reckless.SITUATIONS:
        count = 5 * runs if situation == "decent" else runs
        found[situation] = {"runs": count, **reckless.counted(situation, count)}
        print(f"{situation:20}" + ", ".join(f"{name} {found[situation].get(name, 0)}" for name in _NAMES), flush=True)
    return found


_NAMES = ("runs", "overtake", *reckless.VARIANTS)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m bench.overtakes", description=__doc__.partition("\n")[0])
    parser.add_argument("--runs", type=int, default=RUNS, help=f"runs of each cell and situation ({RUNS})")
    parser.add_argument("--out", type=Path, default=_RESULTS, help="directory for the JSON")
    asked = parser.parse_args()
    _print_thesis()
    found = measured(asked.runs)
    seen = _reckless(asked.runs)
    report = {
        "taken": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": machine(),
        "table 8.2": [{**cell._asdict(), **each._asdict()} for cell, each in found.items()],
        "reckless": seen,
    }
    path = asked.out / f"{datetime.now(UTC):%Y%m%dT%H%M%S}-overtakes.json"
    path.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(f"kept in {path}")
    unmet = [cell for cell in cells(filtered=True) if not is_met(cell, found[cell])]
    unmet_reckless = [name for name in reckless.VARIANTS if seen[name].get(name, 0) < 0.95 * asked.runs]
    without_cause = sum(seen["decent"].get(name, 0) for name in reckless.VARIANTS)
    return 1 if unmet or unmet_reckless or without_cause else 0


if __name__ == "__main__":
    sys.exit(main())
