"""`python -m bench [ROW ...]`: measure rows against their peers, print the table, keep the JSON.

A row is a module of one of the drawers here (b01, b02, ...); `callbacks` and `express` measure what the edge chose
between. `--against DIR` measures rows of this tree and of another checkout in turn. A bar that is not met is reported;
nothing here is a timed test.
"""

import argparse
import json
import sys
from dataclasses import asdict
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from typing import Any, cast

from bench.against import compared
from bench.compare import interleave, judge, medians
from bench.machine import machine
from bench.rows import Options, Row
from bench.turn import module_of

_HERE = Path(__file__).parent
_WIDEST = 8
"""With more metrics than that each is a line and each side a column."""


def rows() -> list[str]:
    return sorted(path.stem for path in _HERE.glob("*/b[0-9][0-9].py"))


def measured(name: str, options: Options) -> dict[str, Any]:
    row = cast("Row", import_module(module_of(_HERE, name)))
    print(f"{name}  {row.TITLE}{' (a trial: its figures say nothing)' if options.is_trial else ''}", flush=True)
    with row.sides(options) as sides:
        wanted = {side: run for side, run in sides.items() if options.wants(side)}
        found = interleave(wanted, options.rounds, warm=0 if options.is_trial else 1)
    middle = medians(found)
    judged = [verdict for bar in row.BARS if (verdict := judge(bar, found)) is not None]
    _show({side: figures for side, figures in middle.items() if side not in getattr(row, "QUIET", ())}, judged)
    return {
        "row": name,
        "title": row.TITLE,
        "rounds": options.rounds,
        "medians": middle,
        "bars": [verdict._asdict() for verdict in judged],
        "figures": found,
    }


def _show(middle: dict[str, dict[str, float]], judged: list[Any]) -> None:
    metrics = list(dict.fromkeys(metric for figures in middle.values() for metric in figures))
    cells = {(side, metric): f"{figures[metric]:,.2f}" for side, figures in middle.items() for metric in figures}
    if len(metrics) > _WIDEST:
        _table(metrics, list(middle), {(metric, side): said for (side, metric), said in cells.items()})
    else:
        _table(list(middle), metrics, cells)
    for verdict in judged:
        interval = f"[{verdict.low:.2f}, {verdict.high:.2f}]"
        print(f"  {'met    ' if verdict.met else 'NOT met'}  {verdict.what}: {verdict.value:.2f} {interval}")
    print(flush=True)


def _table(lines: list[str], columns: list[str], cells: dict[tuple[str, str], str]) -> None:
    width = max(map(len, lines), default=4)
    widths = [max(len(column), 14) for column in columns]
    for line in ("", *lines):
        said = ((cells.get((line, column), "") if line else column) for column in columns)
        print(f"  {line:{width}}  " + "  ".join(f"{each:>{wide}}" for each, wide in zip(said, widths, strict=True)))


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m bench", description=__doc__.partition("\n")[0])
    parser.add_argument("rows", nargs="*", metavar="ROW", help=f"of {', '.join(rows())}; default: all")
    parser.add_argument("--rounds", type=int, default=15, help="rounds of every side, or turns of every tree (15)")
    parser.add_argument("--effort", type=float, default=1.0, help="length of a round as a multiple of the usual")
    parser.add_argument("--side", action="append", default=[], help="measure this side only; repeatable")
    parser.add_argument("--out", type=Path, default=_HERE / "results", help="directory for the JSON")
    parser.add_argument("--against", type=Path, metavar="DIR", help="measure a checkout in DIR as well, A B A B")
    asked = parser.parse_args()
    options = Options(asked.rounds, asked.effort, frozenset(asked.side))
    found = [
        compared(name, asked.against, options) if asked.against else measured(name, options)
        for name in asked.rows or rows()
    ]
    report = {
        "taken": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": machine(),
        "options": {**asdict(options), "sides": sorted(options.sides)},
        "rows": found,
    }
    asked.out.mkdir(parents=True, exist_ok=True)
    names = "-".join([*asked.rows, *(["against"] if asked.against else [])]) or "all"
    path = asked.out / f"{datetime.now(UTC):%Y%m%dT%H%M%S}-{names}.json"
    path.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(f"kept in {path}")
    return 0 if all(bar["met"] for row in found for bar in row["bars"]) else 1


if __name__ == "__main__":
    sys.exit(main())
