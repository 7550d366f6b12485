"""What two pictures of a federation differ in, and which of its platforms are near each other."""

import math
from collections.abc import Mapping
from typing import TypeAlias

from console.web.rows import Row
from navigation.geodesy import metres_per_degree

Sections: TypeAlias = dict[str, dict[str, Row]]
Difference: TypeAlias = dict[str, dict[str, Row | None]]
CLOSE_M, CLOSE_ABOVE_M = 60.0, 30.0
"""Platforms nearer than this, horizontally and vertically, are a close pair."""


def close_pairs(platforms: Mapping[str, Row], before: Mapping[str, Row] = {}) -> dict[str, Row]:
    """The pairs that are near each other, horizontally, and how high above each other they are, in metres."""
    flying = [(unit, row["at"], row.get("altitude")) for unit, row in platforms.items() if row.get("at")]
    if not flying:
        return {}
    north_m, east_m = metres_per_degree(flying[0][1][0])
    spots = [(unit, at[1] * east_m, at[0] * north_m, altitude) for unit, at, altitude in flying]
    found: dict[str, Row] = {}
    for index, (unit, x, y, altitude) in enumerate(spots):
        for other, other_x, other_y, other_altitude in spots[index + 1 :]:
            if abs(x - other_x) < CLOSE_M and abs(y - other_y) < CLOSE_M:
                apart_m = math.hypot(x - other_x, y - other_y)
                if apart_m < CLOSE_M and (
                    altitude is None or other_altitude is None or abs(altitude - other_altitude) < CLOSE_ABOVE_M
                ):
                    above = (
                        None if altitude is None or other_altitude is None else round(abs(altitude - other_altitude), 1)
                    )
                    row = {"units": [unit, other], "apart": round(apart_m, 1), "above": above}
                    name = f"{unit} {other}"
                    found[name] = before[name] if before.get(name) == row else row
    return found


def difference(before: Sections, after: Sections) -> Difference:
    """What makes the one picture the other: rows that are new, None for those that are gone."""
    found: Difference = {}
    for section, rows_after in after.items():
        rows_before = before.get(section, {})
        changed: dict[str, Row | None] = {
            name: row for name, row in rows_after.items() if rows_before.get(name) is not row
        }
        changed |= {name: None for name in rows_before if name not in rows_after}
        if changed:
            found[section] = changed
    return found
