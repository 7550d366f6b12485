"""The ranges of the numbers of semantic labels, by their units: samples of others are checked before they are taken in.

A record is made of them afterwards without a further check: an instant in seconds is one of 64 bits in microseconds, a place
in metres is one on earth.
"""

from collections.abc import Callable, Mapping
from typing import Final, TypeAlias

from dyknow.model.instants import LATEST_S
from dyknow.model.sample import Value
from dyknow.model.values import LARGEST, Sort

InRange: TypeAlias = Callable[[Value], bool]
_MOST: Final[Mapping[str, float]] = {
    "m": 1e8, "m2": 1e16, "m/s": 1e6, "m/s2": 1e6, "s": LATEST_S, "deg": 1e4, "rad": 1e3, "fraction": 1e3, "kg": 1e6, "V": 1e6,
}  # fmt: skip
"""Of a number in a unit, of either sign; in others up to `LARGEST`."""


def in_range(sort: Sort) -> InRange:
    """Whether a value of the sort, as `Sort.check` takes it, is in the ranges of its units."""
    limits = tuple(_MOST.get(field.unit, LARGEST) for field in sort.fields)
    most = _MOST.get(sort.unit, LARGEST)

    def of_record(value: Value) -> bool:
        if type(value) is not tuple:
            return True
        for component, limit in zip(value, limits, strict=True):
            kind = type(component)
            if (kind is float or kind is int) and not -limit <= component <= limit:
                return False
        return True

    def of_number(value: Value) -> bool:
        return (type(value) is not float and type(value) is not int) or -most <= value <= most

    return of_record if limits else of_number
