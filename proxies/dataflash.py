"""ArduPilot dataflash logs (.bin): self-describing binary records, each `A3 95 type` and a body laid out by its FMT.

Time: rows carry the time since boot (TimeUS, older logs TimeMS); satellite fixes carry week and milliseconds besides.
The first 3-D fix ties the two together, less the leap seconds of its date; rows before it are not told. Fixes are
weighed by the receiver's stated accuracy (GPA, in older logs UBX3), attitude and accelerometers are read as well.
"""

import math
import mmap
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pymavlink.DFReader import DFFormat, DFMessage

from navigation.vehicle import (
    AccelerationReport,
    AttitudeReport,
    BatteryReport,
    HomeReport,
    PositionReport,
    Report,
    StatusReport,
    VelocityReport,
)
from proxies.mavlink_reports import flight_mode
from proxies.recordings import Recording

_HEAD = b"\xa3\x95"
_FMT = 0x80
_GPS_EPOCH_US = 315_964_800_000_000
_WEEK_US = 7 * 86_400 * 1_000_000
_LEAPS = ((1_025_136_016, 16), (1_119_744_017, 17), (1_167_264_018, 18))
"""GPS seconds from which on GPS is so many seconds ahead of UTC: July 2012, July 2015, January 2017."""
_PADDING = 528
_WANTED = frozenset({"GPS", "GPA", "UBX3", "ATT", "IMU", "CURR", "BAT", "PARM", "MODE", "EV", "CMD", "ORGN"})
_COPTER, _ARDUPILOT = 2, 3
_ARMED, _DISARMED, _LANDED, _IN_AIR = 10, 11, 18, 28


class DataflashRecording(Recording):
    reference = "GPS"

    def __init__(self, path: Path) -> None:
        super().__init__(path)

    def reports(self) -> Iterator[tuple[int, Report]]:
        rows = _Rows()
        for row in self._records():
            for report in rows.on_row(row):
                yield report.valid_us, report

    def _records(self) -> Iterator[Any]:
        formats: dict[int, Any] = {_FMT: DFFormat(_FMT, "FMT", 89, "BBnNZ", "Type,Length,Name,Format,Columns")}
        with self.bytes() as data:
            if data[:2] != _HEAD:
                raise self.damage(0, "not an ArduPilot dataflash log", "a .bin file begins with the bytes A3 95")
            offset, size = 0, len(data)
            while offset < size:
                layout = (
                    formats.get(data[offset + 2]) if data[offset : offset + 2] == _HEAD and offset + 2 < size else None
                )
                if layout is None:
                    offset = self._passed_over(data, offset, formats)
                    continue
                if offset + layout.len > size:
                    self.note(offset, f"the last record ({layout.name}) is cut off")
                    return
                if layout.type == _FMT or layout.name in _WANTED:
                    row = _row(layout, data[offset + 3 : offset + layout.len])
                    if row is None:
                        self.note(offset, f"a {layout.name} record that its layout does not fit")
                    elif layout.type == _FMT:
                        self._declare(formats, row, offset)
                    else:
                        yield row
                offset += layout.len

    def _declare(self, formats: dict[int, Any], row: Any, offset: int) -> None:
        try:
            formats[row.Type] = DFFormat(row.Type, row.Name, row.Length, row.Format, row.Columns)
        except (KeyError, ValueError, IndexError, struct.error) as error:
            self.note(offset, f"an FMT record that declares nothing readable ({error})")

    def _passed_over(self, data: mmap.mmap, offset: int, formats: dict[int, Any]) -> int:
        """Where the next record begins. Blocks of flash end in padding, which is no damage."""
        at = data.find(_HEAD, offset + 1)
        while at != -1 and (at + 2 >= len(data) or data[at + 2] not in formats):
            at = data.find(_HEAD, at + 1)
        if at == -1:
            if len(data) - offset >= _PADDING:
                raise self.damage(offset, "no records from here to the end")
            return len(data)
        self.note(offset, f"{at - offset} bytes that are no records")
        return at


def _row(layout: Any, body: bytes) -> Any | None:
    try:
        return DFMessage(layout, list(struct.unpack(layout.msg_struct, body)), True, None)
    except (struct.error, UnicodeDecodeError):
        return None


def utc_us(week: int, milliseconds: float) -> int:
    """UTC of a GPS week and the milliseconds in it."""
    gps_us = week * _WEEK_US + round(milliseconds * 1000)
    ahead_s = next((leap for since_s, leap in reversed(_LEAPS) if gps_us >= since_s * 1_000_000), 15)
    return _GPS_EPOCH_US + gps_us - ahead_s * 1_000_000


class _Rows:
    """Rows to reports, with what must be remembered from row to row."""

    def __init__(self) -> None:
        self._offset_us: int | None = None
        self._accuracy: tuple[float | None, float | None, float | None] = (None, None, None)
        self._capacity_mah = 0.0
        self._armed = False
        self._airborne: bool | None = None
        self._mode = ("", False)
        self._now_us = 0

    def on_row(self, row: Any) -> tuple[Report, ...]:
        name = row.fmt.name
        if name == "GPS":
            self._tie(row)
        boot_us = _boot_us(row)
        if boot_us is not None and self._offset_us is not None:
            self._now_us = boot_us + self._offset_us
        made = self._made(name, row)
        return made if self._offset_us is not None else ()

    def _made(self, name: str, row: Any) -> tuple[Report, ...]:
        match name:
            case "GPS":
                return self._on_fix(row)
            case "GPA":
                self._accuracy = (row.HAcc, row.VAcc, row.SAcc)
            case "UBX3":
                self._accuracy = (row.hAcc, row.vAcc, row.sAcc)
            case "ATT":
                angles = (math.radians(each) for each in (row.Roll, row.Pitch, row.Yaw))
                return (AttitudeReport(self._now_us, "ATT", *angles),)
            case "IMU" if getattr(row, "I", 0) == 0:
                return (AccelerationReport(self._now_us, "IMU", row.AccX, row.AccY, row.AccZ),)
            case "CURR" | "BAT":
                return self._on_battery(row)
            case "PARM" if row.Name == "BATT_CAPACITY":
                self._capacity_mah = row.Value
            case "MODE" | "EV":
                return self._on_event(name, row)
            case "CMD" | "ORGN":
                return self._on_home(name, row)
        return ()

    def _tie(self, row: Any) -> None:
        if self._offset_us is not None or row.Status < 3:
            return
        week, in_week_ms = (row.GWk, row.GMS) if hasattr(row, "GWk") else (row.Week, row.TimeMS)
        boot_us = _boot_us(row)
        if boot_us is not None:
            self._offset_us = utc_us(week, in_week_ms) - boot_us

    def _on_fix(self, row: Any) -> tuple[Report, ...]:
        if row.Status < 3 or getattr(row, "I", 0) != 0:
            return ()
        level_m, steep_m, speed_m_s = (each if each and each > 0 else None for each in self._accuracy)
        course = math.radians(row.GCrs)
        north, east = row.Spd * math.cos(course), row.Spd * math.sin(course)
        return (
            VelocityReport(self._now_us, "GPS", north, east, row.VZ, speed_m_s or 0.5),
            PositionReport(
                self._now_us, "GPS", row.Lat, row.Lng, row.Alt, level_m or max(1.0, row.HDop), steep_m or 3.0
            ),
        )

    def _on_battery(self, row: Any) -> tuple[Report, ...]:
        if self._capacity_mah <= 0 or getattr(row, "Instance", 0) != 0:
            return ()
        current_a = row.Curr if row.fmt.name == "BAT" else row.Curr / 100
        left = min(1.0, max(0.0, 1 - row.CurrTot / self._capacity_mah))
        return (BatteryReport(self._now_us, left, current_a),)

    def _on_event(self, name: str, row: Any) -> tuple[Report, ...]:
        if name == "MODE":
            self._mode = flight_mode(_ARDUPILOT, _COPTER, int(row.ModeNum if hasattr(row, "ModeNum") else row.Mode))
        elif row.Id in {_ARMED, _DISARMED}:
            self._armed = row.Id == _ARMED
        elif row.Id in {_LANDED, _IN_AIR}:
            self._airborne = row.Id == _IN_AIR
        else:
            return ()
        return (StatusReport(self._now_us, self._armed, self._mode[1], self._airborne, self._mode[0]),)

    def _on_home(self, name: str, row: Any) -> tuple[Report, ...]:
        is_home = row.CNum == 0 if name == "CMD" else row.Type == 1
        if not is_home or (row.Lat == 0 and row.Lng == 0):
            return ()
        return (HomeReport(self._now_us, row.Lat, row.Lng, row.Alt),)


def _boot_us(row: Any) -> int | None:
    """Time since boot. In older logs a GPS row's TimeMS is the satellites' and T the time since boot."""
    names = row.fmt.columns
    if "TimeUS" in names:
        return int(row.TimeUS)
    if row.fmt.name == "GPS" and "T" in names:
        return int(row.T) * 1000
    return int(row.TimeMS) * 1000 if "TimeMS" in names else None
