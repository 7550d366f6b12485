"""Small logs of each format, written by hand from the formats' descriptions: ten seconds of flight north."""

import math
import struct

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.proxies.vehicle import heartbeat, position

START_US = 1_436_056_000_000_000
SECONDS, HERTZ = 10, 5
STEP_US = 1_000_000 // HERTZ


def latitude(k: int) -> float:
    return 47.0 + k * 1e-5


def tlog() -> bytes:
    """Also a ground station's heartbeats and a radio's frames that no dialect of ours can check."""
    vehicle, station = mavlink.MAVLink(None, srcSystem=1, srcComponent=1), mavlink.MAVLink(None, srcSystem=255)
    out = b""
    for k in range(SECONDS * HERTZ):
        stamp = struct.pack(">Q", START_US + k * STEP_US)
        if k % HERTZ == 0:
            out += stamp + bytes(heartbeat(armed=False).pack(vehicle))
            out += stamp + bytes(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3).pack(station))
            out += stamp + b"\xfe\x02\x00\x33\x44\x8eab\x00\x00"
        out += stamp + bytes(position(1000 + k * 200, lat=latitude(k)).pack(vehicle))
    return out


def dataflash(*, micros: bool = True) -> bytes:
    """With the time column of today's logs, or that of 2015."""
    time_name, time_code = ("TimeUS", "Q") if micros else ("TimeMS", "I")
    gps = (
        "TimeUS,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ"
        if micros
        else ("Status,TimeMS,Week,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,T")
    )
    gps_codes = "QBIHBcLLefff" if micros else "BIHBcLLefffI"
    out = _fmt(0x80, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")
    out += _fmt(130, 3 + struct.calcsize("<" + _codes(gps_codes)), "GPS", gps_codes, gps)
    out += _fmt(
        131,
        3 + struct.calcsize("<" + _codes(f"{time_code}ccC")),
        "ATT",
        f"{time_code}ccC",
        f"{time_name},Roll,Pitch,Yaw",
    )
    out += _fmt(
        132,
        3 + struct.calcsize("<" + _codes(f"{time_code}fff")),
        "IMU",
        f"{time_code}fff",
        f"{time_name},AccX,AccY,AccZ",
    )
    for k in range(SECONDS * HERTZ):
        boot_us = 60_000_000 + k * STEP_US
        stamp = boot_us if micros else boot_us // 1000
        week_ms, week = 302_400_000 + k * 200, 1871
        at = (round(latitude(k) * 1e7), 80000000, 51000, 5.0, 0.0, -0.25)
        status = 1 if k < 5 else 3
        row = (stamp, status, week_ms, week, 10, 150, *at) if micros else (status, week_ms, week, 10, 150, *at, stamp)
        out += b"\xa3\x95\x82" + struct.pack("<" + _codes(gps_codes), *row)
        out += b"\xa3\x95\x83" + struct.pack("<" + _codes(f"{time_code}ccC"), stamp, 100, -200, 9000)
        out += b"\xa3\x95\x84" + struct.pack("<" + _codes(f"{time_code}fff"), stamp, 0.5, 0.0, -9.8)
    return out


def _codes(layout: str) -> str:
    return layout.translate(str.maketrans({"c": "h", "C": "H", "L": "i", "e": "i", "n": "4s", "N": "16s", "Z": "64s"}))


def _fmt(kind: int, length: int, name: str, layout: str, columns: str) -> bytes:
    row = struct.pack("<BB4s16s64s", kind, length, name.encode(), layout.encode(), columns.encode())
    return b"\xa3\x95\x80" + row


def ulog(*, degrees: bool = True) -> bytes:
    """With coordinates as today's logs have them, or in 1e-7 degrees; one topic holds a nested one, and padding."""
    names = (
        "double latitude_deg;double longitude_deg;double altitude_msl_m"
        if degrees
        else "int32_t lat;int32_t lon;int32_t alt"
    )
    gps = (
        f"vehicle_gps_position:uint64_t timestamp;uint64_t time_utc_usec;{names};float eph;float epv;float s_variance_m_s;"
        "float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;bool vel_ned_valid;uint8_t fix_type;uint8_t[2] _padding0;"
    )
    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
    out += _message("F", b"pair:uint8_t a;uint8_t b;")
    out += _message("F", gps.encode()) + _message("F", b"vehicle_attitude:uint64_t timestamp;pair[3] spare;float[4] q;")
    out += _message("I", b"\x0cchar[4] sys_namePX4 "[:20])
    out += _message("A", b"\x00\x01\x00vehicle_gps_position") + _message("A", b"\x01\x02\x00vehicle_gps_position")
    out += _message("A", b"\x00\x03\x00vehicle_attitude")
    sync = bytes((0x2F, 0x73, 0x13, 0x20, 0x25, 0x0C, 0xBB, 0x12))
    half = math.sqrt(0.5)
    for k in range(SECONDS * HERTZ):
        boot_us = 60_000_000 + k * STEP_US
        at = (latitude(k), 8.0, 510.0) if degrees else (round(latitude(k) * 1e7), 80000000, 510000)
        body = struct.pack("<QQ" + ("ddd" if degrees else "iii"), boot_us, START_US + k * STEP_US, *at)
        body += struct.pack("<ffffff?B", 0.5, 0.75, 0.25, 5.0, 0.0, -0.25, True, 3)
        out += _message("D", b"\x01\x00" + body) + _message("D", b"\x02\x00" + body)
        out += _message("D", b"\x03\x00" + struct.pack("<Q6sffff", boot_us, b"......", half, 0.0, 0.0, half))
        if k % 5 == 0:
            out += _message("S", sync)
    return out


def _message(kind: str, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), ord(kind)) + body
