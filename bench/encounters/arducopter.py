"""ArduCopter in the loop: the process and its ground station. Loopback only.

`DYKNOW_SITL` names the folder with the binary `arducopter` and its parameters `copter.parm` and `extra.parm`. Simulated
time runs as fast as `speed` says: a start takes seconds, an encounter is flown in real time.
"""

import math
import os
import random
import socket
import struct
import subprocess
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from bench.encounters.links import STATION, Tap, received, udp

LATITUDE_DEG, LONGITUDE_DEG, GROUND_M = 56.2, 12.5, 50.0
METRES_PER_DEG = 111_319.5
_EAST_PER_DEG = METRES_PER_DEG * math.cos(math.radians(LATITUDE_DEG))
MODES = {"AUTO": 3, "GUIDED": 4, "LOITER": 5, "RTL": 6, "LAND": 9}
_FASTEST = 10.0
_FIRST_PORT, _SLOTS, _FIRST_INSTANCE = 20_000, 200, 500
_BOOT_S, _STEP_S = 90.0, 0.02
_POSITION_ONLY = 0b0000111111111000
_HEARTBEAT_S, _STREAM_S = 1.0, 0.5
_WIND_FROM_DEG: Final = 135.0


def folder() -> Path:
    """Where ArduCopter is.

    Raises:
        LookupError: it is not here, or does not run.
    """
    named = os.environ.get("DYKNOW_SITL", "")
    if not named or not os.access(Path(named) / "arducopter", os.X_OK):
        raise LookupError("DYKNOW_SITL does not name a folder with ArduCopter")
    return Path(named)


class Ports:
    """An instance number of ArduCopter and two ports beside it, kept for one vehicle on this machine by a lock.

    They lie below the ports that the system hands out, and the lock is a port as well: whoever has it has them all.
    """

    def __init__(self) -> None:
        self._lock = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        for slot in random.Random().sample(range(_SLOTS), _SLOTS):
            first = _FIRST_PORT + 3 * slot
            if _binds(self._lock, first) and all(_is_free(first + more) for more in (1, 2)):
                self.instance, self.rc, self.platform = _FIRST_INSTANCE + slot, first + 1, first + 2
                return
            self._lock.close()
            self._lock = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        raise OSError("no free ports for another vehicle")

    def close(self) -> None:
        self._lock.close()


class Place(NamedTuple):
    """Metres north and east of the origin, and above the ground."""

    north_m: float
    east_m: float
    up_m: float

    def distance_m(self, other: "Place") -> float:
        return math.dist(self, other)

    @property
    def degrees(self) -> tuple[float, float]:
        return LATITUDE_DEG + self.north_m / METRES_PER_DEG, LONGITUDE_DEG + self.east_m / _EAST_PER_DEG


class Seen(NamedTuple):
    """Where a vehicle truly was (SIM_STATE), at a time of this machine (s) and of the simulation (s)."""

    at_s: float
    sim_s: float
    place: Place


class Mode(NamedTuple):
    """The mode of a vehicle, and the item of its mission, from a time of this machine on (s)."""

    at_s: float
    name: str
    item: int


class Copter:
    """One simulated vehicle with its ground station; `tap` is where its platform finds it.

    Attributes:
        track: where it truly was.
        modes: its mode and mission item, each time one changed.
        target: what the ground station sends again twice a second, if anything; `streamed_s`: when it did.
        route: where the ground station hears the platform, if that forwards; is_routed: it speaks to the vehicle there.
    """

    def __init__(self, number: int, home: Place, directory: Path, seed: int = 0) -> None:
        self.number, self.home, self.system = number, home, number + 1
        self._ports = Ports()
        self.tap = Tap(random.Random(f"tap {seed} {number}"), self._ports.platform)
        self.track: list[Seen] = []
        self.mode, self.item, self.armed, self.sim_s = "", 0, False, 0.0
        self.modes: list[Mode] = []
        self.target: Place | None = None
        self.streamed_s: list[float] = []
        self._ground, self._answers = udp(), threading.Condition()
        self._route, self.is_routed = udp(), False
        self._platform: Any = None
        self.route: int = self._route.getsockname()[1]
        self._heard: dict[str, Any] = {}
        self._acks: list[Any] = []
        self._texts: list[str] = []
        self._from: Any = None
        self._codec = mavlink.MAVLink(None, srcSystem=STATION, srcComponent=190)
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True
        self._pwm = [1500, 1500, 1000, 1500, 1800, 1000, 1000, 1800]
        self._rc = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._going = True
        directory.mkdir(parents=True, exist_ok=True)
        self.process = self._launched(directory)
        self._threads = [threading.Thread(target=each, daemon=True) for each in (self._listen, self._beat, self._find)]
        for thread in self._threads:
            thread.start()

    def _launched(self, directory: Path) -> "subprocess.Popen[bytes]":
        latitude_deg, longitude_deg = self.home.degrees
        here, ground = folder(), self._ground.getsockname()[1]
        with (directory / "sitl.log").open("wb") as log:
            return subprocess.Popen(
                [
                    str(here / "arducopter"), "-w", "-I", str(self._ports.instance), "--model", "+",
                    "--speedup", str(_FASTEST), "--home", f"{latitude_deg:.7f},{longitude_deg:.7f},{GROUND_M},0",
                    "--sysid", str(self.system), "--defaults", f"{here / 'copter.parm'},{here / 'extra.parm'}",
                    "--rc-in-port", str(self._ports.rc),
                    "--serial0", f"udpclient:127.0.0.1:{self.tap.vehicle_port}",
                    "--serial1", f"udpclient:127.0.0.1:{ground}", "--serial2", "udpclient:127.0.0.1:9",
                ],
                cwd=directory, stdin=subprocess.DEVNULL, stdout=log, stderr=log,
            )  # fmt: skip

    # -- the ground station -------------------------------------------------------------------------------------

    def _listen(self) -> None:
        while (packet := received(self._ground, lambda: self._going)) is not None:
            payload, self._from = packet
            for message in self._parser.parse_buffer(payload) or ():
                self._on_message(message)

    def _find(self) -> None:
        """Where the platform forwards from."""
        while (packet := received(self._route, lambda: self._going)) is not None:
            self._platform = packet[1]

    def _on_message(self, message: Any) -> None:
        kind = message.get_type()
        if kind == "SIM_STATE":
            north_m = (message.lat_int / 1e7 - LATITUDE_DEG) * METRES_PER_DEG
            east_m = (message.lon_int / 1e7 - LONGITUDE_DEG) * _EAST_PER_DEG
            place = Place(north_m, east_m, message.alt - GROUND_M)
            self.track.append(Seen(time.monotonic(), self.sim_s, place))
        elif kind == "HEARTBEAT" and message.type != mavlink.MAV_TYPE_GCS:
            modes = {number: name for name, number in MODES.items()}
            self.mode = modes.get(message.custom_mode, str(message.custom_mode))
            self.armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
            self._note_mode()
        elif kind == "MISSION_CURRENT":
            self.item = message.seq
            self._note_mode()
        elif kind == "ATTITUDE":
            self.sim_s = message.time_boot_ms / 1e3
        elif kind == "STATUSTEXT":
            self._texts.append(message.text)
        with self._answers:
            self._heard[kind] = message
            if kind in {"COMMAND_ACK", "MISSION_ACK", "MISSION_REQUEST", "MISSION_REQUEST_INT", "PARAM_VALUE"}:
                self._acks.append(message)
            self._answers.notify_all()

    def _note_mode(self) -> None:
        found = Mode(time.monotonic(), self.mode, self.item)
        if not self.modes or self.modes[-1][1:] != found[1:]:
            self.modes.append(found)

    def _beat(self) -> None:
        last_s = sent_s = 0.0
        while self._going:
            if time.monotonic() >= last_s + _HEARTBEAT_S:
                last_s = time.monotonic()
                self.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
                self._rc.sendto(struct.pack("<8H", *self._pwm), ("127.0.0.1", self._ports.rc))
            if self.target is not None and time.monotonic() >= sent_s + _STREAM_S:
                sent_s = time.monotonic()
                self.goto(self.target)
                self.streamed_s.append(sent_s)
            time.sleep(_STEP_S)

    def send(self, message: Any) -> None:
        if self.is_routed and self._platform is not None:
            self._route.sendto(message.pack(self._codec), self._platform)
        elif self._from is not None:
            self._ground.sendto(message.pack(self._codec), self._from)

    def _until(
        self, is_so: Callable[[], bool], within_s: float, again: Callable[[], None], every_s: float = 0.5
    ) -> bool:
        """Say something again and again until it is so."""
        until_s, again_s = time.monotonic() + within_s, 0.0
        while not is_so():
            if time.monotonic() > until_s or self.process.poll() is not None:
                return False
            if time.monotonic() >= again_s:
                again()
                again_s = time.monotonic() + every_s
            with self._answers:
                self._answers.wait(0.05)
        return True

    def command(self, command: int, *parameters: float) -> None:
        filled = (*parameters, *(0.0,) * (7 - len(parameters)))
        self.send(mavlink.MAVLink_command_long_message(self.system, 1, command, 0, *filled))

    def set(self, name: str, value: float) -> None:
        """Set a parameter, and see that it is taken."""

        def taken() -> bool:
            found = [m for m in self._acks if m.get_type() == "PARAM_VALUE" and m.param_id == name]
            return bool(found) and abs(found[-1].param_value - value) < 1e-3

        asked = mavlink.MAVLink_param_set_message(self.system, 1, name.encode(), value, 9)
        if not self._until(taken, 10.0, lambda: self.send(asked)):
            raise TimeoutError(f"{name} is not set on vehicle {self.number}")

    def set_mode(self, name: str) -> None:
        asked = mavlink.MAVLink_set_mode_message(self.system, 1, MODES[name])
        if not self._until(lambda: self.mode == name, 10.0, lambda: self.send(asked)):
            raise TimeoutError(f"vehicle {self.number} does not go to {name}, it is in {self.mode}")

    def speed(self, times: float) -> None:
        """How fast simulated time runs."""
        self.set("SIM_SPEEDUP", times)

    def wind(self, speed_m_s: float) -> None:
        """Have the wind blow at that speed, also near the ground."""
        for name, value in (("SIM_WIND_T", 1.0), ("SIM_WIND_DIR", _WIND_FROM_DEG), ("SIM_WIND_SPD", speed_m_s)):
            self.set(name, value)

    def goto(self, place: Place) -> None:
        """SET_POSITION_TARGET_GLOBAL_INT, once: GUIDED only."""
        latitude_deg, longitude_deg = place.degrees
        self.send(
            mavlink.MAVLink_set_position_target_global_int_message(
                0, self.system, 1, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, _POSITION_ONLY,
                round(latitude_deg * 1e7), round(longitude_deg * 1e7), place.up_m, 0, 0, 0, 0, 0, 0, 0, 0,
            )
        )  # fmt: skip

    def mission(self, places: Sequence[Place]) -> None:
        """Upload a mission: home, then the places."""
        items = [Place(0.0, 0.0, 0.0), *places]
        self._acks.clear()

        def done() -> bool:
            for message in self._acks[:]:
                self._acks.remove(message)
                if message.get_type() == "MISSION_ACK":
                    return True
                if message.get_type().startswith("MISSION_REQUEST"):
                    latitude_deg, longitude_deg = items[message.seq].degrees
                    self.send(
                        mavlink.MAVLink_mission_item_int_message(
                            self.system, 1, message.seq, 3 if message.seq else 0, 16, 0, 1, 0.0, 0.0, 0.0, 0.0,
                            round(latitude_deg * 1e7), round(longitude_deg * 1e7), items[message.seq].up_m, 0,
                        )
                    )  # fmt: skip
            return False

        count = mavlink.MAVLink_mission_count_message(self.system, 1, len(items), 0)
        if not self._until(done, 20.0, lambda: self.send(count), 3.0):
            raise TimeoutError(f"vehicle {self.number} takes no mission")

    # -- flying ------------------------------------------------------------------------------------------------

    @property
    def place(self) -> Place:
        return self.track[-1].place if self.track else self.home

    def take_off(self, up_m: float) -> None:
        """Boot, arm and rise, as fast as the machine simulates."""
        interval = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL

        def ask() -> None:
            self.command(interval, mavlink.MAVLINK_MSG_ID_SIM_STATE, 50_000)
            self.command(interval, mavlink.MAVLINK_MSG_ID_ATTITUDE, 50_000)
            self.command(interval, mavlink.MAVLINK_MSG_ID_MISSION_CURRENT, 200_000)
            self.send(mavlink.MAVLink_set_mode_message(self.system, 1, MODES["GUIDED"]))
            self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)

        if not self._until(lambda: self.armed and self.mode == "GUIDED" and bool(self.track), _BOOT_S, ask, 1.0):
            raise TimeoutError(f"vehicle {self.number} does not arm: {self._texts[-3:]}")

        def rise() -> None:
            self.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, up_m)

        if not self._until(lambda: self.place.up_m > up_m - 3.0, _BOOT_S, rise, 0.3):
            raise TimeoutError(f"vehicle {self.number} does not take off: {self._texts[-3:]}")
        self._pwm[2] = 1500

    def fly(self, place: Place, within_s: float = 60.0) -> None:
        """Go there and stand."""

        def there() -> bool:
            before = [seen.place for seen in self.track[-8:]]
            return self.place.distance_m(place) < 1.0 and max(map(place.distance_m, before)) < 1.2

        if not self._until(there, within_s, lambda: self.goto(place), 1.0):
            raise TimeoutError(f"vehicle {self.number} does not reach {place}, it is at {self.place}")

    def cruise(self, speed_m_s: float) -> None:
        """How fast it flies; read when a mode is entered."""
        self.set("WPNAV_SPEED", speed_m_s * 100.0)
        self.set_mode("LOITER")
        self.set_mode("GUIDED")

    def kill(self) -> None:
        """End its process: from now on it is taken to stand where it was."""
        self.process.kill()
        self.process.wait()

    def stand(self) -> None:
        """Where a vehicle stands whose process has ended, as if it were heard of."""
        if self.process.poll() is not None:
            self.track.append(self.track[-1]._replace(at_s=time.monotonic()))

    def close(self) -> None:
        self._going = False
        with suppress(ProcessLookupError):
            self.process.terminate()
        self.process.wait(10)
        for thread in self._threads:
            thread.join()
        self.tap.close()
        self._ground.close()
        self._route.close()
        self._rc.close()
        self._ports.close()


def _binds(here: socket.socket, port: int) -> bool:
    try:
        here.bind(("127.0.0.1", port))
    except OSError:
        return False
    return True


def _is_free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        return _binds(probe, port)
