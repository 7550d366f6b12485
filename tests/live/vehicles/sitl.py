"""ArduCopter in the loop, for tests: the directory that `DYKNOW_SITL` names has the program `arducopter` and its parameters.

One vehicle each, on loopback, on ports of its own; it boots faster than real time and flies at real time.
"""

import math
import os
import socket
import struct
import subprocess
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Self

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

HOME = (56.2, 12.5, 50.0)
M_PER_DEG = 111_319.5
BOOT_SPEEDUP = 8
MODES = {"AUTO": 3, "GUIDED": 4, "LOITER": 5, "RTL": 6, "LAND": 9}
PATIENCE_S = 90.0


def directory() -> Path | None:
    """Where the program is; None: nowhere, and why is in `absence`."""
    named = os.environ.get("DYKNOW_SITL")
    return None if not named or absence() else Path(named)


def absence() -> str:
    """Why ArduCopter cannot be started here, or ""."""
    named = os.environ.get("DYKNOW_SITL")
    if not named:
        return "DYKNOW_SITL names no directory with an ArduCopter"
    program = Path(named) / "arducopter"
    if not os.access(program, os.X_OK):
        return f"{program} cannot be started"
    tried = subprocess.run([program, "--help"], capture_output=True, timeout=20, check=False)
    return "" if b"speedup" in tried.stdout + tried.stderr else f"{program} does not run on this machine"


def place(north_m: float, east_m: float) -> tuple[float, float]:
    """Latitude and longitude of a point so far from home."""
    scale = M_PER_DEG * math.cos(math.radians(HOME[0]))
    return HOME[0] + north_m / M_PER_DEG, HOME[1] + east_m / scale


def _free(instance: int) -> bool:
    for kind, port in (("tcp", 5762 + 10 * instance), ("tcp", 5763 + 10 * instance), ("udp", 5501 + 10 * instance)):
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM if kind == "tcp" else socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                return False
    return True


class Sitl:
    """One ArduCopter, and the ground station that flies it.

    Args:
        state: an empty directory for its parameters and logs.
        peer: the UDP port of loopback that it sends to.
        system: its system id.
        parameters: values by name, besides those of the program's own files.
    """

    def __init__(
        self,
        state: Path,
        peer: int,
        *,
        system: int = 1,
        north_m: float = 0.0,
        east_m: float = 0.0,
        parameters: Mapping[str, float] | None = None,
    ) -> None:
        program = directory()
        assert program is not None
        self.system, self.peer = system, peer
        self._instance = next(number for number in range(20 + os.getpid() % 150, 400) if _free(number))
        self.tcp = 5763 + 10 * self._instance  # a server for one client; the station has the one before it
        latitude, longitude = place(north_m, east_m)
        own = state / "own.parm"
        own.write_text("".join(f"{name} {value:g}\n" for name, value in (parameters or {}).items()))
        command = [
            str(program / "arducopter"), "-w", "-I", str(self._instance), "--model", "+",
            "--speedup", str(BOOT_SPEEDUP), "--home", f"{latitude},{longitude},{HOME[2]},0", "--sysid", str(system),
            "--defaults", f"{program / 'copter.parm'},{program / 'extra.parm'},{own}",
            "--serial0", f"udpclient:127.0.0.1:{peer}", "--serial1", "tcp:2", "--serial2", "tcp:3",
        ]  # fmt: skip
        self._log = (state / "sitl.log").open("wb")
        self._process = subprocess.Popen(
            command, cwd=state, stdin=subprocess.DEVNULL, stdout=self._log, stderr=subprocess.STDOUT
        )
        self._station: Any = None

    def __enter__(self) -> Self:
        try:
            endpoint = f"tcp:127.0.0.1:{5762 + 10 * self._instance}"
            self._station = mavutil.mavlink_connection(
                endpoint, source_system=255, source_component=190, retries=60, dialect="ardupilotmega"
            )
            self.heard("HEARTBEAT")
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self) -> None:
        """End the autopilot, as a crash would."""
        if self._station is not None:
            self._station.close()
            self._station = None
        self._process.kill()
        self._process.wait()
        self._log.close()

    # -- a ground station --------------------------------------------------------------------------------------

    def heard(self, kind: str, holds: Callable[[Any], bool] = lambda _message: True, within_s: float = 10.0) -> Any:
        """The next message of a kind for which that holds; TimeoutError when none comes."""
        until = time.monotonic() + within_s
        while (left := until - time.monotonic()) > 0:
            message = self._station.recv_match(type=kind, blocking=True, timeout=left)
            if message is not None and message.get_srcComponent() == 1 and holds(message):
                return message
        raise TimeoutError(f"no {kind} from the autopilot")

    def command(self, command: int, *parameters: float) -> int:
        """A command's result."""
        filled = [*parameters, *[0.0] * (7 - len(parameters))]
        self._station.mav.command_long_send(self.system, 1, command, 0, *filled)
        return int(self.heard("COMMAND_ACK", lambda ack: ack.command == command and ack.result != 5).result)

    def every(self, kind: int, hertz: float) -> None:
        self.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, kind, 1e6 / hertz)

    def parameter(self, name: str, value: float) -> None:
        self._station.mav.param_set_send(self.system, 1, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32)
        self.heard("PARAM_VALUE", lambda told: told.param_id == name and abs(told.param_value - value) < 1e-3)

    def mode(self, name: str) -> None:
        """Change the mode, as a pilot does, and wait until the autopilot says so."""
        self._station.mav.set_mode_send(self.system, 1, MODES[name])
        self.heard("HEARTBEAT", lambda beat: beat.custom_mode == MODES[name])

    def throttle(self, pwm: int) -> None:
        """What the receiver of the remote control hears from now on."""
        channels = [1500, 1500, pwm, 1500, 1800, 1000, 1000, 1800]
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.sendto(struct.pack("<8H", *channels), ("127.0.0.1", 5501 + 10 * self._instance))

    def take_off(self, height_m: float = 20.0) -> None:
        """Arm as soon as the autopilot allows it, take off and go on in real time."""
        self.throttle(1000)
        self.every(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 10.0)
        until = time.monotonic() + PATIENCE_S
        while not self._takes_off(height_m):
            assert time.monotonic() < until, "it does not take off"
            self.heard("GLOBAL_POSITION_INT")
        self.throttle(1500)
        self.until(lambda at: at.relative_alt / 1e3 > height_m - 1.0)
        self.parameter("SIM_SPEEDUP", 1)

    def _takes_off(self, height_m: float) -> bool:
        """Whether it has begun to: not before its estimator uses the satellites, and not if it waits too long."""
        self._station.mav.set_mode_send(self.system, 1, MODES["GUIDED"])
        armed = self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == mavlink.MAV_RESULT_ACCEPTED
        command = (mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, height_m)
        return armed and self.command(*command) == mavlink.MAV_RESULT_ACCEPTED

    def goto(self, north_m: float, east_m: float, height_m: float) -> None:
        """Send it to a point, once, as a ground station does."""
        latitude, longitude = place(north_m, east_m)
        self._station.mav.set_position_target_global_int_send(
            0, self.system, 1, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, 0b110111111000,
            round(latitude * 1e7), round(longitude * 1e7), height_m, *[0.0] * 8,
        )  # fmt: skip

    def until(self, holds: Callable[[Any], bool], within_s: float = 60.0) -> Any:
        """The first GLOBAL_POSITION_INT for which that holds."""
        return self.heard("GLOBAL_POSITION_INT", holds, within_s)

    def target(self) -> tuple[float, float, float]:
        """Where it says it is flying to: degrees, metres above mean sea level."""
        self.every(mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT, 5.0)
        told = self.heard("POSITION_TARGET_GLOBAL_INT")
        return told.lat_int / 1e7, told.lon_int / 1e7, told.alt
