"""Answers of a federation, as a program reads them. Instants are microseconds of federation time."""

from collections.abc import Mapping, Sequence
from datetime import timedelta
from html import escape
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, overload

from dyknow import SURE, Predicted, Quality
from dyknow.federation.messages.codec import StreamSample
from dyknow.federation.messages.contents import Reading
from dyknow.model.errors import UnitError
from dyknow.model.instants import EPOCH
from dyknow.model.values import NoValue
from dyknow.navigation.geodesy import metres_per_degree

if TYPE_CHECKING:
    from pandas import DataFrame

MOST_ROWS, LONGEST_CELL = 50, 200
"""Most rows and characters of a cell that a notebook shows."""
_DEGREES = {"latitude_deg": (0, "north"), "longitude_deg": (1, "east")}
_SQUARES = {"_m_s2": "m2_s4", "_m_s": "m2_s2", "_m": "m2", "_deg": "deg2", "_rad": "rad2", "_s": "s2"}


class UnitSample(NamedTuple):
    """One sample of one platform.

    Attributes:
        unit: whose it is.
        label: the semantic label, e.g. `heli-altitude`.
        value: by field, in the units of the label (docs/python.md lists them); empty: it had no value then.
        valid_us: when the value held.
        available_us: when it could be used: by the platform that answers, or here if it was watched.
        quality: its certainty in [0, 1], the covariance of its fields, units squared, if that is known, and `.prediction`
            of a predicted value: `.made_us`, `.branch`, `.weight`.
        variances: of the fields, by unit, for example `{"m2": {"north": 0.8, "east": 0.8}}`; a position's are in metres.
    """

    unit: str
    label: str
    value: Mapping[str, Any]
    valid_us: int
    available_us: int
    quality: Quality = SURE

    @property
    def variances(self) -> Mapping[str, Mapping[str, float]]:
        """See the class."""
        rows = self.quality.covariance
        stated = {name: rows[at][at] for at, name in enumerate(self.value)} if len(rows) == len(self.value) else {}
        return variances_in(self.value, stated)


class PlatformChange(NamedTuple):
    """A platform is not heard (`silent`), `gone` without a good-bye, has `left`, or is `back`.

    Attributes:
        at_us: federation time.
        monitor, by, values: empty; it is read where alarms are.
    """

    event: Literal["silent", "gone", "left", "back"]
    unit: str
    at_us: int
    monitor: str = ""
    by: str = ""
    values: Mapping[str, Any] = MappingProxyType({})

    @property
    def units(self) -> tuple[str, ...]:
        """The platform, as alarms name what they are about."""
        return (self.unit,)


class QueryResult(Sequence[UnitSample]):
    """The samples that answer a query, by unit and then by valid time.

    Attributes:
        missing: why other platforms are not among them, by unit.
    """

    def __init__(self, samples: Sequence[UnitSample], missing: Mapping[str, str]) -> None:
        self._samples, self.missing = tuple(samples), dict(missing)

    @overload
    def __getitem__(self, index: int) -> UnitSample: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[UnitSample]: ...
    def __getitem__(self, index: int | slice) -> UnitSample | Sequence[UnitSample]:
        return self._samples[index]

    def __len__(self) -> int:
        return len(self._samples)

    def frame(self) -> "DataFrame":
        """A pandas DataFrame: a row a sample, by valid time (UTC), with `unit`, `label`, the fields of the value and `certainty`.

        Raises:
            UnitError: pandas is not installed.
        """
        try:
            import pandas as pd
        except ImportError:
            raise UnitError(
                "a DataFrame needs pandas, which is not installed; install the extra: pip install 'dyknow-federation[frames]'"
            ) from None
        rows = [
            {"unit": each.unit, "label": each.label, **each.value, "certainty": each.quality.certainty} for each in self
        ]
        times = pd.to_datetime([each.valid_us for each in self], unit="us", utc=True)
        return pd.DataFrame(rows, index=pd.Index(times, name="valid"))

    def _repr_html_(self) -> str:
        """A table for notebooks; texts of platforms are escaped."""
        shown = self._samples[:MOST_ROWS]
        fields = list(dict.fromkeys(name for each in shown for name in each.value))
        head = "".join(f"<th>{escape(name)}</th>" for name in ("unit", "label", "valid", *fields))
        lines = [
            (each.unit, each.label, _instant(each.valid_us), *(each.value.get(name, "") for name in fields))
            for each in shown
        ]
        rows = ["".join(f"<td>{escape(str(cell)[:LONGEST_CELL])}</td>" for cell in line) for line in lines]
        notes = [f"{len(self) - len(shown)} more samples"] if len(self) > len(shown) else []
        notes += [f"platform {unit} is missing: {why}" for unit, why in self.missing.items()]
        body = "".join(f"<tr>{row}</tr>" for row in rows)
        said = "".join(f"<p>{escape(note)}</p>" for note in notes)
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{said}"

    def __repr__(self) -> str:
        return f"QueryResult({list(self._samples)!r}, missing={self.missing!r})"


def _instant(at_us: int) -> str:
    try:
        return (EPOCH + timedelta(microseconds=at_us)).isoformat(sep=" ", timespec="milliseconds")
    except OverflowError:
        return f"{at_us} us"


def variances_in(value: Mapping[str, Any], variance: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    """Variances of the fields of a value by unit and by name without the unit; of a position in metres, north and east.

    Args:
        value: the value, by field.
        variance: by field, in the square of the field's unit, which its name ends with; unit `""`: it ends with none.
    """
    found: dict[str, dict[str, float]] = {}
    for name, stated in variance.items():
        if not isinstance(stated, int | float):
            continue  # another platform wrote it
        if name in _DEGREES and isinstance(value.get("latitude_deg"), int | float):
            at, axis = _DEGREES[name]
            unit, amount = "m2", float(stated) * metres_per_degree(value["latitude_deg"])[at] ** 2
        else:
            ending, unit = next(((end, unit) for end, unit in _SQUARES.items() if name.endswith(end)), ("", ""))
            axis, amount = name.removesuffix(ending), float(stated)
        found.setdefault(unit, {})[axis] = amount
    return found


def sample_of_reading(unit: str, label: str, reading: Reading) -> UnitSample:
    """One sample of the answer to a query."""
    value = {} if isinstance(reading.value, NoValue) else dict(reading.value)
    quality = _quality(value, reading.variance)
    if reading.made_us is not None:
        quality = quality._replace(prediction=Predicted(reading.made_us, reading.branch, reading.weight))
    return UnitSample(unit, label, value, reading.valid_us, reading.available_us, quality)


def _quality(value: Mapping[str, Any], variance: Mapping[str, Any] | None) -> Quality:
    """The covariance is diagonal: an answer has the variance of each field."""
    if variance is None or set(variance) != set(value):
        return SURE
    fields = list(value)
    rows = [tuple(float(variance[one]) if one == other else 0.0 for other in fields) for one in fields]
    return Quality(covariance=tuple(rows))


def sample_of_wire(
    value: Mapping[str, Any], unit: str, label: str, sample: StreamSample, available_us: int
) -> UnitSample:
    """One sample of a stream that is watched; `value` is its value by field."""
    return UnitSample(unit, label, value, sample.valid_us, available_us, sample.quality)
