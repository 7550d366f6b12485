"""Units under test: stepped as a process steps them, with plain values in and out."""

from collections.abc import Iterable
from typing import Any

from dyknow import ComputationalUnit, Quality, Sample, UnitPrototype, prototypes_in
from dyknow.compunits import library


def prototype(unit: Any) -> UnitPrototype:
    if isinstance(unit, str):
        unit = library()[unit]
    (found,) = prototypes_in([unit])
    assert isinstance(found, UnitPrototype)
    return found


def process(unit: Any, **settings: Any) -> ComputationalUnit:
    kind = prototype(unit)
    return ComputationalUnit(kind.make(**settings), len(kind.inputs))


def value_of(unit: Any, *values: Any, **settings: Any) -> Any:
    """What a unit without memory makes of these values."""
    made = None
    running = process(unit, **settings)
    for i, value in enumerate(values):
        made = running.on_sample(i, Sample(10, 5, value), 10)
    assert made is not None
    assert made.valid_us == 5
    return made.value


def outputs(unit: Any, samples: Iterable[Sample], /, **settings: Any) -> list[Sample | None]:
    """One for each sample of its one input."""
    running = process(unit, **settings)
    return [running.on_sample(0, sample, sample.available_us) for sample in samples]


def stream(*readings: tuple[float, Any]) -> list[Sample]:
    """(valid time in seconds, value), available at once."""
    return [Sample(round(seconds * 1e6), round(seconds * 1e6), value) for seconds, value in readings]


def values(made: Iterable[Sample | None]) -> list[Any]:
    return [None if sample is None else sample.value for sample in made]


def variances(variance: float, count: int) -> Quality:
    return Quality(1.0, tuple(tuple(variance if i == k else 0.0 for k in range(count)) for i in range(count)))
