"""One turn of a row in a process of its own: `python -P bench/turn.py ROW EFFORT SIDES`, with the tree as directory.

Prints the figures of each side as JSON. It imports the `bench` of the directory it runs in, of this or of an earlier
state, and says nothing else on standard output.
"""

import json
import os
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

WARM, COUNTED = 1, 3
"""Rounds of every side in a turn; the first ones import and compile."""


def module_of(bench: Path, row: str) -> str:
    """The module of a row, in whichever drawer below `bench` it lies."""
    found = next((path for path in sorted(bench.rglob("*.py")) if path.stem == row), None)
    if found is None:
        raise SystemExit(f"no row {row!r} in {bench}")
    return ".".join(["bench", *found.relative_to(bench).with_suffix("").parts])


def own_sides(row: Any) -> list[str]:
    """The sides of a row that are about us and not about a peer: those its bars are about."""
    return list(dict.fromkeys(bar.ours for bar in row.BARS))


def main() -> None:
    name, effort, sides = sys.argv[1:]
    out = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    row = import_module(module_of(Path.cwd() / "bench", name))
    wanted = frozenset(json.loads(sides) or own_sides(row))
    options = import_module("bench.rows").Options(COUNTED, float(effort), wanted)
    with row.sides(options) as offered:
        rounds = {
            side: [run() for _ in range(WARM + COUNTED)][WARM:] for side, run in offered.items() if side in wanted
        }
    json.dump(rounds, out)
    out.close()


if __name__ == "__main__":
    main()
