"""Where platforms are, as Foxglove shows it: fixes for its map, poses and a scene for its 3-D panel."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

from dyknow.federation.messages.codec import StreamSample
from dyknow.federation.messages.contents import Alarm
from dyknow.navigation.geodesy import LocalFrame, metres_per_degree
from dyknow.runtime.recordings import foxglove
from dyknow.runtime.recordings.foxglove import Json

Picture: TypeAlias = Callable[[str, str, str, Json, int], None]
"""Takes the platform, topic, schema and message of a picture, and when it held."""
POSITION, ALTITUDE, VELOCITY = "heli-position", "heli-altitude", "heli-velocity"
SCENE_US: Final = 200_000
"""How often a platform is put into the scene."""
_SLOW_M_S = 0.5


@dataclass(slots=True)
class _Seen:
    """The newest of a platform; `waiting` is a position whose altitude has not come."""

    altitude_us: int = -1
    altitude_m: float = 0.0
    heading_rad: float = 0.0
    waiting: tuple[StreamSample, float, float] | None = None
    place: Json | None = None
    scene_us: int = -SCENE_US


class Pictures:
    """Positions meet the altitude of their valid time; a position without one has the newest."""

    def __init__(self, show: Picture) -> None:
        self._show = show
        self._seen: dict[str, _Seen] = {}
        self._frame: LocalFrame | None = None
        self._open: dict[str, str] = {}

    def on_sample(self, unit: str, label: str, value: Mapping[str, Any], sample: StreamSample) -> None:
        """A sample of any stream; `value` by field, in the units that every member has for these labels."""
        seen = self._seen.setdefault(unit, _Seen())
        match label, value:
            case "heli-position", {"latitude_deg": float(latitude), "longitude_deg": float(longitude)}:
                self._draw_waiting(unit, seen)
                seen.waiting = sample, latitude, longitude
            case "heli-altitude", {"altitude_m": float(altitude)}:
                seen.altitude_us, seen.altitude_m = sample.valid_us, altitude
            case "heli-velocity", {"north_m_s": float(north), "east_m_s": float(east)}:
                if math.hypot(north, east) > _SLOW_M_S:
                    seen.heading_rad = math.atan2(east, north)
        if seen.waiting is not None and seen.waiting[0].valid_us == seen.altitude_us:
            self._draw_waiting(unit, seen)

    def on_alarm(self, alarm: Alarm) -> None:
        """An edge of an alarm: a line while it is open, between those that it is about."""
        name = f"alarm {alarm.id}"
        if alarm.event == "opened":
            places = [seen.place for unit in alarm.units if (seen := self._seen.get(unit)) and seen.place]
            if len(places) > 1:
                self._open[name] = alarm.by
                entity = foxglove.alarm_entity(alarm.valid_us, name, places)
                self._show(alarm.by, "/scene", foxglove.SCENE, foxglove.scene(entity), alarm.valid_us)
        elif self._open.pop(name, None) is not None:
            gone = foxglove.deletion(alarm.valid_us, name)
            self._show(alarm.by, "/scene", foxglove.SCENE, foxglove.scene(deleted=[gone]), alarm.valid_us)

    def _draw_waiting(self, unit: str, seen: _Seen) -> None:
        if seen.waiting is None:
            return
        (sample, latitude, longitude), seen.waiting = seen.waiting, None
        valid_us, rows = sample.valid_us, sample.quality.covariance
        north_m, east_m = metres_per_degree(latitude)
        variances = (rows[1][1] * east_m**2, rows[0][0] * north_m**2, 0.0) if len(rows) == 2 else ()
        fix = foxglove.location_fix(valid_us, latitude, longitude, seen.altitude_m, variances)
        self._show(unit, f"/{unit}/fix", foxglove.LOCATION, fix, valid_us)
        if self._frame is None:
            self._frame = LocalFrame(latitude, longitude, 0.0)
        north, east, down = self._frame.to_ned(latitude, longitude, seen.altitude_m)
        seen.place = foxglove.pose(east, north, -down, seen.heading_rad)
        self._show(unit, f"/{unit}/pose", foxglove.POSE, foxglove.pose_in_frame(valid_us, seen.place), valid_us)
        if valid_us - seen.scene_us >= SCENE_US:
            seen.scene_us = valid_us
            entity = foxglove.platform_entity(valid_us, unit, seen.place)
            self._show(unit, "/scene", foxglove.SCENE, foxglove.scene(entity), valid_us)
