"""MAVLink telemetry logs (.tlog): each record is an 8-byte big-endian stamp, microseconds of UTC, and one frame.

The stamps are the time: they outlast the vehicle's reboots. Frames of other systems, of unwanted types, and those that
the radio garbled (their checksum says so) are passed over, as a receiver would have.
"""

import mmap
import re
import struct
from collections.abc import Iterator
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.navigation.vehicle import Report
from dyknow.proxies.mavlink.frames import Frame, decoded, frame_at
from dyknow.proxies.mavlink.reports import VehicleReports, device_us, is_autopilot, tells_time
from dyknow.proxies.recordings.recording import Recording

_STAMP = struct.Struct(">Q")
_EARLIEST_US, _LATEST_US = 946_684_800_000_000, 4_102_444_800_000_000  # the years 2000 and 2100
_REBOOT_US = 1_000_000
_LONGEST = 8 + 12 + 255 + 13
_FARTHEST = 1_000_000
"""Bytes that are no records after which a log is given up."""
_BEGINS = re.compile(b"[\xfe\xfd]")


class TelemetryRecording(Recording):
    """The first autopilot of the log, or the one with `system` as its id."""

    reference = "GLOBAL_POSITION_INT"

    def __init__(self, path: Path, system: int | None = None) -> None:
        super().__init__(path)
        self._system = system

    def reports(self) -> Iterator[tuple[int, Report]]:
        codec, known = mavlink.MAVLink(None), VehicleReports()
        system, booted_us = self._system, 0
        for stamp_us, frame in self._records():
            if system is not None and (frame.system, frame.component) != (system, 1):
                continue
            message = decoded(codec, frame)
            if message is None:
                continue
            if system is None:
                if message.get_type() != "HEARTBEAT" or not is_autopilot(message):
                    continue
                system = frame.system
            since_boot_us = device_us(message) if tells_time(message) else None
            if since_boot_us is not None:
                if since_boot_us < booted_us - _REBOOT_US:
                    known.on_reboot()
                booted_us = since_boot_us
            for report in known.reports(message, stamp_us):
                yield stamp_us, report

    def _records(self) -> Iterator[tuple[int, Frame]]:
        with self.bytes() as data:
            offset, size = 0, len(data)
            while offset < size:
                record = _record_at(data, offset)
                if record is None or not record[1].whole:
                    found = _resumed(data, offset + 1)
                    if found is None and record is None and size - offset > _LONGEST:
                        raise self.damage(offset, "no records from here to the end")
                    if found is None:
                        self.note(offset, "the last record is cut off")
                        return
                    self.note(offset, f"{found - offset} bytes that are no records")
                    offset = found
                    continue
                yield record
                offset += 8 + len(record[1].data)


def _record_at(data: mmap.mmap, offset: int) -> tuple[int, Frame] | None:
    if offset + 8 > len(data):
        return None
    (stamp_us,) = _STAMP.unpack_from(data, offset)
    frame = frame_at(data, offset + 8)
    return None if frame is None or not _EARLIEST_US < stamp_us < _LATEST_US else (stamp_us, frame)


def _resumed(data: mmap.mmap, offset: int) -> int | None:
    """The next place from `offset` on where a whole record is followed by another, or by the end."""
    for found in _BEGINS.finditer(data, offset + 8, min(len(data), offset + _FARTHEST)):
        at = found.start() - 8
        record = _record_at(data, at)
        if record is None or not record[1].whole:
            continue
        after = at + 8 + len(record[1].data)
        if after == len(data) or _record_at(data, after) is not None:
            return at
    return None
