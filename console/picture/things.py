"""Platforms and objects of a picture, each at most once a period, for formats that have one message a thing.

Values come from other members: a value without the form of its label, or outside the earth, is left out and counted.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

from dyknow.console.picture import rows
from dyknow.console.picture.differences import Row
from dyknow.console.picture.picture import Picture
from dyknow.runtime.recordings.recording_file import ALARM, SAMPLE

_FORMS: Final[Mapping[str, tuple[str, ...]]] = {
    "heli-position": ("latitude_deg", "longitude_deg"),
    "heli-altitude": ("altitude_m",),
    "heli-velocity": ("north_m_s", "east_m_s", "down_m_s"),
    "heli-height": ("height_m",),
    "heli-home": ("latitude_deg", "longitude_deg", "altitude_m"),
}
PLATFORM_LABELS: Final = tuple(_FORMS)
AIRCRAFT: Final = "traffic"
"""Objects in the air, with places in degrees, by one name for all platforms."""
OBJECT_LABELS: Final = ("global-objects", "object-tracks", "believed-objects", AIRCRAFT)
_LARGEST: Final = 1e6
_NOW_US: Final = 3_600_000_000
"""An older value, or one that far in the future, is no news."""
_FRESH_US: Final = 3_000_000
"""Altitude, velocity and height that are older than this do not belong to a position."""


class ThingState(NamedTuple):
    """A platform, or an object: WGS-84, metres above mean sea level, standard deviations in metres; None: not known.

    Attributes:
        unit: the platform, or the one that sees the object; empty for objects that all call by one name.
        label: the stream of objects that it comes from; empty for a platform.
        symbol: the object.
        valid_us: when the position held.
        course_deg, speed_m_s, climb_m_s: clockwise from north, over ground, upwards.
    """

    unit: str
    label: str
    symbol: str
    latitude_deg: float
    longitude_deg: float
    valid_us: int
    horizontal_sd_m: float | None = None
    altitude_m: float | None = None
    altitude_sd_m: float | None = None
    height_m: float | None = None
    course_deg: float = 0.0
    speed_m_s: float | None = None
    climb_m_s: float = 0.0
    home: tuple[float, float] | None = None

    @property
    def name(self) -> tuple[str, str, str]:
        return self.label, self.unit, self.symbol


class ThingStates:
    """A sink that gives out the tracks of its picture that have news, each at most once a period.

    Args:
        period_us: how often a track is given out.
        now_us: federation time.
        on_track: takes a track.
        on_alarm: takes the id and the row of an alarm at an edge, and the tracks of those that it is about.
        origin: latitude and longitude of the federation's origin, which places of objects refer to.

    Attributes:
        refused: values that were left out.
    """

    def __init__(
        self,
        period_us: int,
        now_us: Callable[[], int],
        on_track: Callable[[ThingState], None],
        on_alarm: Callable[[str, Row, list[ThingState]], None] | None = None,
        origin: tuple[float, float] | None = None,
    ) -> None:
        self._period_us, self._now_us, self._on_track, self._on_alarm = period_us, now_us, on_track, on_alarm
        self._picture = Picture(origin)
        self._given: dict[tuple[str, str, str], tuple[int, int]] = {}
        self.refused = 0

    def add(
        self, _topic: str, schema: str, message: Mapping[str, Any], at_us: int, _valid_us: int | None = None
    ) -> int:
        """Take a message of a recorder."""
        match message:
            case {"label": str(label), "valid_us": int(valid_us), "value": dict(value)} if schema == SAMPLE:
                if abs(valid_us - self._now_us()) <= _NOW_US and _has_form(label, value):
                    self._picture.take(at_us, schema, message)
                else:
                    self.refused += 1
            case {"id": str(name)} if schema == ALARM and self._on_alarm is not None:
                self._picture.take(at_us, schema, message)
                alarm = self._picture.section("alarms")[rows.text(name)]
                platforms = {track.unit: track for track in self._platforms()}
                self._on_alarm(name, alarm, [platforms[unit] for unit in alarm["units"] if unit in platforms])
        return 1

    def on_time(self) -> None:
        """Report the things that have changed and are due, platforms first."""
        now_us = self._now_us()
        objects = [_object(row) for row in self._picture.section("objects").values() if row["at"]]
        there = [*self._platforms(), *sorted(objects, key=lambda track: -track.valid_us)]
        for track in there:
            valid_us, given_us = self._given.get(track.name, (-1, -self._period_us))
            if track.valid_us > valid_us and now_us - given_us >= self._period_us:
                self._given[track.name] = track.valid_us, now_us
                self._on_track(track)
        for name in self._given.keys() - {track.name for track in there}:
            del self._given[name]

    def _platforms(self) -> list[ThingState]:
        return [_platform(unit, row) for unit, row in self._picture.section("platforms").items() if row.get("at")]


def _has_form(label: str, value: Mapping[str, Any]) -> bool:
    is_on_earth = rows.place(value) is not None
    if label in OBJECT_LABELS:
        metres = rows.numbers(value, ("x_m", "y_m"))
        is_near = metres is not None and max(map(abs, metres)) <= _LARGEST
        is_placed = value.get("end") is True or (is_on_earth if label == AIRCRAFT else is_near)
        return is_placed and isinstance(value.get("symbol"), str)
    names = _FORMS.get(label, ())
    figures = rows.numbers(value, names)
    if not figures or len(value) != len(names):
        return False
    return max(map(abs, figures)) <= _LARGEST and (is_on_earth or "latitude_deg" not in names)


def _platform(unit: str, row: Row) -> ThingState:
    def fresh(name: str, key: str) -> Any:
        return row.get(key) if abs(row.get(f"{name}_us", -_FRESH_US) - row["valid_us"]) <= _FRESH_US else None

    (latitude_deg, longitude_deg), home = row["at"], row.get("home")
    return ThingState(
        unit, "", "", latitude_deg, longitude_deg, row["valid_us"], row["sd"],
        fresh("altitude", "altitude"), fresh("altitude", "altitude_sd"), fresh("height", "height"),
        row.get("course", 0.0), fresh("speed", "speed"), row.get("climb", 0.0), None if home is None else (home[0], home[1]),
    )  # fmt: skip


def _object(row: Row) -> ThingState:
    is_aircraft, sd_m = row["label"] == AIRCRAFT, row.get("sd_m")
    if is_aircraft:
        sd_m = sd_m / 2 if sd_m else None
    elif sd_m is None and "xx_m2" in row and "yy_m2" in row:
        sd_m = math.sqrt(max(0.0, row["xx_m2"], row["yy_m2"]))
    unit = "" if is_aircraft or row["label"] == "global-objects" else row["unit"]
    about, (latitude_deg, longitude_deg) = (unit, row["label"], row["symbol"]), row["at"]
    track = ThingState(*about, latitude_deg, longitude_deg, row["valid_us"], sd_m, row.get("altitude_m"))
    if "vx_m_s" in row and "vy_m_s" in row:
        course_deg = math.degrees(math.atan2(row["vx_m_s"], row["vy_m_s"]))
        track = track._replace(course_deg=course_deg, speed_m_s=math.hypot(row["vx_m_s"], row["vy_m_s"]))
    return track
