"""Aircraft that the receivers of a vehicle hear: ADSB_VEHICLE and the messages of Open Drone ID become `HeardAircraft`.

Only fields that are valid count. All messages between two reports become one report, of each aircraft the newest and
the nearest first: a flood ends here. The autopilot's messages to its own transmitter are no other aircraft.
"""

import math
import struct
from collections import Counter
from typing import Any, Final, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.navigation.geodesy import distance_m
from dyknow.navigation.heard_aircraft import HeardAircraft
from dyknow.navigation.traffic import MOST_AIRCRAFT, identity_of
from dyknow.navigation.vehicle import PositionReport, TrafficReport

TRAFFIC_NAMES: Final = frozenset({
    "ADSB_VEHICLE", "OPEN_DRONE_ID_BASIC_ID", "OPEN_DRONE_ID_LOCATION", "OPEN_DRONE_ID_SYSTEM", "OPEN_DRONE_ID_MESSAGE_PACK",
})  # fmt: skip
TRAFFIC_IDS: Final = frozenset(number for number, kind in mavlink.mavlink_map.items() if kind.msgname in TRAFFIC_NAMES)
MOST_A_SECOND: Final = 1000
"""Messages of traffic that are decoded a second; the others are counted."""
REPORT_US: Final = 200_000
MOST_WAITING: Final = 4 * MOST_AIRCRAFT
_BAROMETRIC_M, _GEOMETRIC_M, _ELLIPSOID_M = 60.0, 20.0, 110.0
"""How far an altitude may be off mean sea level: by the pressure of the day; with the undulation of the geoid; without it."""
_COORDINATES, _ALTITUDE, _HEADING, _VELOCITY, _CALLSIGN, _CLIMB = 1, 2, 4, 8, 16, 128
_UNKNOWN_M, _UNKNOWN_COURSE_CDEG, _UNKNOWN_SPEED_CM_S, _UNKNOWN_CLIMB_CM_S = -1000.0, 36_000, 25_500, 6_300
_HORIZONTAL_M = (18_520.0, 7_408.0, 3_704.0, 1_852.0, 926.0, 555.6, 185.2, 92.6, 30.0, 10.0, 3.0, 1.0)
_PACKED, _MOST_PACKED, _MOST_NAMED = 25, 9, 256
_OWN: Final = bytes(20)


class _Named(NamedTuple):
    """The content of a BASIC_ID."""

    identity: str
    kind: str


class TrafficHearing:
    """The aircraft that the receivers of one vehicle hear, until they are reported.

    Attributes:
        left_out: messages that made no aircraft, by reason.
    """

    def __init__(self) -> None:
        self.left_out: Counter[str] = Counter()
        self._waiting: dict[str, HeardAircraft] = {}
        self._named: dict[tuple[int, bytes], _Named] = {}
        self._undulation_m: float | None = None
        self._due_us = 0

    def on_fix(self, message: Any) -> None:
        """GPS_RAW_INT: its two altitudes say how far mean sea level is above the ellipsoid here."""
        ellipsoid_mm = getattr(message, "alt_ellipsoid", 0)
        if (
            ellipsoid_mm
            and message.fix_type >= mavlink.GPS_FIX_TYPE_3D_FIX
            and abs(ellipsoid_mm - message.alt) < 120_000
        ):
            self._undulation_m = (ellipsoid_mm - message.alt) / 1000

    def on_message(self, message: Any, valid_us: int) -> None:
        """One message of `TRAFFIC_NAMES`."""
        kind, component = message.get_type(), message.get_srcComponent()
        if kind == "ADSB_VEHICLE":
            self._note(self._of_adsb(message, valid_us))
            return
        sender = bytes(message.id_or_mac)
        if component == mavlink.MAV_COMP_ID_AUTOPILOT1 and sender == _OWN:
            return
        key = component, sender
        if kind == "OPEN_DRONE_ID_BASIC_ID":
            self._name(key, bytes(message.uas_id), message.ua_type)
        elif kind == "OPEN_DRONE_ID_LOCATION":
            self._note(self._of_location(key, _Location.of(message), valid_us))
        elif kind == "OPEN_DRONE_ID_MESSAGE_PACK":
            self._on_pack(key, message, valid_us)

    def report(self, now_us: int, due_us: int, own: PositionReport | None) -> TrafficReport | None:
        """The aircraft heard since the last report; `due_us` is a clock that always runs, `own` our position."""
        if due_us < self._due_us or not (self._waiting or self.left_out):
            return None
        self._due_us = due_us + REPORT_US
        aircraft = list(self._waiting.values())
        if own is not None:
            here = own.latitude_deg, own.longitude_deg
            aircraft.sort(key=lambda one: distance_m(*here, one.latitude_deg, one.longitude_deg))
        if len(aircraft) > MOST_AIRCRAFT:
            self.left_out["too many"] += len(aircraft) - MOST_AIRCRAFT
        left_out = tuple(sorted(self.left_out.items()))
        self._waiting.clear()
        self.left_out.clear()
        return TrafficReport(now_us, tuple(aircraft[:MOST_AIRCRAFT]), left_out)

    def _note(self, heard: HeardAircraft | None) -> None:
        if heard is None:
            self.left_out["no place"] += 1
        elif len(self._waiting) >= MOST_WAITING and heard.identity not in self._waiting:
            self.left_out["too many"] += 1
        else:
            self._waiting[heard.identity] = heard

    def _of_adsb(self, message: Any, valid_us: int) -> HeardAircraft | None:
        flags, latitude_deg, longitude_deg = message.flags, message.lat / 1e7, message.lon / 1e7
        if not flags & _COORDINATES or not _is_place(latitude_deg, longitude_deg):
            return None
        altitude_m, error_m, reference = None, 0.0, ""
        if flags & _ALTITUDE:
            is_geometric = message.altitude_type == mavlink.ADSB_ALTITUDE_TYPE_GEOMETRIC
            altitude_m, error_m, reference = self._altitude(message.altitude / 1000, geometric=is_geometric)
        north = east = down = None
        if flags & _VELOCITY and flags & _HEADING and message.heading < _UNKNOWN_COURSE_CDEG:
            course, speed_m_s = math.radians(message.heading / 100), message.hor_velocity / 100
            north, east = speed_m_s * math.cos(course), speed_m_s * math.sin(course)
        if flags & _CLIMB:
            down = -message.ver_velocity / 100
        callsign = _text(message.callsign.encode(errors="replace")) if flags & _CALLSIGN else ""
        return HeardAircraft(
            valid_us - message.tslc * 1_000_000, "adsb", identity_of("adsb", f"{message.ICAO_address & 0xFFFFFF:06x}"),
            latitude_deg, longitude_deg, altitude_m, error_m, reference, north, east, down,
            kind=_kind("ADSB_EMITTER_TYPE", message.emitter_type), callsign=callsign,
        )  # fmt: skip

    def _altitude(self, altitude_m: float, *, geometric: bool) -> tuple[float, float, str]:
        if not geometric:
            return altitude_m, _BAROMETRIC_M, "barometric"
        if self._undulation_m is None:
            return altitude_m, _ELLIPSOID_M, "geometric"
        return altitude_m - self._undulation_m, _GEOMETRIC_M, "geometric"

    def _name(self, key: tuple[int, bytes], uas_id: bytes, ua_type: int) -> None:
        text = _text(uas_id)
        if not text:
            return
        while len(self._named) >= _MOST_NAMED and key not in self._named:
            del self._named[next(iter(self._named))]
        self._named[key] = _Named(identity_of("rid", text), _kind("MAV_ODID_UA_TYPE", ua_type))

    def _on_pack(self, key: tuple[int, bytes], message: Any, valid_us: int) -> None:
        if message.single_message_size != _PACKED or not 0 < message.msg_pack_size <= _MOST_PACKED:
            self.left_out["no pack"] += 1
            return
        data = bytes(message.messages)
        parts = [data[at * _PACKED : (at + 1) * _PACKED] for at in range(message.msg_pack_size)]
        for part in parts:
            if part[0] >> 4 == 0:
                self._name(key, part[2:22], part[1] & 0x0F)
        for part in parts:
            if part[0] >> 4 == 1:
                self._note(self._of_location(key, _Location.unpacked(part), valid_us))

    def _of_location(self, key: tuple[int, bytes], at: "_Location", valid_us: int) -> HeardAircraft | None:
        if not _is_place(at.latitude_deg, at.longitude_deg):
            return None
        is_still = at.speed_m_s is None or at.speed_m_s < 1.0
        altitude_m, error_m, reference = None, 0.0, ""
        if at.geodetic_m is not None:
            altitude_m, error_m, reference = self._altitude(at.geodetic_m, geometric=True)
        elif at.barometric_m is not None:
            altitude_m, error_m, reference = at.barometric_m, 2.0 * _ELLIPSOID_M, "pressure"
        north = east = None
        if at.speed_m_s is not None and (at.course_deg is not None or is_still):
            course = math.radians(at.course_deg or 0.0)
            north, east = at.speed_m_s * math.cos(course), at.speed_m_s * math.sin(course)
        named = self._named.get(key) or _Named(identity_of("rid", key[1].hex()[:16] + f"-{key[0]}"), "")
        bound_m = _HORIZONTAL_M[at.accuracy - 1] if 0 < at.accuracy <= len(_HORIZONTAL_M) else None
        return HeardAircraft(
            valid_us, "remote-id", named.identity, at.latitude_deg, at.longitude_deg, altitude_m, error_m, reference,
            north, east, None if at.climb_m_s is None else -at.climb_m_s, None if bound_m is None else bound_m / 2.0,
            named.kind, on_ground=at.status == mavlink.MAV_ODID_STATUS_GROUND and is_still,
        )  # fmt: skip


class _Location(NamedTuple):
    """The LOCATION of Open Drone ID in SI units; None: not known."""

    status: int
    latitude_deg: float
    longitude_deg: float
    course_deg: float | None
    speed_m_s: float | None
    climb_m_s: float | None
    geodetic_m: float | None
    barometric_m: float | None
    accuracy: int

    @classmethod
    def of(cls, message: Any) -> "_Location":
        return cls(
            message.status, message.latitude / 1e7, message.longitude / 1e7,
            message.direction / 100 if message.direction < _UNKNOWN_COURSE_CDEG else None,
            message.speed_horizontal / 100 if message.speed_horizontal < _UNKNOWN_SPEED_CM_S else None,
            message.speed_vertical / 100 if abs(message.speed_vertical) < _UNKNOWN_CLIMB_CM_S else None,
            _metres(message.altitude_geodetic), _metres(message.altitude_barometric), message.horizontal_accuracy,
        )  # fmt: skip

    @classmethod
    def unpacked(cls, part: bytes) -> "_Location":
        """25 bytes of the standard."""
        _, flags, course, speed, climb, latitude, longitude, barometric, geodetic, _height, accuracy = (
            struct.unpack_from("<BBBBbiiHHHB", part)
        )
        course_deg = course + 180 * (flags >> 1 & 1)
        is_fast = flags & 1
        return cls(
            flags >> 4, latitude / 1e7, longitude / 1e7,
            None if course_deg >= 360 else float(course_deg),
            None if speed == 255 else speed * 0.75 + 63.75 if is_fast else speed * 0.25,
            None if climb == 126 else climb * 0.5,
            _metres(geodetic / 2 - 1000.0), _metres(barometric / 2 - 1000.0), accuracy & 0x0F,
        )  # fmt: skip


def _metres(altitude_m: float) -> float | None:
    return float(altitude_m) if math.isfinite(altitude_m) and altitude_m > _UNKNOWN_M else None


def _is_place(latitude_deg: float, longitude_deg: float) -> bool:
    is_set = latitude_deg != 0.0 or longitude_deg != 0.0
    return is_set and abs(latitude_deg) <= 90.0 and abs(longitude_deg) <= 180.0


def _text(data: bytes) -> str:
    """ASCII up to the first zero, what is printed of it."""
    return "".join(chr(byte) for byte in data.partition(b"\0")[0] if 0x20 < byte < 0x7F)


def _kind(enum: str, number: int) -> str:
    """The name of an emitter or a type of aircraft in lower case; empty: not known."""
    entry = mavlink.enums[enum].get(number)
    if entry is None or not number or entry.name.endswith("_END"):
        return ""
    prefix = "MAV_ODID_UA_TYPE_" if enum.startswith("MAV") else "ADSB_EMITTER_TYPE_"
    return str(entry.name).removeprefix(prefix).lower().replace("_", "-")
