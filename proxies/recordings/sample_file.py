"""Samples as JSON lines: the feed of a specification from outside, and the record of a run.

A feed has one line per instant, values by the name of their source; `at_ms` says when they become available, at once if
it is left out. A list is a record or a set, null is no_value:

    {"t_ms": 100, "at_ms": 130, "pos_car1": 12.5, "car_ids": ["car1", "car2"]}

A record begins with the specification, and has one line per sample, of a generator or of a declared stream:

    {"specification": "source ...", "file": "cars.kpl", "unit": "0"}
    {"label": "pos[car1]", "valid_us": 100000, "available_us": 130000, "value": 12.5}
    {"stream": "speed_car1", "valid_us": 200000, "available_us": 230000, "value": 2.5}
"""

from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from typing import Any, NamedTuple

from dyknow import Predicted, Quality, Sample, Value, of_json
from dyknow.documents.json_lines import JsonLine
from dyknow.model.errors import TextError
from dyknow.model.instants import MAX_DURATION_US, US_PER_MS

_EXAMPLE = '{"t_ms": 100, "pos_car1": 12.5}'
_TIMES = ("t_ms", "at_ms")


class FedSample(NamedTuple):
    """One sample of a source: available at `at_us`."""

    at_us: int
    source: str
    valid_us: int
    value: Value


class Recorded(NamedTuple):
    """One sample of a run; `kind` is `label` for a generator, `stream` for a declared stream."""

    kind: str
    name: str
    sample: Sample


def read_feed(lines: Iterable[str], place: str) -> list[FedSample]:
    """The samples of a feed in the order in which they become available.

    Raises:
        TextError: a line is none of a feed, and which.
    """
    found: list[FedSample] = []
    for line in _lines(lines, place):
        valid_us = _time_us(line, "t_ms")
        at_us = _time_us(line, "at_ms") if "at_ms" in line.record else valid_us
        values = ((name, value) for name, value in line.record.items() if name not in _TIMES)
        found += [FedSample(at_us, name, valid_us, of_json(value)) for name, value in values]
    return sorted(found, key=lambda each: each.at_us)


def read_record(lines: Iterable[str], place: str) -> tuple[Mapping[str, Any], list[Recorded]]:
    """The record's first line, with the specification, and its samples as they came.

    Raises:
        TextError: a line is none of a record, and which.
    """
    about: Mapping[str, Any] = {}
    found: list[Recorded] = []
    for line in _lines(lines, place):
        record = line.record
        if "specification" in record:
            about = record
            continue
        kind = "stream" if "stream" in record else "label"
        times: list[Any] = [record.get(name) for name in ("available_us", "valid_us")]
        if not isinstance(record.get(kind), str) or "value" not in record or not all(map(_is_time, times)):
            raise line.error("a recorded sample has a label or a stream, valid_us, available_us and a value", "")
        quality = _quality(record)
        if quality is None:
            raise line.error(
                "a certainty is a number from 0 to 1, a covariance a square of numbers with variances >= 0", ""
            )
        found.append(Recorded(kind, record[kind], Sample(times[0], times[1], of_json(record["value"]), quality)))
    if not about:
        raise TextError("the record of a run begins with its specification", line=1, file=place)
    return about, found


def _lines(lines: Iterable[str], place: str) -> Iterator[JsonLine]:
    for number, text in enumerate(lines, 1):
        if text.strip():
            line = JsonLine(text, number, place, "a line", _EXAMPLE)
            if any(isinstance(value, dict) for value in line.record.values()):
                raise line.error("a line is one JSON object of values", _EXAMPLE)
            yield line


def _quality(record: Mapping[str, Any]) -> Quality | None:
    """How good a recorded sample is; None if it does not say so in numbers."""
    certainty, rows = record.get("certainty", 1.0), record.get("covariance", [])
    square = isinstance(rows, list) and all(isinstance(row, list) and len(row) == len(rows) for row in rows)
    numbers = square and all(map(_is_number, chain(*rows))) and all(row[i] >= 0 for i, row in enumerate(rows))
    if not (_is_number(certainty) and 0 <= certainty <= 1 and numbers):
        return None
    prediction = _prediction(record.get("prediction"))
    if "prediction" in record and prediction is None:
        return None
    return Quality(float(certainty), tuple(tuple(map(float, row)) for row in rows), prediction)


def _prediction(stated: Any) -> Predicted | None:
    """`[made_us, branch, weight]`; None if it is anything else."""
    match stated:
        case [int(made_us), str(branch), int(weight) | float(weight)] if 0 <= weight <= 1:
            return Predicted(made_us, branch, float(weight))
    return None


def _is_number(found: Any) -> bool:
    return isinstance(found, int | float) and not isinstance(found, bool)


def _is_time(found: Any) -> bool:
    return isinstance(found, int) and not isinstance(found, bool) and abs(found) <= MAX_DURATION_US


def _time_us(line: JsonLine, name: str) -> int:
    found = line.record.get(name)
    if isinstance(found, int | float) and not isinstance(found, bool) and 0 <= found * US_PER_MS <= MAX_DURATION_US:
        return round(found * US_PER_MS)
    raise line.error(f"{name} is a time in milliseconds, >= 0", _EXAMPLE)
