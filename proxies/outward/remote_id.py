"""Remote ID (ASTM F3411) as MAVLink carries it: BASIC_ID, LOCATION and SYSTEM of one aircraft in a MESSAGE_PACK, and each alone.

Fields have the ranges and the values for *unknown* of the standard. Altitudes are above the ellipsoid there: without the
undulation of the geoid they are unknown, as the pressure altitude always is. Nothing is broadcast by radio here: the messages are
for a transmitter, or for a receiver that takes them from a network.
"""

import hashlib
import math
import re
import struct
from typing import Any, Final, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.model.errors import WrongCall
from dyknow.proxies.outward.cot import plain

_EPOCH_2019_S: Final = 1_546_300_800
_ID_BYTES: Final = 20
_PACKED: Final = 25
_UNKNOWN_M: Final = -1000.0
_UNKNOWN_COURSE_CDEG, _UNKNOWN_SPEED_CM_S, _UNKNOWN_CLIMB_CM_S = 36_100, 25_500, 6_300
_HORIZONTAL_M = (18_520.0, 7_408.0, 3_704.0, 1_852.0, 926.0, 555.6, 185.2, 92.6, 30.0, 10.0, 3.0, 1.0)
_VERTICAL_M = (150.0, 45.0, 25.0, 10.0, 3.0, 1.0)
_SERIAL = re.compile(r"[0-9A-HJ-NP-Z]{4}([1-9A-F])([0-9A-HJ-NP-Z]{1,15})")
_SECURE = 1.96
"""Accuracies are bounds for 95 %."""


class RemoteIdState(NamedTuple):
    """The state of an aircraft: WGS-84, metres above mean sea level, metres a second; None: not known.

    `serial` is its serial number by CTA-2063-A, empty if none is given; `home` where it took off.
    """

    name: str
    latitude_deg: float
    longitude_deg: float
    time_us: int
    altitude_m: float | None = None
    height_m: float | None = None
    velocity_m_s: tuple[float, float, float] | None = None
    horizontal_sd_m: float | None = None
    vertical_sd_m: float | None = None
    home: tuple[float, float] | None = None
    serial: str = ""


class RemoteIdMessages:
    """Encodes messages, numbered as one system and component.

    Args:
        undulation_m: how far mean sea level lies above the ellipsoid there; None: not known.
        source: system and component id.
    """

    def __init__(self, undulation_m: float | None = None, source: tuple[int, int] = (254, 236)) -> None:
        self._codec: Any = mavlink.MAVLink(None, srcSystem=source[0], srcComponent=source[1])
        self._undulation_m = undulation_m

    def encode(self, state: RemoteIdState) -> list[bytes]:
        """The datagrams of one aircraft: each message alone, then all in a pack."""
        messages = self._basic_id(state), self._location(state), self._system(state)
        pack = mavlink.MAVLink_open_drone_id_message_pack_message(
            0, 0, id_of(state.name), _PACKED, len(messages), _packed(*messages)
        )
        return [self._bytes(each) for each in (*messages, pack)]

    def _bytes(self, message: Any) -> bytes:
        data: bytes = bytes(message.pack(self._codec))
        self._codec.seq = (self._codec.seq + 1) % 256
        return data

    def _basic_id(self, state: RemoteIdState) -> Any:
        kind = mavlink.MAV_ODID_ID_TYPE_SERIAL_NUMBER if state.serial else mavlink.MAV_ODID_ID_TYPE_NONE
        return mavlink.MAVLink_open_drone_id_basic_id_message(
            0,
            0,
            id_of(state.name),
            kind,
            mavlink.MAV_ODID_UA_TYPE_HELICOPTER_OR_MULTIROTOR,
            id_of(state.serial or state.name),
        )

    def _location(self, state: RemoteIdState) -> Any:
        course, speed, climb = _motion(state.velocity_m_s)
        geodetic_m, vertical = _UNKNOWN_M, 0
        if state.altitude_m is not None and self._undulation_m is not None:
            geodetic_m = _within(state.altitude_m + self._undulation_m, _UNKNOWN_M, 31_767.5)
            vertical = _accuracy(state.vertical_sd_m, _VERTICAL_M)
        return mavlink.MAVLink_open_drone_id_location_message(
            0, 0, id_of(state.name), _status(state), course, speed, climb,
            round(state.latitude_deg * 1e7), round(state.longitude_deg * 1e7),
            _UNKNOWN_M, geodetic_m,
            mavlink.MAV_ODID_HEIGHT_REF_OVER_TAKEOFF,
            _UNKNOWN_M if state.height_m is None else _within(state.height_m, _UNKNOWN_M, 31_767.5),
            _accuracy(state.horizontal_sd_m, _HORIZONTAL_M), vertical, 0, 0,
            state.time_us % 3_600_000_000 / 1e6, mavlink.MAV_ODID_TIME_ACC_1_0_SECOND,
        )  # fmt: skip

    def _system(self, state: RemoteIdState) -> Any:
        latitude_deg, longitude_deg = state.home or (0.0, 0.0)
        if not (abs(latitude_deg) <= 90 and abs(longitude_deg) <= 180):
            latitude_deg = longitude_deg = 0.0
        return mavlink.MAVLink_open_drone_id_system_message(
            0, 0, id_of(state.name), mavlink.MAV_ODID_OPERATOR_LOCATION_TYPE_TAKEOFF,
            mavlink.MAV_ODID_CLASSIFICATION_TYPE_UNDECLARED, round(latitude_deg * 1e7), round(longitude_deg * 1e7),
            1, 0, _UNKNOWN_M, _UNKNOWN_M, 0, 0, _UNKNOWN_M, max(0, state.time_us // 1_000_000 - _EPOCH_2019_S),
        )  # fmt: skip


def check_serial(text: str) -> str:
    """A serial number by CTA-2063-A: four characters of the maker, the length of the rest, and the rest; no I, no O.

    Raises:
        WrongCall: it is none.
    """
    found = _SERIAL.fullmatch(text)
    if found is None or int(found[1], 16) != len(found[2]):
        raise WrongCall(f"--serial: {text!r} is no serial number by CTA-2063-A, such as 1A2B5X7Y9Z.")
    return text


def id_of(name: str) -> list[int]:
    """The id of a platform: its name in ASCII; for a longer name, or other characters, a digest."""
    shown = plain(name, 4 * _ID_BYTES)
    data = shown.encode()
    if shown != name or not shown.isascii() or len(data) > _ID_BYTES:
        data = hashlib.sha256(name.encode(errors="replace")).hexdigest()[:_ID_BYTES].encode()
    return [*data.ljust(_ID_BYTES, b"\0")]


def _status(state: RemoteIdState) -> int:
    if state.height_m is None:
        return int(mavlink.MAV_ODID_STATUS_UNDECLARED)
    return int(mavlink.MAV_ODID_STATUS_AIRBORNE if state.height_m > 1.0 else mavlink.MAV_ODID_STATUS_GROUND)


def _motion(velocity_m_s: tuple[float, float, float] | None) -> tuple[int, int, int]:
    if velocity_m_s is None:
        return _UNKNOWN_COURSE_CDEG, _UNKNOWN_SPEED_CM_S, _UNKNOWN_CLIMB_CM_S
    north, east, down = velocity_m_s
    course_cdeg = round(math.degrees(math.atan2(east, north)) % 360 * 100) % 36_000
    speed_cm_s = round(_within(math.hypot(north, east) * 100, 0, 25_425))
    return course_cdeg, speed_cm_s, round(_within(-down * 100, -6_200, 6_200))


def _within(value: float, least: float, most: float) -> float:
    return min(most, max(least, value))


def _accuracy(sd_m: float | None, bounds_m: tuple[float, ...]) -> int:
    """The number of the closest bound that holds; 0: unknown."""
    return 0 if sd_m is None else sum(_SECURE * sd_m < bound for bound in bounds_m)


def _packed(basic: Any, location: Any, system: Any) -> list[int]:
    """The messages as 25 bytes each, as the standard packs them (type and version first), filled to 225 bytes."""
    version = 2
    course = location.direction // 100
    is_west, speed_m_s = course >= 180, location.speed_horizontal / 100
    is_fast = speed_m_s > 63.75
    speed = round((speed_m_s - 63.75) / 0.75) if is_fast else round(speed_m_s / 0.25)
    flags = location.status << 4 | location.height_reference << 2 | is_west << 1 | is_fast
    climb = round(location.speed_vertical / 50)
    parts = (
        struct.pack("<BB20s3x", 0 << 4 | version, basic.id_type << 4 | basic.ua_type, bytes(basic.uas_id)),
        struct.pack(
            "<BBBBbiiHHHBBHBx", 1 << 4 | version, flags, course - 180 * is_west, speed, climb, location.latitude, location.longitude,
            _half_metres(location.altitude_barometric), _half_metres(location.altitude_geodetic), _half_metres(location.height),
            location.vertical_accuracy << 4 | location.horizontal_accuracy, 0, round(location.timestamp * 10),
            location.timestamp_accuracy,
        ),
        struct.pack(
            "<BBiiHBHHBHIx", 4 << 4 | version, system.classification_type << 2 | system.operator_location_type,
            system.operator_latitude, system.operator_longitude, system.area_count, system.area_radius // 10,
            _half_metres(system.area_ceiling), _half_metres(system.area_floor), 0, _half_metres(system.operator_altitude_geo),
            system.timestamp,
        ),
    )  # fmt: skip
    return [*b"".join(parts).ljust(225, b"\0")]


def _half_metres(altitude_m: float) -> int:
    return round((altitude_m + 1000.0) * 2)
