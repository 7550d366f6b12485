"""Tables of world models and of prior knowledge: lists of numbers, matrices and probabilities, too."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from dyknow.anchoring.belief.arrays import Floats
from dyknow.documents.tables import DocumentTable, is_number
from dyknow.model.errors import did_you_mean


class WorldTable(DocumentTable):
    """One table of such a file."""

    def numbers(self, key: str, count: int | None = None) -> Floats | None:
        """A list of finite numbers, or a single one; None where it is not given, or wrong."""
        value = self.get(key)
        if value is None:
            return None
        found = _array(value if isinstance(value, list) else [value], 1)
        if found is None or (count is not None and len(found) != count):
            want = "numbers" if count is None else f"{count} number{'s' * (count != 1)}"
            shown = ", ".join(["1.0"] * (count or 2))
            self._expected(key, f"a list of {want}", f"{key} = [{shown}]")
            return None
        return found

    def matrix(self, key: str, width: int) -> Floats | None:
        """Rows of numbers, (R, width); None where it is not given, or wrong."""
        value = self.get(key)
        if value is None:
            return None
        found = _array(value, 2)
        if found is None or found.shape[1] != width:
            row = f"[{', '.join(['1.0'] * width)}]"
            self._expected(key, f"a list of rows of {width} numbers", f"{key} = [{row}, ...]")
            return None
        return found

    def shares(self, key: str, values: Sequence[str], what: str, *, rest: bool = False) -> Floats | None:
        """Probabilities by name, (K,), that sum to 1; with `rest` to at most 1, and the others share what remains."""
        if key not in self.entries:
            return None
        table = self.table(key)
        found = np.zeros(len(values))
        for name in table.entries:
            if name in values:
                found[values.index(name)] = table.number(name, 0.0, 0.0, 1.0)
            else:
                table.get(name)
                table.wrong(name, f"is no {what}.{did_you_mean(name, values)}", "one that is declared")
        total = float(found.sum())
        others = np.array([name not in table.entries for name in values])
        if rest and total < 1.0 and others.any():
            found[others] = (1.0 - total) / others.sum()
            total = 1.0
        if abs(total - 1.0) > 1e-6:
            self.wrong(key, f"probabilities sum to {total:g}, not to 1", "probabilities that sum to 1")
            return None
        return found / total


def _array(value: Any, dimensions: int) -> Floats | None:
    if not isinstance(value, list) or not value:
        return None
    if dimensions == 1:
        return np.array(value, dtype=np.float64) if all(map(is_number, value)) else None
    if any(not isinstance(row, list) or len(row) != len(value[0]) or not all(map(is_number, row)) for row in value):
        return None
    return np.array(value, dtype=np.float64)
