"""Values and their sorts (thesis, Def. 4.3.2, 4.3.3).

A simple value is an `int`, `float`, `bool` or `str`. A record is a plain tuple in the field order of its sort.
"""

from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Final, NamedTuple

from dyknow.model.errors import SortError
from dyknow.model.sample import Value

LARGEST: Final = 1e30
"""Of a number in a stream or in an act, of either sign: products of several such numbers are finite."""


class NoValue(Enum):
    """The class of `NO_VALUE`: at this time the stream has no value (Def. 4.3.3). It has one instance, and is falsy."""

    NO_VALUE = "no_value"

    def __repr__(self) -> str:
        return "no_value"

    def __str__(self) -> str:
        return "no_value"

    def __bool__(self) -> bool:
        return False


NO_VALUE: Final = NoValue.NO_VALUE
SYMBOL: Final = "symbol"
"""The first field of an object state: which object it is of (Def. 8.5.1)."""
END: Final = "end"
"""The field that is true in the last state of an object."""


class Field(NamedTuple):
    """One component of a record. `unit` is its physical unit (`deg`, `m/s`), or `bool` or `text` for such values."""

    name: str
    unit: str


@dataclass(frozen=True, slots=True)
class Sort:
    """The sort of a stream's values: records of `fields`, or, without fields, simple values.

    Of an open sort only the name is known: its values are simple, or tuples of values; or, of one with fields, the first of them:
    declared for a stream it may have more behind these.

    Attributes:
        unit: of a sort of simple values: as of a field. Empty: any simple value is of the sort.
    """

    name: str
    fields: tuple[Field, ...] = ()
    is_open: bool = field(default=False, compare=False)
    unit: str = ""
    _numbers: int = field(init=False, repr=False, compare=False, default=0)
    _takes_number: bool = field(init=False, repr=False, compare=False, default=True)
    _end: int = field(init=False, repr=False, compare=False, default=-1)

    def __post_init__(self) -> None:
        if all(part.unit not in {"bool", "text"} for part in self.fields):
            object.__setattr__(self, "_numbers", len(self.fields))
        places = (at for at, part in enumerate(self.fields) if part == (END, "bool"))
        object.__setattr__(self, "_end", next(places, -1))
        object.__setattr__(self, "_takes_number", not self.fields and self.unit not in {"bool", "text"})

    @property
    def is_of_objects(self) -> bool:
        """Whether its values are object states: records that begin with the symbol of an object (Def. 8.5.1).

        Of an object state an attribute may have no value.
        """
        return bool(self.fields) and self.fields[0] == (SYMBOL, "text")

    def is_end(self, state: Value) -> bool:
        """Whether an object state is the last one of its object."""
        return state is not NO_VALUE and self._end >= 0 and state[self._end] is True

    def __str__(self) -> str:
        """As a definition writes it: `gas in ppm`, `wind(north_m_s in m/s, east_m_s in m/s)`, `car`."""
        if self.fields:
            parts = (f"{part.name} in {part.unit}" if part.unit else part.name for part in self.fields)
            return f"{self.name}({', '.join(parts)})"
        return f"{self.name} in {self.unit}" if self.unit else self.name

    def check(self, value: Value) -> None:
        """Accept a value of this sort, or `NO_VALUE`.

        Raises:
            SortError: wrong arity, or a component that is not a number up to `LARGEST` (a bool, a text where the unit says so).
        """
        if value is NO_VALUE:
            return
        kind = type(value)
        if (kind is float or kind is int) and self._takes_number and -LARGEST <= value <= LARGEST:
            return
        if self._numbers and kind is tuple and len(value) == self._numbers:
            for component in value:
                if type(component) is not float or not -LARGEST <= component <= LARGEST:
                    break
            else:
                return
        if not self.fields:
            self._check_simple(value)
            return
        if not isinstance(value, tuple) or len(value) != len(self.fields):
            raise SortError(
                f"{self.name}: expected {len(self.fields)} components ({self._names()}), got {_shown(value)}"
            )
        for part, component in zip(self.fields, value, strict=True):
            if not _fits(component, part.unit) and not self._may_lack(part, component):
                raise SortError(
                    f"{self.name}.{part.name} [{part.unit}]: {_shown(component)} is not {_wanted(part.unit)}"
                )

    def as_record(self, value: Value) -> dict[str, Value]:
        """The components by name. A simple value is called `value`.

        Raises:
            SortError: the value is not of this sort, or is `NO_VALUE`.
        """
        if value is NO_VALUE:
            raise SortError(f"{self.name}: no_value has no components")
        self.check(value)
        return dict(zip((f.name for f in self.fields), value, strict=True)) if self.fields else {"value": value}

    def _may_lack(self, part: Field, component: Value) -> bool:
        """Whether it is an attribute of an object that is not known."""
        return component is NO_VALUE and part.name not in {SYMBOL, END} and self.is_of_objects

    def _check_simple(self, value: Value) -> None:
        if self.is_open and isinstance(value, tuple | frozenset):
            for component in value:
                self.check(component)
        elif self.unit:
            if not _fits(value, self.unit):
                raise SortError(f"{self.name} [{self.unit}]: {_shown(value)} is not {_wanted(self.unit)}")
        elif not isinstance(value, bool | str) and not _fits(value, ""):
            raise SortError(f"{self.name}: {_shown(value)} is not a simple value")

    def _names(self) -> str:
        return ", ".join(f.name for f in self.fields)


def is_kind_of(sort: Sort, wanted: Sort) -> bool:
    """Whether values of a sort are as `wanted` says or, if that is open, have more behind its fields."""
    if not wanted.is_open:
        return sort == wanted
    return sort.name == wanted.name and sort.fields[: len(wanted.fields)] == wanted.fields


def without_nan(value: Value) -> Value:
    """A record in which what is not a number has no value."""
    if not isinstance(value, tuple) or all(one == one for one in value):  # noqa: PLR0124 - a NaN differs from itself
        return value
    return tuple([one if one == one else NO_VALUE for one in value])  # noqa: PLR0124


def as_json(value: Value) -> Any:
    """A value as JSON has it: null is no_value, a list a record or a set."""
    if value is NO_VALUE:
        return None
    if isinstance(value, frozenset):
        return sorted(map(str, value))
    return [as_json(one) for one in value] if isinstance(value, tuple) else value


def of_json(found: Any) -> Value:
    """The value that JSON stands for."""
    if found is None:
        return NO_VALUE
    return tuple(of_json(one) for one in found) if isinstance(found, list) else found


def _fits(component: Value, unit: str) -> bool:
    if unit == "bool":
        return isinstance(component, bool)
    if unit == "text":
        return isinstance(component, str)
    return isinstance(component, float | int) and not isinstance(component, bool) and -LARGEST <= component <= LARGEST


def _wanted(unit: str) -> str:
    return {"bool": "true or false", "text": "a text"}.get(unit, f"a number up to {LARGEST:g}")


def _shown(value: Value) -> str:
    try:
        text = repr(value)
    except ValueError:  # it holds a number of thousands of digits
        return f"a {type(value).__name__} too long to be shown"
    return text if len(text) <= 80 else f"{text[:77]}..."
