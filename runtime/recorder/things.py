"""The newest of each platform and object, from a recorder's messages, for formats that have one message a thing.

Values come from other members: a value without the form of its label, or outside the earth, is left out and counted.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from navigation.geodesy import LocalFrame, metres_per_degree
from runtime.recordings.recording_file import ALARM, SAMPLE

_FIELDS: Final = {
    "heli-position": ("latitude_deg", "longitude_deg"),
    "heli-altitude": ("altitude_m",),
    "heli-velocity": ("north_m_s", "east_m_s", "down_m_s"),
    "heli-height": ("height_m",),
    "heli-home": ("latitude_deg", "longitude_deg", "altitude_m"),
}
PLATFORM_LABELS: Final = tuple(_FIELDS)
AIRCRAFT: Final = "traffic"
"""Objects in the air, with places in degrees, by one name for all platforms."""
OBJECT_LABELS: Final = ("global-objects", "object-tracks", "believed-objects", AIRCRAFT)
MOST_THINGS: Final = 1024
"""Platforms and objects; beyond that the one that has been silent for longest is forgotten."""
_NOW_US: Final = 3_600_000_000
"""An older value, or one that far in the future, is no news."""
_FRESH_US: Final = 3_000_000
"""Altitude, velocity and height that are older than this do not belong to a position."""


@dataclass(slots=True)
class ThingState:
    """A platform, or an object: WGS-84, metres above mean sea level, metres a second, standard deviations; None: not known.

    Attributes:
        unit: the platform, or the one that sees the object; empty for objects that all call by one name.
        label: the stream of objects that it comes from; empty for a platform.
        symbol: the object.
        valid_us: when the position held; of the rest `at_us` by name.
    """

    unit: str
    label: str = ""
    symbol: str = ""
    latitude_deg: float = 0.0
    longitude_deg: float = 0.0
    valid_us: int = -1
    horizontal_sd_m: float | None = None
    parts: dict[str, tuple[int, tuple[float, ...]]] = field(default_factory=dict)
    sent_us: int = -1

    def part(self, name: str) -> tuple[float, ...] | None:
        """Numbers by the name of their label, unless they are too old."""
        at_us, numbers = self.parts.get(name, (-1, ()))
        return numbers if numbers and (name == "heli-home" or abs(at_us - self.valid_us) <= _FRESH_US) else None


class AlarmEdge(NamedTuple):
    """An edge of an alarm, as its platform raised it."""

    id: str
    event: str
    monitor: str
    by: str
    units: tuple[str, ...]


class ThingStates:
    """A sink that keeps tracks and gives those out that have news, each at most once a period.

    Args:
        period_us: how often a track is given out.
        now_us: federation time.
        on_track: takes a track.
        on_alarm: takes an edge of an alarm, and the tracks of those that it is about.
        origin: latitude and longitude of the federation's origin, which places of objects refer to.

    Attributes:
        refused: values that were left out.
    """

    def __init__(
        self,
        period_us: int,
        now_us: Callable[[], int],
        on_track: Callable[[ThingState], None],
        on_alarm: Callable[[AlarmEdge, list[ThingState]], None] = lambda _alarm, _tracks: None,
        origin: tuple[float, float] | None = None,
    ) -> None:
        self._period_us, self._now_us, self._on_track, self._on_alarm = period_us, now_us, on_track, on_alarm
        self._frame = None if origin is None else LocalFrame(*origin, 0.0)
        self._tracks: dict[tuple[str, str, str], ThingState] = {}
        self._given: dict[tuple[str, str, str], int] = {}
        self.refused = 0

    def add(
        self, _topic: str, schema: str, message: Mapping[str, Any], _at_us: int, _valid_us: int | None = None
    ) -> int:
        """Take a message of a recorder."""
        match message:
            case {"unit": str(unit), "label": str(label), "valid_us": int(valid_us), "value": dict(value)} if (
                schema == SAMPLE
            ):
                is_now = abs(valid_us - self._now_us()) <= _NOW_US
                is_taken = is_now and self._on_sample(unit, label, valid_us, value, message.get("covariance"))
                self.refused += not is_taken
            case {
                "id": str(name),
                "by": str(by),
                "event": str(event),
                "monitor": str(monitor),
                "units": list(units),
            } if schema == ALARM:
                alarm = AlarmEdge(name, event, monitor, by, tuple(map(str, units)))
                found = [self._tracks.get((unit, "", "")) for unit in alarm.units]
                self._on_alarm(alarm, [track for track in found if track is not None and track.valid_us >= 0])
        return 1

    def on_time(self) -> None:
        """Give out what has news and is due, platforms first."""
        now_us = self._now_us()
        for name, track in sorted(self._tracks.items(), key=lambda each: bool(each[1].label)):
            if track.valid_us > track.sent_us and now_us - self._given.get(name, -self._period_us) >= self._period_us:
                track.sent_us, self._given[name] = track.valid_us, now_us
                self._on_track(track)

    def _on_sample(self, unit: str, label: str, valid_us: int, value: dict[str, Any], covariance: Any) -> bool:
        if label in OBJECT_LABELS:
            return self._on_object(unit, label, valid_us, value)
        fields = _FIELDS.get(label, ())
        if not fields or set(value) != set(fields) or not all(_is_within(value[name], 1e6) for name in fields):
            return False
        track = self._track((unit, "", ""))
        if label == "heli-position":
            return self._place(track, (value["latitude_deg"], value["longitude_deg"]), valid_us, covariance)
        track.parts[label] = valid_us, tuple(float(value[name]) for name in fields)
        if label == "heli-altitude" and (sd_m := _sd(covariance, 0, 1.0)) is not None:
            track.parts["altitude sd"] = valid_us, (sd_m,)
        return True

    @staticmethod
    def _place(track: ThingState, at: tuple[float, float], valid_us: int, covariance: Any) -> bool:
        latitude, longitude = at
        if not (_is_within(latitude, 90) and _is_within(longitude, 180)) or valid_us < track.valid_us:
            return False
        track.latitude_deg, track.longitude_deg, track.valid_us = latitude, longitude, valid_us
        north_m, east_m = metres_per_degree(latitude)
        sds = _sd(covariance, 0, north_m), _sd(covariance, 1, east_m)
        track.horizontal_sd_m = None if sds[0] is None or sds[1] is None else max(sds[0], sds[1])
        return True

    def _on_object(self, unit: str, label: str, valid_us: int, value: dict[str, Any]) -> bool:
        owner = "" if label in {"global-objects", AIRCRAFT} else unit
        match value:
            case {"symbol": str(symbol), "end": True}:
                self._tracks.pop((owner, label, symbol), None)
                self._given.pop((owner, label, symbol), None)
                return True
            case {"symbol": str(symbol), "latitude_deg": latitude_deg, "longitude_deg": longitude_deg} if (
                label == AIRCRAFT
            ):
                track = self._track((owner, label, symbol))
                for name, keys in (
                    ("heli-altitude", ("altitude_m",)),
                    ("heli-velocity", ("vy_m_s", "vx_m_s", "vz_m_s")),
                ):
                    if all(_is_within(value.get(key), 1e6) for key in keys):
                        track.parts[name] = valid_us, tuple(float(value[key]) for key in keys)
                is_placed = self._place(track, (latitude_deg, longitude_deg), valid_us, None)
                radius_m = value.get("sd_m")
                track.horizontal_sd_m = float(radius_m) / 2 if _is_within(radius_m, 1e6) and radius_m else None
                return is_placed
            case {"symbol": str(symbol), "x_m": int() | float() as east_m, "y_m": int() | float() as north_m} if (
                self._frame is not None and _is_within(east_m, 1e6) and _is_within(north_m, 1e6)
            ):
                track = self._track((owner, label, symbol))
                latitude_deg, longitude_deg, _ = self._frame.from_ned(north_m, east_m, 0.0)
                track.latitude_deg, track.longitude_deg, track.valid_us = latitude_deg, longitude_deg, valid_us
                track.horizontal_sd_m = _object_sd_m(value)
                return True
        return False

    def _track(self, name: tuple[str, str, str]) -> ThingState:
        track = self._tracks.get(name)
        if track is None:
            if len(self._tracks) >= MOST_THINGS:
                silent = min(self._tracks, key=lambda each: self._tracks[each].valid_us)
                del self._tracks[silent]
                self._given.pop(silent, None)
            track = self._tracks[name] = ThingState(*name)
        return track


def _object_sd_m(value: Mapping[str, Any]) -> float | None:
    match value:
        case {"sd_m": int() | float() as sd_m}:
            return float(sd_m)
        case {"xx_m2": int() | float() as xx_m2, "yy_m2": int() | float() as yy_m2}:
            return math.sqrt(max(0.0, xx_m2, yy_m2))
    return None


def _is_within(value: Any, most: float) -> bool:
    return isinstance(value, int | float) and math.isfinite(value) and abs(value) <= most


def _sd(rows: Any, at: int, scale: float) -> float | None:
    """The standard deviation of one field, `scale` metres a unit; None if the matrix does not have it."""
    try:
        return math.sqrt(max(0.0, float(rows[at][at]))) * scale
    except (TypeError, ValueError, IndexError, OverflowError):
        return None
