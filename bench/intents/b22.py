"""B22: from the position that shows a meeting to the order, and to the motion: three vehicles, a process each, over Zenoh."""

import json
import os
import re
import secrets
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Final

from bench.rows import Figures, Limit, Options, Side

TITLE = (
    "three vehicles, a process each: from the position that shows a meeting to the order, and until the motion shows it"
)
BARS = (Limit("to_order_ms", 150.0),)
FLIGHTS: Final = 5
PATIENCE_S: Final = 90.0
_NOTE = re.compile(r"ordered ([0-9.]+) s after the position that shows the meeting, seen in motion ([0-9.]+) s")


@contextmanager
def sides(options: Options) -> Iterator[dict[str, Side]]:
    yield {"ours": lambda: _measured(max(1, round(FLIGHTS * options.effort)))}


def _measured(flights: int) -> Figures:
    found = [taken for at in range(flights) for taken in _flown(at + 1)]
    if not found:
        raise RuntimeError("nobody gave way; look whether the scenario crossing still has a meeting")
    return {
        "to_order_ms": 1000.0 * median(order_s for order_s, _ in found),
        "to_order_most_ms": 1000.0 * max(order_s for order_s, _ in found),
        "to_motion_ms": 1000.0 * median(motion_s for _, motion_s in found),
        "manoeuvres": float(len(found)),
    }


def _flown(seed: int) -> list[tuple[float, float]]:
    """One flight of the scenario `crossing`: seconds to the order and to the motion of each manoeuvre."""
    with tempfile.TemporaryDirectory() as directory:
        federation = f"b22-{secrets.token_hex(4)}"
        _run(directory, federation, "up", "3", "--scenario", "crossing", "--seed", str(seed), "--detach")
        try:
            _run(directory, federation, "delegate", "monitor-proximity", "--to", "0")
            return _awaited(Path(directory) / "dyknow" / federation / "units")
        finally:
            _run(directory, federation, "down")


def _run(directory: str, federation: str, command: str, *words: str) -> None:
    kept = {name: value for name, value in os.environ.items() if not name.startswith("DYKNOW_")}
    dyknow = str(Path(sys.executable).with_name("dyknow"))
    subprocess.run(
        [dyknow, command, "--federation", federation, *words],
        check=True, stdout=subprocess.DEVNULL, env={**kept, "XDG_RUNTIME_DIR": directory}, timeout=PATIENCE_S,
    )  # fmt: skip


def _awaited(logs: Path) -> list[tuple[float, float]]:
    """What the notes of all platforms say, as soon as one says it."""
    until_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < until_s:
        texts = [_text(line) for log in logs.iterdir() for line in log.read_text(encoding="utf-8").splitlines()]
        found = [match for match in map(_NOTE.search, texts) if match is not None]
        if found:
            return [(float(match[1]), float(match[2])) for match in found]
        time.sleep(0.5)
    return []


def _text(line: str) -> str:
    try:
        return str(json.loads(line).get("text", ""))
    except (ValueError, AttributeError):
        return line
