"""Tables of rows by section, and what two of them differ in."""

from collections.abc import Mapping
from typing import Any, TypeAlias

Row: TypeAlias = Mapping[str, Any]
"""The row of one thing; never changed, only replaced."""
Sections: TypeAlias = dict[str, dict[str, Row]]
Difference: TypeAlias = dict[str, dict[str, Row | None]]


def difference(before: Sections, after: Sections) -> Difference:
    """The difference from one picture to the other: new rows, None for removed ones."""
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
