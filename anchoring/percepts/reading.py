"""Percepts from JSON lines, in ticks of one valid time.

    {"t_ms": 100, "percept": "vp1", "type": "vision_percept", "x_m": 1.0, "y_m": 2.0, "sd_m": 0.8,
     "vx_m_s": 9.0, "vy_m_s": 0.1, "colour": "red"}
    {"t_ms": 900, "percept": "vp1", "end": true}
    {"t_ms": 1000, "x_m": 3.0, "y_m": 2.0}
    {"t_ms": 30000}

A line without `percept` is a detection without a name, which gets one from where things of its type were (`DetectionNames`): all
percepts of a type have names, or none has. A time alone is a tick without percepts: time passes until then. Velocity,
`sd_m` (1 m) and attributes are optional, `type` too where there is but one; `latitude_deg` and `longitude_deg` may
take the place of x (east) and y (north); a whole number may be the name of a percept. Lines are in the order of time; those
with one `t_ms` are one tick. A line that cannot be used is reported with its number and left out, and so is a percept
that a tick has twice with other contents, and a
tick that is far ahead of the lines before and after it.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from math import isfinite
from typing import Any, Final, NamedTuple, TypeAlias

from dyknow import US_PER_MS, US_PER_S, Value
from dyknow.anchoring.links.states import ObjectState, diagonal
from dyknow.anchoring.links.structures import Percept
from dyknow.anchoring.percepts.leaps import PerceptLeaps
from dyknow.anchoring.percepts.naming import DetectionNames
from dyknow.documents.json_lines import JsonLine
from dyknow.model.errors import TextError, did_you_mean
from dyknow.navigation import LocalFrame

FARTHEST_M: Final = 2e7
"""No position is farther from the origin: UTM coordinates are within."""
FARTHEST_GEOGRAPHIC_M: Final = 1e6
FASTEST_M_S: Final = 1e4
USUAL_SD_M: Final = 1.0
LEAST_SD_M: Final = 0.01
VELOCITY_SD_M_S: Final = 1.0
MOST_IN_TICK: Final = 100_000
FAR_AHEAD_US: Final = US_PER_S
"""Where one tick is so far ahead of the lines on either side, its time is wrong, and not theirs."""
_LONGEST: Final = 256
_MOST_ATTRIBUTES: Final = 64
_KEYS: Final = frozenset(
    {"t_ms", "percept", "type", "x_m", "y_m", "latitude_deg", "longitude_deg", "sd_m", "vx_m_s", "vy_m_s", "end"}
)
_EXAMPLE: Final = '{"t_ms": 100, "percept": "vp1", "type": "vision_percept", "x_m": 1.0, "y_m": 2.0}'


_Tick: TypeAlias = dict[tuple[str, str], Percept | None]


class PerceptTick(NamedTuple):
    """All percepts of one valid time; there may be none."""

    valid_us: int
    percepts: list[Percept]


class PerceptReader:
    """Reads one file.

    Args:
        file: its name, for errors.
        types: the types that percepts may have.
        on_error: takes what is wrong with a line that is left out.
        frame: of geographic positions, and of those in metres if it is known where those are; None: about the first.
        is_local: whether positions are in metres; None: as in the first line.
        is_piped: whether an empty line says that a tick is complete, so that it need not wait for a line of the next.

    Attributes:
        frame: as given, or as found; None while positions are local.
    """

    def __init__(
        self,
        file: str,
        types: Collection[str],
        on_error: Callable[[TextError], None],
        frame: LocalFrame | None = None,
        *,
        is_local: bool | None = None,
        is_piped: bool = False,
    ) -> None:
        self.frame = frame
        self._file, self._types, self._on_error = file, tuple(types), on_error
        self._is_local = is_local
        self._is_piped, self._leaps = is_piped, PerceptLeaps()
        self._tick: _Tick | None = None
        self._latest_us: int | None = None
        self._before_us: int | None = None
        self._first: _PerceptLine | None = None
        self._names: dict[str, DetectionNames] = {}
        self._with_names = set[str]()

    @property
    def unnamed(self) -> tuple[str, ...]:
        """The types whose percepts have no names in the text."""
        return tuple(self._names)

    def ticks(self, lines: Iterable[str | bytes]) -> Iterator[PerceptTick]:
        """The ticks, one as soon as a line of the next is read."""
        return self.numbered_ticks(enumerate(lines, 1))

    def numbered_ticks(self, lines: Iterable[tuple[int, str | bytes]]) -> Iterator[PerceptTick]:
        """The ticks of lines with their numbers in the text that they are from."""
        for number, text in lines:
            try:
                if text.strip():
                    yield from self._on_line(_PerceptLine(text, number, self._file))
                elif self._is_piped and not self._is_leap:
                    yield from self._completed()
            except TextError as error:
                self._on_error(error)
        yield from self._completed()

    def _on_line(self, line: "_PerceptLine") -> Iterator[PerceptTick]:
        """The tick before, if this line is of the next."""
        valid_us = line.valid_us()
        percept = None if line.is_time else line.percept(self._types, self._place)
        if error := self._ahead(valid_us):
            self._on_error(error)
            self._tick = self._latest_us = None
        if self._latest_us is not None and valid_us < self._latest_us:
            before_ms = self._latest_us / US_PER_MS
            raise line.error(f"time goes backwards: before, there was t_ms {before_ms:g}", "the lines in order")
        if valid_us != self._latest_us:
            yield from self._completed()
            self._tick, self._latest_us, self._first = {}, valid_us, line
        tick = self._tick
        if tick is None:
            raise line.error(
                "an empty line came before, and completed this time", "the empty line after all of one time"
            )
        if percept is not None:
            self._take(line, percept, tick)

    def _take(self, line: "_PerceptLine", percept: Percept, tick: "_Tick") -> None:
        """A percept of the tick that is being read."""
        self._check_names(line, percept.type)
        key = percept.type, percept.symbol
        if len(tick) >= MOST_IN_TICK and key not in tick:
            raise line.error(f"a tick has at most {MOST_IN_TICK} percepts", "fewer percepts a tick")
        if key in tick and (known := tick[key]) is not None and not _same(known, percept):
            tick[key] = None
            raise line.error(
                f"{percept.symbol} has two different samples at t_ms {line.time_ms():g}: neither counts",
                "one sample of a percept a time, or another name",
            )
        if not line.is_unnamed and key not in tick and (leap_m := self._leaps.leap_m(percept)) is not None:
            raise line.error(f"{percept.symbol} is {leap_m:g} m from where it was", "one name for each thing")
        tick.setdefault(key, percept)

    def _check_names(self, line: "_PerceptLine", type_: str) -> None:
        """All percepts of a type have names, or none has."""
        if line.is_unnamed:
            if type_ in self._with_names:
                raise line.error(f"percepts of the type {type_} have names here, and this one has none", _EXAMPLE)
            self._names.setdefault(type_, DetectionNames(f"{type_[:1]}d"))
        elif type_ in self._names:
            raise line.error(f"percepts of the type {type_} have no names here, and this one has", "no percept in it")
        else:
            self._with_names.add(type_)

    def _completed(self) -> Iterator[PerceptTick]:
        """The tick that is being read, which is over."""
        tick, self._tick, self._first = self._tick, None, None
        if tick is not None and self._latest_us is not None:
            self._before_us = self._latest_us
            yield PerceptTick(self._latest_us, self._named(self._latest_us, tick))

    def _named(self, valid_us: int, tick: "_Tick") -> list[Percept]:
        """The percepts of a tick, each with a name."""
        percepts = [each for (type_, _), each in tick.items() if each is not None and type_ not in self._names]
        for type_, names in self._names.items():
            states = [one.state for (of, _), one in tick.items() if of == type_ and one is not None and one.state]
            percepts += [Percept(name, type_, state) for name, state in names.named(valid_us, states)]
        return percepts

    @property
    def _is_leap(self) -> bool:
        """Whether the tick that is being read is so long after the last that only the next line shows that it is right."""
        latest_us, before_us = self._latest_us, self._before_us
        return latest_us is not None and before_us is not None and latest_us - before_us > FAR_AHEAD_US

    def _ahead(self, valid_us: int) -> TextError | None:
        """The error if the tick being read lies far after the next line, which follows the tick before."""
        first, latest_us, before_us = self._first, self._latest_us, self._before_us
        if first is None or latest_us is None or latest_us - valid_us <= FAR_AHEAD_US:
            return None
        if before_us is not None and valid_us <= before_us:
            return None
        ahead_s = (latest_us - valid_us) / US_PER_S
        return first.error(f"t_ms is {ahead_s:g} s ahead of the next line", "the lines in order")

    def _place(self, line: "_PerceptLine") -> tuple[float, float]:
        """East and north of a line's position."""
        record = line.record
        local, on_earth = ("x_m" in record or "y_m" in record), ("latitude_deg" in record or "longitude_deg" in record)
        if not local and not on_earth:
            raise line.error("x_m and y_m are missing", '"x_m": 1.0, "y_m": 2.0; where it has ended, "end": true')
        if local and on_earth:
            raise line.error("x_m, y_m and latitude_deg, longitude_deg are two positions", "one of them")
        if self._is_local is not None and local is not self._is_local:
            other = "geographic" if local else "local"
            raise line.error(f"positions of this file, or of its roads, are {other}", "all positions in one frame")
        if local:
            place = line.number("x_m", FARTHEST_M), line.number("y_m", FARTHEST_M)
        else:
            latitude_deg, longitude_deg = line.number("latitude_deg", 90.0), line.number("longitude_deg", 180.0)
            frame = self.frame or LocalFrame(latitude_deg, longitude_deg, 0.0)
            north_m, east_m, _ = frame.to_ned(latitude_deg, longitude_deg, 0.0)
            if max(abs(north_m), abs(east_m)) > FARTHEST_GEOGRAPHIC_M:
                raise line.error(f"more than {FARTHEST_GEOGRAPHIC_M / 1000:g} km from the others", "a place nearby")
            self.frame, place = frame, (east_m, north_m)
        self._is_local = local
        return place


def _same(one: Percept, other: Percept) -> bool:
    if one.state is None or other.state is None:
        return one.state is other.state
    return one.state[:5] == other.state[:5] and one.state.attributes == other.state.attributes


class _PerceptLine(JsonLine):
    """One line."""

    def __init__(self, line: str | bytes, number: int, file: str) -> None:
        super().__init__(line, number, file, "a percept", _EXAMPLE)

    @property
    def is_time(self) -> bool:
        """Whether it is a time alone."""
        return self.record.keys() == {"t_ms"}

    @property
    def is_unnamed(self) -> bool:
        """Whether it is a detection without a name."""
        return "percept" not in self.record

    def valid_us(self) -> int:
        return round(self.time_ms() * US_PER_MS)

    def percept(self, types: tuple[str, ...], place: Callable[["_PerceptLine"], tuple[float, float]]) -> Percept:
        symbol, type_ = self._symbol(), self._type(types)
        end = self.record.get("end", False)
        if not isinstance(end, bool):
            raise self.error("end is true or false", '{"t_ms": 900, "percept": "vp1", "end": true}')
        if end and self.is_unnamed:
            raise self.error(
                "percept is missing: what has no name cannot end", '{"t_ms": 900, "percept": "vp1", "end": true}'
            )
        if end:
            return Percept(symbol, type_, None)
        x_m, y_m = place(self)
        sd_m = self.number("sd_m", FARTHEST_M) if "sd_m" in self.record else USUAL_SD_M
        if sd_m < 0.0:
            raise self.error(f"sd_m is a standard deviation in metres, got {sd_m:g}", '"sd_m": 0.8')
        moves = "vx_m_s" in self.record or "vy_m_s" in self.record
        velocity = (self.number("vx_m_s", FASTEST_M_S), self.number("vy_m_s", FASTEST_M_S)) if moves else (0.0, 0.0)
        covariance = diagonal(max(sd_m, LEAST_SD_M), VELOCITY_SD_M_S if moves else None)
        return Percept(symbol, type_, ObjectState(self.valid_us(), x_m, y_m, *velocity, covariance, self._attributes()))

    def _symbol(self) -> str:
        """The name of a percept; trackers number theirs. Of a detection without a name the number of its line."""
        if self.is_unnamed:
            return str(self._number)
        value = self.record["percept"]
        is_number = isinstance(value, int) and not isinstance(value, bool) and abs(value) < 2**63
        return str(value) if is_number else self._name("percept")

    def _name(self, key: str) -> str:
        value = self.record.get(key)
        if not isinstance(value, str) or not value or len(value) > _LONGEST:
            raise self.error(f"{key} is a name, a text of at most {_LONGEST} characters", _EXAMPLE)
        return value

    def _type(self, types: tuple[str, ...]) -> str:
        if "type" not in self.record and len(types) == 1:
            return types[0]
        found = self._name("type")
        if found not in types:
            hint = did_you_mean(found, types)
            raise self.error(f"no link begins at the type {found!r}.{hint}", f'"type": "{types[0]}"')
        return found

    def number(self, key: str, most: float) -> float:
        """A finite number that is at most so large, or so far below 0."""
        value = self.record.get(key)
        if isinstance(value, bool) or not isinstance(value, int | float):
            problem = f"{key} is missing" if value is None else f"{key} is a number"
            raise self.error(problem, f'"{key}": 1.0')
        if not abs(value) <= most:
            raise self.error(f"{key} is {str(value)[:20]}, which is beyond {most:g}", f'"{key}": 1.0')
        return float(value)

    def _attributes(self) -> Mapping[str, Value]:
        found: dict[str, Any] = {key: value for key, value in self.record.items() if key not in _KEYS}
        if len(found) > _MOST_ATTRIBUTES:
            raise self.error(f"{len(found)} attributes, {_MOST_ATTRIBUTES} are allowed", _EXAMPLE)
        for key, value in found.items():
            is_simple = isinstance(value, str | bool | int) or (isinstance(value, float) and isfinite(value))
            if not is_simple or len(key) > _LONGEST or (isinstance(value, str) and len(value) > _LONGEST):
                raise self.error(f"{key[:40]!r} is no text, number or truth value", '"colour": "red"')
        return found
