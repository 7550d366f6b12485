"""ArduPilot dataflash logs (.bin): self-describing binary records, each `A3 95 type` and a body laid out by its FMT.

Time: rows carry the time since boot (TimeUS, older logs TimeMS); satellite fixes carry week and milliseconds besides.
The first 3-D fix ties the two together, less the leap seconds of its date; rows before it are not reported. Fixes are
weighed by the receiver's stated accuracy (GPA, in older logs UBX3), attitude and accelerometers are read as well.

pymavlink's DFReader is not used: it indexes the whole file before its first record (0.1 s of processor and 66 MB of memory for a
log of 48 MB, where the first report comes within 10 ms and nothing is kept), takes twice as long for all of it, and prints damage
instead of naming it.
"""

import math
import mmap
import struct
from collections.abc import Iterator
from typing import Any, NamedTuple

from dyknow.navigation import vehicle
from dyknow.proxies.mavlink.reports import flight_mode
from dyknow.proxies.recordings.recording import Recording

_HEAD = b"\xa3\x95"
_FMT = 0x80
_GPS_EPOCH_US = 315_964_800_000_000
_WEEK_US = 7 * 86_400 * 1_000_000
_LEAPS = ((1_025_136_016, 16), (1_119_744_017, 17), (1_167_264_018, 18))
"""GPS seconds from which on GPS is that number of seconds ahead of UTC: July 2012, July 2015, January 2017."""
_PADDING = 528
_FARTHEST = 1_000_000
"""Bytes that are no records after which a log is given up."""
_WANTED = frozenset({"GPS", "GPA", "UBX3", "ATT", "IMU", "CURR", "BAT", "PARM", "MODE", "EV", "CMD", "ORGN"})
_COPTER, _ARDUPILOT = 2, 3
_SOLID_FIX = 3
_SHORTEST = 3
_ARMED, _DISARMED, _LANDED, _IN_AIR = 10, 11, 18, 28


_CODES: dict[str, tuple[str, float | None]] = {
    "a": ("64s", None), "b": ("b", 1), "B": ("B", 1), "h": ("h", 1), "H": ("H", 1), "i": ("i", 1), "I": ("I", 1),
    "f": ("f", 1), "d": ("d", 1), "n": ("4s", None), "N": ("16s", None), "Z": ("64s", None), "c": ("h", 0.01),
    "C": ("H", 0.01), "e": ("i", 0.01), "E": ("I", 0.01), "L": ("i", 1e-7), "M": ("B", 1), "q": ("q", 1), "Q": ("Q", 1),
}  # fmt: skip
"""Format character of a column: its struct, and the factor of its number (None: text)."""

Row = dict[str, Any]
_TEXTS = frozenset({"Name", "Format", "Columns"})


class _Layout(NamedTuple):
    """`name` is empty for records that can only be passed over."""

    name: str
    length: int
    body: struct.Struct
    columns: tuple[str, ...]
    factors: tuple[float | None, ...]

    def row(self, body: bytes) -> Row:
        """Values by column. Text in a column that has none where we know it is left out, as if it were not there."""
        values = zip(self.columns, self.body.unpack(body), self.factors, strict=True)
        return {
            name: _text(value) if factor is None else value * factor
            for name, value, factor in values
            if factor is not None or name in _TEXTS
        }


def _text(value: bytes) -> str:
    return value.split(b"\0", 1)[0].decode("ascii", "replace")


def _layout(name: str, length: int, codes: str, columns: str) -> _Layout | None:
    """None where the declaration contradicts itself."""
    names = tuple(filter(None, columns.split(",")))
    if len(names) != len(codes) or not all(code in _CODES for code in codes):
        return None
    body = struct.Struct("<" + "".join(_CODES[code][0] for code in codes))
    factors = tuple(_CODES[code][1] for code in codes)
    return _Layout(name, length, body, names, factors) if body.size + _SHORTEST == length else None


_FORMATS = _Layout(
    "FMT", 89, struct.Struct("<BB4s16s64s"), ("Type", "Length", "Name", "Format", "Columns"), (1, 1, None, None, None)
)


class DataflashRecording(Recording):
    reference = "GPS"

    def reports(self) -> Iterator[tuple[int, vehicle.Report]]:
        rows = _Rows()
        for name, row in self._records():
            for report in rows.on_row(name, row):
                yield report.valid_us, report

    def _records(self) -> Iterator[tuple[str, Row]]:
        layouts = {_FMT: _FORMATS}
        with self.bytes() as data:
            if data[:2] != _HEAD:
                raise self.damage(0, "not an ArduPilot dataflash log", "a .bin file begins with the bytes A3 95")
            offset, size = 0, len(data)
            while offset < size:
                layout = None
                if offset + 2 < size and data[offset : offset + 2] == _HEAD:
                    layout = layouts.get(data[offset + 2])
                if layout is None:
                    offset = self._passed_over(data, offset, layouts)
                    continue
                if offset + layout.length > size:
                    self.note(offset, f"the last record ({layout.name}) is cut off")
                    return
                if layout is _FORMATS:
                    self._declare(layouts, layout.row(data[offset + 3 : offset + layout.length]), offset)
                elif layout.name in _WANTED:
                    yield layout.name, layout.row(data[offset + 3 : offset + layout.length])
                offset += layout.length

    def _declare(self, layouts: dict[int, _Layout], row: Row, offset: int) -> None:
        kind, length = row["Type"], row["Length"]
        layout = _layout(row["Name"], length, row["Format"], row["Columns"])
        if layout is None:
            self.note(offset, f"a declaration of {row['Name']!r} that contradicts itself")
            layout = _Layout("", length, struct.Struct(""), (), ())
        if kind != _FMT and length >= _SHORTEST:
            layouts[kind] = layout

    def _passed_over(self, data: mmap.mmap, offset: int, layouts: dict[int, _Layout]) -> int:
        """Where the next record begins. Blocks of flash end in padding, which is no damage."""
        end = min(len(data), offset + _FARTHEST)
        at = data.find(_HEAD, offset + 1, end)
        while at != -1 and (at + 2 >= len(data) or data[at + 2] not in layouts):
            at = data.find(_HEAD, at + 1, end)
        if at == -1:
            if len(data) - offset >= _PADDING:
                raise self.damage(offset, "no records from here to the end")
            return len(data)
        self.note(offset, f"{at - offset} bytes that are no records")
        return at


def utc_us(week: int, milliseconds: float) -> int:
    """UTC of a GPS week and the milliseconds in it."""
    gps_us = week * _WEEK_US + round(milliseconds * 1000)
    ahead_s = next((leap for since_s, leap in reversed(_LEAPS) if gps_us >= since_s * 1_000_000), 15)
    return _GPS_EPOCH_US + gps_us - ahead_s * 1_000_000


class _Rows:
    """Rows to reports, with the state from row to row."""

    def __init__(self) -> None:
        self._offset_us: int | None = None
        self._accuracy: tuple[float | None, float | None, float | None] = (None, None, None)
        self._capacity_mah = 0.0
        self._armed = False
        self._airborne: bool | None = None
        self._mode = ("", False)
        self._now_us = 0

    def on_row(self, name: str, row: Row) -> tuple[vehicle.Report, ...]:
        """The reports of a row; none for a version of it without the fields we read, or without numbers in them."""
        try:
            if name == "GPS":
                self._tie(row)
            boot_us = _boot_us(name, row)
            if boot_us is not None and self._offset_us is not None:
                self._now_us = boot_us + self._offset_us
            made = self._made(name, row)
        except (KeyError, ValueError, OverflowError):
            return ()
        return made if self._offset_us is not None else ()

    def _made(self, name: str, row: Row) -> tuple[vehicle.Report, ...]:
        match name:
            case "GPS":
                return self._on_fix(row)
            case "GPA":
                self._accuracy = (row["HAcc"], row["VAcc"], row["SAcc"])
            case "UBX3":
                self._accuracy = (row["hAcc"], row["vAcc"], row["sAcc"])
            case "ATT":
                angles = (math.radians(row[each]) for each in ("Roll", "Pitch", "Yaw"))
                return (vehicle.AttitudeReport(self._now_us, "ATT", *angles),)
            case "IMU" if row.get("I", 0) == 0:
                return (vehicle.AccelerationReport(self._now_us, "IMU", row["AccX"], row["AccY"], row["AccZ"]),)
            case "CURR" | "BAT":
                return self._on_battery(name, row)
            case "PARM" if row["Name"] == "BATT_CAPACITY":
                self._capacity_mah = row["Value"]
            case "MODE" | "EV":
                return self._on_event(name, row)
            case "CMD" | "ORGN":
                return self._on_home(name, row)
        return ()

    def _tie(self, row: Row) -> None:
        if self._offset_us is not None or row["Status"] < _SOLID_FIX:
            return
        week, in_week_ms = (row["GWk"], row["GMS"]) if "GWk" in row else (row["Week"], row["TimeMS"])
        boot_us = _boot_us("GPS", row)
        if boot_us is not None:
            self._offset_us = utc_us(week, in_week_ms) - boot_us

    def _on_fix(self, row: Row) -> tuple[vehicle.Report, ...]:
        if row["Status"] < _SOLID_FIX or row.get("I", 0) != 0:
            return ()
        level_m, steep_m, speed_m_s = (each if each and each > 0 else None for each in self._accuracy)
        course = math.radians(row["GCrs"]) if math.isfinite(row["GCrs"]) else 0.0
        north, east = row["Spd"] * math.cos(course), row["Spd"] * math.sin(course)
        at = row["Lat"], row["Lng"], row["Alt"]
        return (
            vehicle.VelocityReport(self._now_us, "GPS", north, east, row["VZ"], speed_m_s or 0.5),
            vehicle.PositionReport(self._now_us, "GPS", *at, level_m or max(1.0, row["HDop"]), steep_m or 3.0),
        )

    def _on_battery(self, name: str, row: Row) -> tuple[vehicle.Report, ...]:
        left = 1 - row["CurrTot"] / self._capacity_mah if self._capacity_mah > 0 else math.nan
        if not math.isfinite(left) or row.get("Instance", 0) != 0:
            return ()
        current_a = row["Curr"] if name == "BAT" else row["Curr"] / 100
        return (vehicle.BatteryReport(self._now_us, min(1.0, max(0.0, left)), current_a),)

    def _on_event(self, name: str, row: Row) -> tuple[vehicle.Report, ...]:
        if name == "MODE":
            number = row["ModeNum"] if "ModeNum" in row else row["Mode"]
            self._mode = flight_mode(_ARDUPILOT, _COPTER, int(number))
        elif row["Id"] in {_ARMED, _DISARMED}:
            self._armed = row["Id"] == _ARMED
        elif row["Id"] in {_LANDED, _IN_AIR}:
            self._airborne = row["Id"] == _IN_AIR
        else:
            return ()
        return (vehicle.StatusReport(self._now_us, self._armed, self._mode[1], self._airborne, self._mode[0]),)

    def _on_home(self, name: str, row: Row) -> tuple[vehicle.Report, ...]:
        is_home = row["CNum"] == 0 if name == "CMD" else row["Type"] == 1
        if not is_home or (row["Lat"] == 0 and row["Lng"] == 0):
            return ()
        return (vehicle.HomeReport(self._now_us, row["Lat"], row["Lng"], row["Alt"]),)


def _boot_us(name: str, row: Row) -> int | None:
    """Time since boot. In older logs a GPS row's TimeMS is the satellites' and T the time since boot."""
    if "TimeUS" in row:
        return int(row["TimeUS"])
    if name == "GPS" and "T" in row:
        return int(row["T"]) * 1000
    return int(row["TimeMS"]) * 1000 if "TimeMS" in row else None
