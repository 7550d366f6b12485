"""PX4 logs (.ulg): definitions, then data, read message by message so that a long flight needs no more memory than a
short one. The layout is that of the ULog format, version 1: `size: uint16, type: uint8`, then `size` bytes.

Time: rows carry microseconds since boot; the first satellite fix with a UTC ties them to it (none: since 1970).
pyulog, the reference parser, is used by the tests only: it reads a whole log before its first row and keeps all of them (0.7 s of
processor and 41 MB of memory for a log of 44 MB, where the first report comes within 2 ms and nothing is kept), loses the order of
rows among topics, and says that a log is damaged, but not where. Older logs give coordinates in 1e-7 degrees and
millimetres, newer ones in degrees and metres: the field names tell.
"""

import math
import mmap
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from dyknow.navigation import vehicle
from dyknow.proxies.recordings.recording import Recording

_MAGIC = b"ULog\x01\x12\x35"
_SYNC = bytes((0x2F, 0x73, 0x13, 0x20, 0x25, 0x0C, 0xBB, 0x12))
_HEADER = struct.Struct("<HB")
_TYPES = frozenset(b"BFIMPQALCDSOR")
_CODES = {
    "int8_t": "b",
    "uint8_t": "B",
    "int16_t": "h",
    "uint16_t": "H",
    "int32_t": "i",
    "uint32_t": "I",
    "int64_t": "q",
    "uint64_t": "Q",
    "float": "f",
    "double": "d",
    "bool": "?",
    "char": "c",
}
_LARGEST_ARRAY = 10_000
_MOST_FIELDS = 2048
"""Of a topic, those of arrays one by one; the largest of PX4 have some 300."""
_MOST_DEFINITIONS, _DEFINITIONS_BYTES = 4096, 1_000_000
_DEEPEST = 8
_FARTHEST = 16_000_000
"""Bytes without a synchronisation mark after which a log is given up."""
_IMU_PERIOD_US = 20_000
_HOLD_STATES = {4: "AUTO.LOITER", 14: "OFFBOARD"}
_ARMED_STATE = 2
_SOLID_FIX = 3

Row = dict[str, Any]


class _Layout(NamedTuple):
    """Where the plain fields of a topic lie: name -> (offset, struct of one value)."""

    fields: dict[str, tuple[int, struct.Struct]]
    size: int


class UlogRecording(Recording):
    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._utc_offset_us: int | None = None

    def reports(self) -> Iterator[tuple[int, vehicle.Report]]:
        if self._utc_offset_us is None:
            self._utc_offset_us = self._tied()
        rows = _Rows()
        for topic, row in self.rows(frozenset(rows.handlers)):
            valid_us = row["timestamp"] + self._utc_offset_us
            for report in rows.on_row(topic, row, valid_us):
                yield valid_us, report

    def _tied(self) -> int:
        for _, row in self.rows(frozenset({"vehicle_gps_position"})):
            if row.get("time_utc_usec"):
                return int(row["time_utc_usec"]) - int(row["timestamp"])
        return 0

    def rows(self, topics: frozenset[str]) -> Iterator[tuple[str, Row]]:
        """The rows of the first instance of each topic, in file order, plain fields only."""
        definitions = _Definitions()
        subscribed: dict[int, tuple[str, _Layout]] = {}
        for offset, kind, body in self._messages():
            if kind == b"F":
                if not definitions.take(body):
                    raise self.damage(
                        offset, f"more than {_MOST_DEFINITIONS} definitions, or {_DEFINITIONS_BYTES} bytes of them"
                    )
            elif kind == b"A" and len(body) > 3:
                name = body[3:].decode("ascii", "replace")
                if body[0] == 0 and name in topics:
                    subscribed[int.from_bytes(body[1:3], "little")] = name, self._layout(name, definitions, offset)
            elif kind == b"D" and (found := subscribed.get(int.from_bytes(body[:2], "little"))) is not None:
                row = _row(found[1], body)
                if row is None:
                    self.note(offset, f"a row of {found[0]} that is too short")
                else:
                    yield found[0], row

    def _layout(self, name: str, definitions: "_Definitions", offset: int) -> _Layout:
        try:
            return definitions.layout(name)
        except LookupError:
            raise self.damage(offset, f"topic {name} is subscribed but not defined", "the log's head is lost") from None
        except ValueError as wrong:
            raise self.damage(offset, f"topic {name} {wrong}", "the log was damaged, or made by hand") from None

    def _messages(self) -> Iterator[tuple[int, bytes, bytes]]:
        with self.bytes() as data:
            if data[: len(_MAGIC)] != _MAGIC:
                raise self.damage(0, "not a PX4 log", "a .ulg file begins with the bytes ULog")
            offset, size = 16, len(data)
            while offset < size:
                if offset + 3 > size:
                    self.note(offset, "the last message is cut off")
                    return
                length, kind = _HEADER.unpack_from(data, offset)
                if kind not in _TYPES or length == 0:
                    offset = self._synchronised(data, offset)
                    continue
                if offset + 3 + length > size:
                    self.note(offset, "the last message is cut off")
                    return
                yield offset, bytes((kind,)), data[offset + 3 : offset + 3 + length]
                offset += 3 + length

    def _synchronised(self, data: mmap.mmap, offset: int) -> int:
        """Behind the next synchronisation mark, which the logger writes every half second."""
        at = data.find(_SYNC, offset, offset + _FARTHEST)
        if at == -1:
            raise self.damage(offset, "no messages from here to the end")
        self.note(offset, f"{at + len(_SYNC) - offset} bytes that are no messages")
        return at + len(_SYNC)


class _Definitions:
    """Types that a log defines, each once, and their layouts: every type is read once, however often it is used."""

    def __init__(self) -> None:
        self._texts: dict[str, str] = {}
        self._sizes: dict[str, int] = {}
        self._layouts: dict[str, _Layout] = {}
        self._bytes = 0

    def take(self, body: bytes) -> bool:
        """Whether there is room for it; a type that is defined already stays as it is."""
        name, _, fields = body.decode("ascii", "replace").partition(":")
        if name not in self._texts:
            self._texts[name] = fields
            self._bytes += len(body)
        return len(self._texts) <= _MOST_DEFINITIONS and self._bytes <= _DEFINITIONS_BYTES

    def layout(self, name: str) -> _Layout:
        """Where the plain fields of a topic lie, padding left out.

        Raises:
            LookupError: it, or a type in it, is not defined.
            ValueError: it is not one that a vehicle would log, and why.
        """
        found = self._layouts.get(name)
        if found is None:
            found = self._layouts[name] = self._made(name)
        return found

    def _made(self, name: str) -> _Layout:
        fields: dict[str, tuple[int, struct.Struct]] = {}
        offset = 0
        for kind, field, count, is_array in self._fields(name):
            code = _CODES.get(kind)
            if code is None:
                offset += self._size(kind, 1) * count
                continue
            value = struct.Struct("<" + code)
            if not field.startswith("_padding"):
                if len(fields) + count > _MOST_FIELDS:
                    raise ValueError(f"has more than {_MOST_FIELDS} fields")
                for k in range(count):
                    fields[f"{field}[{k}]" if is_array else field] = offset + k * value.size, value
            offset += count * value.size
        return _Layout(fields, offset)

    def _fields(self, name: str) -> Iterator[tuple[str, str, int, bool]]:
        """Type, name, how many, and whether it is an array."""
        for declared in filter(None, self._texts[name].split(";")):
            kind, _, field = declared.partition(" ")
            kind, _, many = kind.partition("[")
            number = many.rstrip("]") if many else "1"
            if not number.isdecimal() or len(number) > 5 or not 0 < int(number) <= _LARGEST_ARRAY:
                raise ValueError(f"has an array of {number:.10} values")
            yield kind, field, int(number), bool(many)

    def _size(self, name: str, depth: int) -> int:
        if name not in self._sizes:
            if depth > _DEEPEST:
                raise ValueError(f"is nested deeper than {_DEEPEST}")
            self._sizes[name] = sum(
                count * (struct.calcsize("<" + _CODES[kind]) if kind in _CODES else self._size(kind, depth + 1))
                for kind, _, count, _ in self._fields(name)
            )
        return self._sizes[name]


def _row(layout: _Layout, body: bytes) -> Row | None:
    """None for one that is too short; padding, which is not logged at the end of a topic, is in no layout."""
    row: Row = {}
    for name, (offset, value) in layout.fields.items():
        if offset + 2 + value.size > len(body):
            return None
        row[name] = value.unpack_from(body, offset + 2)[0]
    return row if "timestamp" in row else None


class _Rows:
    """Rows to reports, with the state from row to row."""

    def __init__(self) -> None:
        self._airborne: bool | None = None
        self._status: Row | None = None
        self._force: list[tuple[float, float, float]] = []
        self._force_from_us = 0
        self.handlers: dict[str, Callable[[Row, int], tuple[vehicle.Report, ...]]] = {
            "vehicle_gps_position": self._on_gps,
            "vehicle_global_position": self._on_global,
            "vehicle_local_position": self._on_local,
            "vehicle_attitude": self._on_attitude,
            "sensor_combined": self._on_force,
            "battery_status": self._on_battery,
            "home_position": self._on_home,
            "vehicle_status": self._on_status,
            "vehicle_land_detected": self._on_land,
        }

    def on_row(self, topic: str, row: Row, valid_us: int) -> tuple[vehicle.Report, ...]:
        try:
            return self.handlers[topic](row, valid_us)
        except KeyError:
            return ()  # a version of the topic without the field

    def _on_gps(self, row: Row, valid_us: int) -> tuple[vehicle.Report, ...]:
        if row["fix_type"] < _SOLID_FIX:
            return ()
        if "latitude_deg" in row:
            at = row["latitude_deg"], row["longitude_deg"], row["altitude_msl_m"]
        else:
            at = row["lat"] / 1e7, row["lon"] / 1e7, row["alt"] / 1e3
        name = "vehicle_gps_position"
        position = vehicle.PositionReport(valid_us, name, *at, _stated(row["eph"]), _stated(row["epv"]))
        if not row["vel_ned_valid"]:
            return (position,)
        velocity = row["vel_n_m_s"], row["vel_e_m_s"], row["vel_d_m_s"]
        return vehicle.VelocityReport(valid_us, name, *velocity, _stated(row["s_variance_m_s"])), position

    def _on_global(self, row: Row, valid_us: int) -> tuple[vehicle.Report, ...]:
        at = row["lat"], row["lon"], row["alt"]
        accuracy = _stated(row["eph"]), _stated(row["epv"])
        return (vehicle.PositionReport(valid_us, "vehicle_global_position", *at, *accuracy),)

    def _on_local(self, row: Row, valid_us: int) -> tuple[vehicle.Report, ...]:
        if not (row["v_xy_valid"] and row["v_z_valid"]):
            return ()
        velocity = row["vx"], row["vy"], row["vz"]
        return (
            vehicle.VelocityReport(valid_us, "vehicle_local_position", *velocity, _stated(row.get("evh", math.nan))),
        )

    def _on_attitude(self, row: Row, valid_us: int) -> tuple[vehicle.Report, ...]:
        w, x, y, z = (row[f"q[{k}]"] for k in range(4))
        roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
        yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        return (vehicle.AttitudeReport(valid_us, "vehicle_attitude", roll, pitch, yaw),)

    def _on_force(self, row: Row, valid_us: int) -> tuple[vehicle.Report, ...]:
        """Averaged over 20 ms: the sensor's 250 Hz say no more to a filter of positions."""
        self._force.append((row["accelerometer_m_s2[0]"], row["accelerometer_m_s2[1]"], row["accelerometer_m_s2[2]"]))
        if valid_us - self._force_from_us < _IMU_PERIOD_US:
            return ()
        n = len(self._force)
        mean = (sum(each[axis] for each in self._force) / n for axis in range(3))
        self._force, self._force_from_us = [], valid_us
        return (vehicle.AccelerationReport(valid_us, "sensor_combined", *mean),)

    def _on_battery(self, row: Row, valid_us: int) -> tuple[vehicle.Report, ...]:
        if not 0.0 <= row["remaining"] <= 1.0:
            return ()
        current_a = row["current_a"]
        return (vehicle.BatteryReport(valid_us, row["remaining"], current_a if current_a >= 0 else None),)

    def _on_home(self, row: Row, valid_us: int) -> tuple[vehicle.Report, ...]:
        at = row["lat"], row["lon"], row["alt"]
        return (vehicle.HomeReport(valid_us, *at),) if all(map(math.isfinite, at)) else ()

    def _on_status(self, row: Row, valid_us: int) -> tuple[vehicle.Report, ...]:
        self._status = row
        state = row["nav_state"]
        mode = _HOLD_STATES.get(state, f"NAV_STATE_{state}")
        armed = row["arming_state"] == _ARMED_STATE
        return (vehicle.StatusReport(valid_us, armed, state in _HOLD_STATES, self._airborne, mode),)

    def _on_land(self, row: Row, valid_us: int) -> tuple[vehicle.Report, ...]:
        self._airborne = not row["landed"]
        return self._on_status(self._status, valid_us) if self._status is not None else ()


def _stated(accuracy: float) -> float | None:
    return accuracy if math.isfinite(accuracy) and accuracy > 0 else None
