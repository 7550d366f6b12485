"""A joined vehicle's MAVLink for a ground station: its frames unchanged, and by option the station's commands back.

A station's command is never passed on unnoticed: the platform is notified first. A change to a mode that takes no
positions, and remote control, are the pilot's own hands; a place to fly to is a target, as from a station at a router.
Only the station's address may answer, in frames that do not claim to be the vehicle's, a limited number a second.
"""

import socket
import struct
import threading
import time
from collections import Counter
from collections.abc import Callable
from typing import Final, Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.navigation.vehicle import Report, StationReport
from dyknow.proxies.mavlink.frames import Cutter, Frame
from dyknow.proxies.outward.outlets import Destination

MOST_BACK_PER_S: Final = 200
"""Frames of the station, and that number at once."""
_WAIT_S = 0.2
_AGAIN_S = 1.0
_DATAGRAM = 65_535
_HARMLESS: Final = frozenset(
    getattr(mavlink, f"MAVLINK_MSG_ID_{name}")
    for name in (
        "HEARTBEAT", "SYSTEM_TIME", "PING", "PARAM_REQUEST_READ", "PARAM_REQUEST_LIST", "MISSION_REQUEST_LIST",
        "MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK", "REQUEST_DATA_STREAM", "TIMESYNC", "COMMAND_ACK",
        "STATUSTEXT", "LOG_REQUEST_LIST", "LOG_REQUEST_DATA", "LOG_REQUEST_END", "AUTOPILOT_VERSION_REQUEST",
    )
)  # fmt: skip
"""Messages that ask or tell. Every other one counts as a command."""
_ASKING: Final = frozenset({410, 510, 511, 512, 519, 520, 521, 522, 525, 526, 527, 528})
"""MAV_CMD numbers that ask for messages."""
_COMMANDS: Final = frozenset({mavlink.MAVLINK_MSG_ID_COMMAND_LONG, mavlink.MAVLINK_MSG_ID_COMMAND_INT})
_COMMAND_AT = 28
_MODE_COMMANDS: Final = frozenset(
    getattr(mavlink, f"MAV_CMD_{name}")
    for name in (
        "NAV_LOITER_UNLIM", "NAV_RETURN_TO_LAUNCH", "NAV_LAND", "DO_SET_MODE", "DO_SET_STANDARD_MODE", "MISSION_START",
        "DO_FLIGHTTERMINATION", "DO_PAUSE_CONTINUE",
    )
)  # fmt: skip
_MODES: Final = 1 << 24
_STICKS: Final = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_RC_CHANNELS_OVERRIDE,
        mavlink.MAVLINK_MSG_ID_MANUAL_CONTROL,
        mavlink.MAVLINK_MSG_ID_MANUAL_SETPOINT,
    }
)


class Passes(Protocol):
    """The side of the vehicle."""

    def pass_on(self, system: int, data: bytes) -> bool: ...


class Forwarder:
    """Frames to a ground station and back.

    Args:
        to: the ground station.
        system: the system id of the vehicle, once it is known.
        vehicle: takes what the station sends.
        post: takes reports.
        now_us: federation time.
        commands: whether what the station sends is passed to the vehicle.
        takes_positions: whether the vehicle takes positions in a mode, by its number and the number of its kind.

    Attributes:
        counts: `forwarded`, `passed back`, and frames that were dropped, by reason.
    """

    def __init__(
        self,
        to: Destination,
        system: Callable[[], int | None],
        vehicle: Passes,
        post: Callable[[Report], None],
        now_us: Callable[[], int],
        *,
        commands: bool = False,
        takes_positions: Callable[[int, int], bool] = lambda _mode, _kind: False,
    ) -> None:
        self.to, self.counts = to, Counter[str]()
        self._system, self._vehicle, self._post, self._now_us = system, vehicle, post, now_us
        self._commands, self._cutter, self._takes_positions = commands, Cutter(), takes_positions
        self._noted = ""
        self._left, self._left_s = float(MOST_BACK_PER_S), time.monotonic()
        self._trouble, self._told_s = "", 0.0
        self._stopping = threading.Event()
        self._socket = socket.socket(socket.AF_INET6 if ":" in to.host else socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.settimeout(_WAIT_S)
        self._socket.connect((to.host, to.port))
        self._thread = threading.Thread(target=self._run, name=f"forward-{to.port}", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join(timeout=2.0)
        self._socket.close()

    def on_frame(self, frame: Frame) -> None:
        """An intact frame of the vehicle's endpoint, from where the vehicle speaks."""
        if frame.system != self._system():
            return
        try:
            self._socket.send(frame.data)
        except OSError as why:
            self.counts["not forwarded"] += 1
            self._tell(f"nothing at {self.to} takes what is forwarded: {why.strerror or why}")
        else:
            self.counts["forwarded"] += 1

    def _tell(self, trouble: str) -> None:
        """Report trouble once, again after it has changed."""
        if trouble != self._trouble:
            self._trouble = trouble
            self._post(StationReport(self._now_us(), commands=False, text=trouble))

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                data = self._socket.recv(_DATAGRAM)
            except TimeoutError:
                continue
            except OSError:
                self._stopping.wait(_WAIT_S)
                continue
            self._tell(f"a ground station at {self.to} hears the vehicle")
            for frame in self._cutter.cut(data):
                self._on_station(frame)
            self.counts["damaged"] = self._cutter.damaged

    def _on_station(self, frame: Frame) -> None:
        system, now_s = self._system(), time.monotonic()
        self._left = min(MOST_BACK_PER_S, self._left + (now_s - self._left_s) * MOST_BACK_PER_S)
        self._left_s = now_s
        if not self._commands:
            self.counts["commands are not forwarded"] += 1
        elif system is None or frame.system == system:
            self.counts["speaks as the vehicle"] += 1
        elif self._left < 1:
            self.counts["too many"] += 1
        else:
            self._left -= 1
            if named := command_in(frame):
                self._on_command(frame, named, now_s)
            self.counts["passed back" if self._vehicle.pass_on(system, frame.data) else "not passed back"] += 1

    def _on_command(self, frame: Frame, named: str, now_s: float) -> None:
        """Report hands again and again, any other command when it is another one than the last."""
        text = f"ground station {frame.system}/{frame.component} has commanded the vehicle ({named})"
        if self._is_hands(frame):
            if now_s - self._told_s >= _AGAIN_S:
                self._told_s, self._noted = now_s, ""
                self._post(StationReport(self._now_us(), commands=True, text=text))
        elif text != self._noted:
            self._noted = text
            self._post(StationReport(self._now_us(), commands=False, text=text))

    def _is_hands(self, frame: Frame) -> bool:
        payload = _payload(frame)
        if frame.message_id == mavlink.MAVLINK_MSG_ID_SET_MODE:
            return not self._takes_positions(int.from_bytes(payload[:4], "little"), 0)
        if frame.message_id in _COMMANDS:
            number = _number(payload)
            if number != mavlink.MAV_CMD_DO_SET_MODE:
                return number in _MODE_COMMANDS
            modes = struct.unpack_from("<ff", payload, 4)
            if not all(0.0 <= each < _MODES for each in modes):
                return True
            return not self._takes_positions(int(modes[0]), int(modes[1]))
        return frame.message_id in _STICKS


def _payload(frame: Frame) -> bytes:
    """Version 2 leaves out zeros at the end."""
    return frame.data[6 if frame.version == 1 else 10 :][: frame.data[1]].ljust(_COMMAND_AT + 2, b"\0")


def _number(payload: bytes) -> int:
    return int.from_bytes(payload[_COMMAND_AT : _COMMAND_AT + 2], "little")


def command_in(frame: Frame) -> str:
    """The name of the frame's command; empty if it only asks or reports."""
    if frame.message_id in _HARMLESS:
        return ""
    if frame.message_id in _COMMANDS:
        number = _number(_payload(frame))
        if number in _ASKING:
            return ""
        entry = mavlink.enums["MAV_CMD"].get(number)
        return str(entry.name) if entry else f"command {number}"
    return str(mavlink.mavlink_map[frame.message_id].msgname)
