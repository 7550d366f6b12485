"""Several platforms' readings of one label made into one (thesis 9.3.4: select one of the values, or merge them)."""

from collections.abc import Callable, Sequence
from typing import Final, TypeAlias

from dyknow.federation.messages.contents import Reading

LEAST_VARIANCE: Final = 1e-20
TrustedReading: TypeAlias = tuple[Reading, float]
"""A reading, and how far its platform is trusted, in [0, 1]."""


def select_newest(readings: Sequence[TrustedReading]) -> Reading | None:
    """The one with the highest valid time; ties go to the highest available time."""
    trusted = [reading for reading, _ in _trusted(readings)]
    return max(trusted, key=lambda reading: (reading.valid_us, reading.available_us), default=None)


def select_best(readings: Sequence[TrustedReading]) -> Reading | None:
    """The reading with the least stated variance over trust, the newest among equals; one without variance is last."""

    def rank(each: TrustedReading) -> tuple[bool, float, int]:
        reading, trust = each
        stated = _variances(reading)
        return (not stated, sum(stated.values()) / trust, -reading.valid_us)

    return min(_trusted(readings), key=rank, default=(None, 0.0))[0]


def merge_mean(readings: Sequence[TrustedReading]) -> Reading | None:
    """The mean of each field, each weighed by how far it is trusted, at the newest of the valid times."""
    return _merge(_trusted(readings), lambda _reading, _field: 1.0)


def merge_inverse_variance(readings: Sequence[TrustedReading]) -> Reading | None:
    """Each field weighed by trust over its variance; readings that state none are left out.

    Fields without a variance in one of the others are left out, and fields that no measurement has.
    """
    stated = [each for each in _trusted(readings) if any(map(_weight, _variances(each[0]).values()))]
    return _merge(stated, lambda reading, field: _weight(_variances(reading).get(field)))


def _weight(variance: float | None) -> float:
    """One over a variance; 0 of none, or of one that no measurement has."""
    return 0.0 if variance is None or variance < LEAST_VARIANCE else 1.0 / variance


def _trusted(readings: Sequence[TrustedReading]) -> list[TrustedReading]:
    return [each for each in readings if each[1] > 0.0]


def _variances(reading: Reading) -> dict[str, float]:
    return reading.variance or {}


def _merge(found: Sequence[TrustedReading], weight: Callable[[Reading, str], float]) -> Reading | None:
    """The weighted mean of every numeric field that all of them have."""
    readings = [reading for reading, _ in found]
    records = [(reading, reading.value) for reading in readings if isinstance(reading.value, dict)]
    trusts = [trust for reading, trust in found if isinstance(reading.value, dict)]
    if not records:
        return None
    fields = [name for name in records[0][1] if all(_is_number(record.get(name)) for _, record in records)]
    value: dict[str, float] = {}
    variance: dict[str, float] = {}
    for name in fields:
        weights = [trust * weight(reading, name) for (reading, _), trust in zip(records, trusts, strict=True)]
        total = sum(weights)
        if not all(weights):
            continue
        value[name] = sum(w * _number(record[name]) for w, (_, record) in zip(weights, records, strict=True)) / total
        stated = [_variances(reading).get(name) for reading, _ in records]
        if all(v is not None for v in stated):
            shares = ((w / total) ** 2 * (v or 0.0) for w, v in zip(weights, stated, strict=True))
            variance[name] = sum(shares)
    newest = max(reading.valid_us for reading, _ in records)
    available = max(reading.available_us for reading, _ in records)
    made_us = min((reading.made_us for reading in readings if reading.made_us is not None), default=None)
    return Reading(
        valid_us=newest, available_us=available, value=dict(value), variance=dict(variance) or None, made_us=made_us
    )


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else 0.0


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
