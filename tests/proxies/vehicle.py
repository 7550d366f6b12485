"""A vehicle's side of a MAVLink link over real UDP, driven by a test: it says what it is told to say."""

import socket
import struct
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink


class Wire:
    """Sends messages from one address as any system, and takes in what comes back. `version` of MAVLink is 1 or 2."""

    def __init__(
        self, to: tuple[str, int], *, system: int = 1, component: int = 1, key: bytes | None = None, version: int = 2
    ) -> None:
        self.to, self.version = to, version
        self.codec = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
        if key is not None:
            self.codec.signing.secret_key, self.codec.signing.sign_outgoing = key, True
            self.codec.signing.timestamp = 10**14
        self.reader = mavlink.MAVLink(None)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(5.0)

    def close(self) -> None:
        self.socket.close()

    def bytes_of(self, message: Any) -> bytes:
        found = bytes(message.pack(self.codec, force_mavlink1=self.version == 1))
        self.codec.seq = (self.codec.seq + 1) % 256
        return found

    def send(self, *messages: Any) -> None:
        for message in messages:
            self.socket.sendto(self.bytes_of(message), self.to)

    def send_bytes(self, data: bytes) -> None:
        self.socket.sendto(data, self.to)

    def receive(self, *kinds: str) -> Any:
        """The next message of one of these types, passing over the others; TimeoutError after 5 s of silence."""
        for _ in range(500):
            data = self.socket.recv(65_535)
            for message in self.reader.parse_buffer(data) or []:
                if message.get_type() in kinds:
                    return message
        raise TimeoutError(f"500 datagrams and no {kinds}")


def heartbeat(
    *, autopilot: int = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mode: int = 4, armed: bool = True, state: int = 4
) -> Any:
    base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | (mavlink.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0)
    return mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_QUADROTOR, autopilot, base, mode, state, 3)


def position(boot_ms: int, *, lat: float = 47.0, lon: float = 8.0, alt: float = 510.0, height: float = 10.0) -> Any:
    return mavlink.MAVLink_global_position_int_message(
        boot_ms, round(lat * 1e7), round(lon * 1e7), round(alt * 1e3), round(height * 1e3), 120, -30, 5, 0
    )


def unknown_frame(system: int) -> bytes:
    """A MAVLink 2 frame of a type no dialect knows: pymavlink would hand it out unchecked."""
    return struct.pack("<BBBBBBB", 0xFD, 4, 0, 0, 0, system, 1) + (999_999).to_bytes(3, "little") + b"abcd" + b"\0\0"
