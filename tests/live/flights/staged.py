"""A detector for tests, in processes of its own: it sees what a file next to this one says is there, and shows what each side has."""

import json
from math import atan2, cos, degrees, hypot, radians
from pathlib import Path
from typing import Any

from dyknow import NO_VALUE, Field, Sample, Sort, Value, computational_unit

STAGE = Path(__file__).with_name("stage.json")
ORIGIN_DEG = 55.724, 13.46
M_A_DEG = 111_320.0
SIDE_DEG = 60.0
PERCEPT = Sort(
    "staged-percept",
    (
        Field("symbol", "text"), Field("x_m", "m"), Field("y_m", "m"), Field("kind", "text"), Field("mark", "bool"),
        Field("end", "bool"),
    ),
)  # fmt: skip


def _is_near(east_m: float, north_m: float, bearing_deg: float | None, side_deg: float = SIDE_DEG) -> bool:
    """Whether the vehicle is on that side."""
    if bearing_deg is None:
        return False
    return abs((degrees(atan2(east_m, north_m)) - bearing_deg + 180.0) % 360.0 - 180.0) < side_deg


@computational_unit(PERCEPT, "position", name="Staged")
class Staged:
    """One thing with each position of the vehicle, in turn; one that has gone ends, and has another name when it is back."""

    def __init__(self) -> None:
        self._turn, self._count = 0, 0
        self._tracks: dict[str, str] = {}

    def __call__(self, _now_us: int, position: Sample) -> Value:
        if position.value is NO_VALUE:
            return None
        stage: dict[str, dict[str, Any]] = json.loads(STAGE.read_text("utf-8"))
        gone = next((name for name in self._tracks if name not in stage), None)
        if gone is not None:
            return self._tracks.pop(gone), 0.0, 0.0, NO_VALUE, NO_VALUE, True
        if not stage:
            return None
        self._turn += 1
        name, seen = sorted(stage.items())[self._turn % len(stage)]
        latitude_deg, longitude_deg = position.value
        east_m = (longitude_deg - ORIGIN_DEG[1]) * M_A_DEG * cos(radians(ORIGIN_DEG[0])) - seen["x_m"]
        north_m = (latitude_deg - ORIGIN_DEG[0]) * M_A_DEG - seen["y_m"]
        if hypot(east_m, north_m) > seen.get("seen_m", 1000.0) and _is_near(
            east_m, north_m, seen.get("hidden_deg"), 20.0
        ):
            return None
        if name not in self._tracks:
            self._count += 1
            self._tracks[name] = f"track{self._count}"
        mark: Value = NO_VALUE
        if seen.get("is_marked") or _is_near(east_m, north_m, seen.get("mark_deg")):
            mark = True
        return self._tracks[name], seen["x_m"], seen["y_m"], seen["kind"], mark, False
