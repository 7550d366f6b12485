"""Observations from JSON lines, in looks: all of one sensor at one time.

    {"t_ms": 100, "sensor": "camera", "position_m": [1.0, 2.0], "covariance_m2": [[0.2, 0.0], [0.0, 0.2]], "colour": "red"}
    {"t_ms": 200, "sensor": "camera", "type": "cup", "relations": {"on": {"i2": true}}}
    {"t_ms": 300, "sensor": "camera", "nothing": true}
    {"t_ms": 400, "sensor": "adsb", "latitude_deg": 47.45, "longitude_deg": 8.56, "altitude_m": 9100.0}
    {"t_ms": 9000}

Where the model has an origin, latitude and longitude may take the place of `position_m`, in all lines of a file; `altitude_m` is an
attribute that the model may have. Each observed thing has a line; `sensor` may be left out where there is one. `nothing` states that the
sensor saw no thing at that time; a line with a time alone lets time pass. Lines are in the order of time. A line that cannot be used is left
out, and reported with its number; so is a time that is far ahead of the lines before and after it.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Final, NamedTuple

import numpy as np

from dyknow import US_PER_MS, US_PER_S
from dyknow.anchoring.belief.arrays import Floats
from dyknow.anchoring.belief.description import ALTITUDE, POSITION, CategoricalAttribute, GaussianAttribute, WorldModel
from dyknow.anchoring.belief.files.models import HIGHEST_M, is_covariance
from dyknow.anchoring.belief.observations import TYPE, ReportedRelation, WorldObservation
from dyknow.anchoring.percepts.reading import FARTHEST_GEOGRAPHIC_M
from dyknow.documents.json_lines import JsonLine
from dyknow.model.errors import TextError, did_you_mean

FARTHEST: Final = 1e7
FAR_AHEAD_US: Final = US_PER_S
MOST_AT_ONCE: Final = 100_000
_MOST_RELATIONS: Final = 64
_LONGEST: Final = 256
_COVARIANCE = "covariance_m2"
_ON_EARTH = ("latitude_deg", "longitude_deg")
_EXAMPLE: Final = '{"t_ms": 100, "sensor": "camera", "position_m": [1.0, 2.0]}'


class SensorLook(NamedTuple):
    """All observations of one sensor at one time; there may be none. Without a sensor: time passes until then."""

    valid_us: int
    sensor: str
    observations: list[WorldObservation]


class ObservationReader:
    """Reads one file.

    Args:
        file: its name, for errors.
        model: declares sensors and attributes.
        on_error: takes what is wrong with a line that is left out.
    """

    def __init__(self, file: str, model: WorldModel, on_error: Callable[[TextError], None]) -> None:
        self._file, self._model, self._on_error = file, model, on_error
        self._latest_us: int | None = None
        self._before_us: int | None = None
        self._first: _ObservationLine | None = None
        self._is_local: bool | None = None

    def looks(self, lines: Iterable[str | bytes]) -> Iterator[SensorLook]:
        """The looks, in the order of time, those of one time as soon as a line of the next is read."""
        found: dict[str, SensorLook] = {}
        count = 0
        for number, text in enumerate(lines, 1):
            if not text.strip():
                continue
            try:
                line = _ObservationLine(text, number, self._file, self._model)
                valid_us, sensor = line.valid_us(), line.sensor()
                observation = line.observation(valid_us, sensor)
                self._check_frame(line)
                if error := self._ahead(valid_us):
                    self._on_error(error)
                    found, count, self._latest_us = {}, 0, None
                self._check_order(line, valid_us)
                if valid_us != self._latest_us:
                    yield from found.values()
                    if self._latest_us is not None:
                        self._before_us = self._latest_us
                    found, count, self._latest_us, self._first = {}, 0, valid_us, line
                count += 1
                if count > MOST_AT_ONCE:
                    raise line.error(f"there are at most {MOST_AT_ONCE} observations of one time", "fewer of one time")
                look = found.setdefault(sensor, SensorLook(valid_us, sensor, []))
                if observation is not None:
                    look.observations.append(observation)
            except TextError as error:
                self._on_error(error)
        yield from found.values()

    def _check_frame(self, line: "_ObservationLine") -> None:
        """All positions of a file are in one frame."""
        is_local = line.is_local
        if self._is_local is not None and is_local is not None and is_local is not self._is_local:
            other = "latitude and longitude" if is_local else POSITION
            raise line.error(f"positions of this file are {other}", "all positions in one frame")
        self._is_local = self._is_local if is_local is None else is_local

    def _check_order(self, line: "_ObservationLine", valid_us: int) -> None:
        latest_us = self._before_us if self._latest_us is None else self._latest_us
        if latest_us is not None and valid_us < latest_us:
            before_ms = latest_us / US_PER_MS
            raise line.error(f"time goes backwards: before, there was t_ms {before_ms:g}", "the lines in order")

    def _ahead(self, valid_us: int) -> TextError | None:
        """The error if the time being read lies far after the next line, which follows the time before."""
        first, latest_us, before_us = self._first, self._latest_us, self._before_us
        if first is None or latest_us is None or latest_us - valid_us <= FAR_AHEAD_US:
            return None
        if before_us is not None and valid_us <= before_us:
            return None
        return first.error(
            f"t_ms is {(latest_us - valid_us) / US_PER_S:g} s ahead of the next line", "the lines in order"
        )


class _ObservationLine(JsonLine):
    """One line."""

    def __init__(self, line: str | bytes, number: int, file: str, model: WorldModel) -> None:
        super().__init__(line, number, file, "an observation", _EXAMPLE)
        self._model = model

    def valid_us(self) -> int:
        return round(self.time_ms() * US_PER_MS)

    def sensor(self) -> str:
        """The sensor that looked; empty: the line is a time alone."""
        if self.record.keys() == {"t_ms"}:
            return ""
        sensors = self._model.sensors
        if "sensor" not in self.record and len(sensors) == 1:
            return next(iter(sensors))
        name = self.record.get("sensor")
        if not isinstance(name, str) or name not in sensors:
            hint = did_you_mean(str(name)[:_LONGEST], sorted(sensors))
            raise self.error(f"the model has no sensor {str(name)[:40]!r}.{hint}", f'"sensor": "{next(iter(sensors))}"')
        return name

    @property
    def is_local(self) -> bool | None:
        """Whether its position is in metres; None: it has none."""
        if POSITION in self.record:
            return True
        return False if self._is_on_earth else None

    @property
    def _is_on_earth(self) -> bool:
        """Whether it has a latitude or a longitude that is none of the model's own attributes."""
        return any(name in self.record and name not in self._model.attributes for name in _ON_EARTH)

    def _position(self) -> list[float]:
        """Metres east and north of a place in degrees; its altitude, that of the origin if it has none, counts a little."""
        frame = self._model.frame
        if frame is None:
            raise self.error(
                "the model does not say where on earth its positions are 0",
                "[origin] with latitude_deg and longitude_deg in the model",
            )
        if POSITION in self.record:
            raise self.error(f"{POSITION} and {', '.join(_ON_EARTH)} are two positions", "one of them")
        latitude_deg, longitude_deg = (self._finite(*each) for each in zip(_ON_EARTH, (90.0, 180.0), strict=True))
        altitude_m = self._finite(ALTITUDE, HIGHEST_M) if ALTITUDE in self.record else frame.altitude_m
        north_m, east_m, _ = frame.to_ned(latitude_deg, longitude_deg, altitude_m)
        if max(abs(north_m), abs(east_m)) > FARTHEST_GEOGRAPHIC_M:
            raise self.error(f"more than {FARTHEST_GEOGRAPHIC_M / 1000:g} km from the origin", "a place nearby")
        return [east_m, north_m]

    def _finite(self, key: str, most: float) -> float:
        value: Any = self.record.get(key)
        if not _is_number(value, most):
            problem = "is missing" if value is None else f"is a number within {most:g}"
            raise self.error(f"{key} {problem}", f'"{key}": 1.0')
        return float(value)

    def observation(self, valid_us: int, sensor: str) -> WorldObservation | None:
        """The observation in the line; None: the sensor saw nothing, or time passes."""
        if not sensor:
            return None
        attributes, values = self._model.attributes, dict[str, Any]()
        record = self.record
        if self._is_on_earth:
            others = {key: value for key, value in record.items() if key not in _ON_EARTH}
            record = {POSITION: self._position(), **others}
        for key, value in record.items():
            if key in {"t_ms", "sensor", _COVARIANCE, "relations", "nothing"}:
                continue
            attribute = self._model.types.belief if key == TYPE else attributes.get(key)
            if attribute is None:
                hint = did_you_mean(key[:_LONGEST], [*attributes, TYPE, "relations"])
                raise self.error(f"the model has no attribute {key[:40]!r}.{hint}", "attributes of the model")
            values[key] = self._value(key, value, attribute, sensor)
        if self.record.get("nothing", False) is not False:
            if self.record["nothing"] is not True or values or "relations" in self.record:
                raise self.error("nothing is true, alone: nothing was seen", '{"t_ms": 300, "nothing": true}')
            return None
        relations = tuple(self._relations())
        if not values and not relations:
            raise self.error("nothing is observed", _EXAMPLE)
        return WorldObservation(valid_us, sensor, values, self._covariance(values), relations)

    def _value(
        self, key: str, value: Any, attribute: GaussianAttribute | CategoricalAttribute, sensor: str
    ) -> Floats | str:
        if isinstance(attribute, GaussianAttribute):
            listed = value if isinstance(value, list) else [value]
            if len(listed) != attribute.axes or not all(_is_number(each) for each in listed):
                example = f'"{key}": [{", ".join(["1.0"] * attribute.axes)}]'
                raise self.error(f"{key} is {attribute.axes} finite numbers, at most {FARTHEST:g}", example)
            return np.array(listed, dtype=np.float64)
        confusion = self._model.sensors[sensor].confusion.get(key)
        symbols = attribute.values if confusion is None else confusion.symbols
        if not isinstance(value, str) or value not in symbols:
            hint = did_you_mean(str(value)[:_LONGEST], symbols)
            raise self.error(f"{sensor} reports no {key} {str(value)[:40]!r}.{hint}", f'"{key}": "{symbols[0]}"')
        return value

    def _covariance(self, values: Mapping[str, Any]) -> Floats | None:
        given = self.record.get(_COVARIANCE)
        if given is None:
            return None
        if POSITION not in values:
            raise self.error(f"{_COVARIANCE} is of {POSITION}, which is not there", _EXAMPLE)
        size = len(values[POSITION])
        example = '"covariance_m2": [[0.2, 0.0], [0.0, 0.2]]'
        is_square = isinstance(given, list) and len(given) == size and all(
            isinstance(row, list) and len(row) == size and all(_is_number(each, 1e12) for each in row) for row in given
        )  # fmt: skip
        if not is_square:
            raise self.error(f"{_COVARIANCE} is {size} rows of {size} finite numbers", example)
        matrix = np.array(given, dtype=np.float64)
        if not is_covariance(matrix):
            raise self.error(f"{_COVARIANCE} is symmetric and positive definite", example)
        return matrix

    def _relations(self) -> Iterator[ReportedRelation]:
        given = self.record.get("relations", {})
        kinds = {each.name for each in self._model.relations}
        example = '"relations": {"on": {"i2": true}}'
        if not isinstance(given, dict) or sum(len(each) for each in given.values() if isinstance(each, dict)) > (
            _MOST_RELATIONS
        ):
            raise self.error(f"relations are by name and instance, at most {_MOST_RELATIONS}", example)
        for name, others in given.items():
            if name not in kinds:
                raise self.error(
                    f"the model has no relation {name[:40]!r}.{did_you_mean(name, sorted(kinds))}", example
                )
            if not isinstance(others, dict):
                raise self.error(f"{name} is to instances, each true or false", example)
            for other, holds in others.items():
                if not isinstance(holds, bool) or not other or len(other) > _LONGEST:
                    raise self.error(f"{name} is to instances, each true or false", example)
                yield ReportedRelation(name, other, holds)


def _is_number(value: Any, most: float = FARTHEST) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= most
