"""What a trial of a row of the benchmark shows: that it runs, and that its bars are about what it measures."""

from importlib import import_module
from importlib.util import find_spec
from math import isfinite
from pathlib import Path
from typing import Any

import bench
from bench.__main__ import measured
from bench.rows import Options
from bench.turn import module_of

UNIT = ("b04", "b05", "b06", "b07", "b08", "b09", "b10", "b15", "b16", "b18", "b19", "b20", "b21")
LIVE = ("b01", "b02", "b03", "b11", "b12", "b13", "b14", "b17", "b22")
"""They have processes of their own, which `tests/live/bench` starts."""
TRIAL = Options(rounds=1, effort=0.01)


def row_of(name: str) -> Any:
    return import_module(module_of(Path(bench.__file__).parent, name))


def extras(name: str) -> dict[str, str]:
    """The sides of a row that need a module which not every installation has, and that module."""
    return dict(getattr(row_of(name), "EXTRA", {}))


def absent(name: str) -> set[str]:
    return {side for side, module in extras(name).items() if find_spec(module) is None}


def check_trial(name: str) -> None:
    """One round of each side, at a hundredth of the effort; how long it takes is not judged, nor whether a bar is met."""
    row, found = row_of(name), measured(name, TRIAL)
    sides, missing = found["medians"], absent(name)
    check_figures(sides)
    assert not missing & sides.keys()
    assert extras(name).keys() - missing <= sides.keys()
    assert set(getattr(row, "QUIET", ())) <= sides.keys()
    assert row.BARS
    peers = [getattr(bar, "peer", bar.ours) for bar in row.BARS]
    assert set(peers) <= sides.keys() | missing
    assert len(found["bars"]) == sum(peer not in missing for peer in peers)
    for bar in row.BARS:
        assert {bar.metric, *getattr(row, "COMPARED", ())} <= sides[bar.ours].keys()


def check_figures(sides: dict[str, dict[str, float]]) -> None:
    """Each side has figures, which are numbers; one that counts what came has got something."""
    assert sides
    for side, figures in sides.items():
        assert figures, side
        assert not {metric: value for metric, value in figures.items() if not isfinite(value)}, side
        assert figures.get("received", 1.0) > 0.0, side
