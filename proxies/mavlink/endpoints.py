"""Where vehicles speak MAVLink, as text: `udpin:127.0.0.1:14550`, `tcp:127.0.0.1:5762`, `serial:/dev/ttyACM0:921600`."""

from difflib import get_close_matches
from ipaddress import ip_address
from typing import NamedTuple

from dyknow.model.errors import TextError

FORMS = (
    "udpin:HOST:PORT (wait for vehicles there), udpout:HOST:PORT (speak first), tcp:HOST:PORT (call a server), "
    "serial:DEVICE:BAUD"
)
_EXAMPLES = "udpin:127.0.0.1:14550, udpout:127.0.0.1:14550, tcp:127.0.0.1:5762 or serial:/dev/ttyACM0:57600"
_NETWORK = frozenset({"udpin", "udpout", "tcp"})
_RADIO_BAUD = 57_600
"""The factory setting of telemetry radios and of the TELEM ports of autopilots."""


class Endpoint(NamedTuple):
    """A place to hear vehicles at.

    Attributes:
        kind: udpin, udpout, tcp or serial.
        place: host name or address, or the device of a serial line.
        number: port, or baud rate.
    """

    kind: str
    place: str
    number: int

    @property
    def is_local(self) -> bool:
        """Whether only this machine, or a cable to it, reaches this endpoint."""
        if self.kind == "serial" or self.place == "localhost":
            return True
        try:
            return ip_address(self.place).is_loopback
        except ValueError:
            return False

    def __str__(self) -> str:
        place = f"[{self.place}]" if ":" in self.place else self.place
        return f"{self.kind}:{place}:{self.number}"


def parse_endpoint(text: str) -> Endpoint:
    """Read an endpoint, one of `FORMS`; a serial line without a rate has 57600 baud.

    Raises:
        TextError: anything else.
    """
    kind, _, rest = text.partition(":")
    if kind == "serial":
        device, _, baud = rest.rpartition(":")
        if not device:
            device, baud = rest, str(_RADIO_BAUD)
        if device and baud.isdecimal() and int(baud) > 0:
            return Endpoint(kind, device, int(baud))
    host, _, port = rest.rpartition(":")
    if kind in _NETWORK and host and port.isdecimal() and 0 <= int(port) <= 65_535:
        return Endpoint(kind, host.strip("[]"), int(port))
    if kind == "udp" or kind not in _NETWORK | {"serial"}:
        host, _, port = text.removeprefix("udp:").rpartition(":")
        if ":" in host and (meant := get_close_matches(kind, _NETWORK, n=1)):
            raise TextError(f"there is no {kind}:", text=text, width=len(kind), repair=f"{meant[0]}:{rest}")
        if host and port.isdecimal():
            place = f"{host}:{port}"
            raise TextError(
                "one side has to speak first", text=text,
                repair=f"udpin:{place} if vehicles send there, udpout:{place} if one waits there, or tcp:{place}",
            )  # fmt: skip
    raise TextError(f"a MAVLink endpoint is {FORMS}", text=text, repair=_EXAMPLES)
