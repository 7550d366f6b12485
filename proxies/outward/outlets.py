"""Sockets that messages leave through, to a program that may be absent, slow or gone: nothing waits, what is lost is counted."""

import contextlib
import ipaddress
import os
import re
import socket
from collections import Counter, deque
from typing import Final, NamedTuple

from dyknow.model.errors import TextError, WrongCall

MOST_WAITING: Final = 1_000_000
"""Bytes that wait for a TCP connection."""
MOST_PER_S: Final = 500
"""Messages, and that number at once."""
AGAIN_US: Final = 1_000_000
"""How long until a TCP connection that broke is tried again."""
_FORM = re.compile(r"(udp|tcp)://(\[[0-9a-fA-F:.]+\]|[^/\s:]+):([0-9]{1,5})")


class Destination(NamedTuple):
    """Where messages go: `udp` or `tcp`, an IP address, a port."""

    kind: str
    host: str
    port: int

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.kind}://{host}:{self.port}"


def parse_destination(text: str, *, beyond: bool, kinds: tuple[str, ...] = ("udp", "tcp")) -> Destination:
    """Read `udp://127.0.0.1:6969`.

    Args:
        text: as users write it; names of machines are refused, since what they mean may change.
        beyond: whether it may be beyond this machine.
        kinds: the possible ones.

    Raises:
        TextError: it is of another form.
        WrongCall: it is beyond this machine.
    """
    found = _FORM.fullmatch(text.strip())
    if found is None or found[1] not in kinds or not 0 < int(found[3]) <= 65_535:
        forms = " or ".join(f"{kind}://127.0.0.1:6969" for kind in kinds)
        raise TextError(f"a destination is written {forms}", text=text, repair=forms)
    host = found[2].strip("[]")
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        raise TextError(
            "a destination has an IP address", text=text, repair=f"{found[1]}://127.0.0.1:{found[3]}"
        ) from None
    if not address.is_loopback and not beyond:
        raise WrongCall(
            f"{text} is beyond this machine, where nothing is encrypted; add --beyond-this-machine if that is meant."
        )
    return Destination(found[1], host, int(found[3]))


class Outlet:
    """Sends messages; never blocks and never raises.

    Args:
        to: where they go.

    Attributes:
        counts: `sent`, and `lost` by reason.
    """

    def __init__(self, to: Destination) -> None:
        self.to, self.counts = to, Counter[str]()
        self._waiting: deque[bytes] = deque()
        self._bytes, self._again_us, self._is_open = 0, 0, False
        self._socket: socket.socket | None = None
        self._trouble = ""
        self._left, self._left_us = float(MOST_PER_S), 0

    @property
    def trouble(self) -> str:
        """Why nothing arrives there, as far as that is known; empty otherwise."""
        return self._trouble

    @property
    def lost(self) -> int:
        """How many messages were not sent."""
        return sum(count for reason, count in self.counts.items() if reason != "sent")

    def send(self, message: bytes, now_us: int) -> None:
        """Send a message, or have it wait for the connection."""
        passed_us, self._left_us = now_us - self._left_us, now_us
        self._left = min(MOST_PER_S, self._left + max(0, passed_us) * MOST_PER_S / 1e6)
        if self._left < 1:
            self.counts["too many"] += 1
            return
        self._left -= 1
        if self.to.kind == "tcp":
            self._waiting.append(message)
            self._bytes += len(message)
            while self._bytes > MOST_WAITING:
                self._drop_oldest()
        else:
            self._send_datagram(message)
        self.on_time(now_us)

    def on_time(self, now_us: int) -> None:
        """Send what waits."""
        if self.to.kind == "udp":
            return
        if self._socket is None and now_us >= self._again_us:
            self._connect(now_us)
        if self._socket is not None:
            self._flush(now_us)

    def close(self) -> None:
        """Close the socket; waiting messages are lost, and counted."""
        while self._waiting:
            self._drop_oldest()
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _send_datagram(self, message: bytes) -> None:
        try:
            if self._socket is None:
                self._socket = _new_socket(self.to, socket.SOCK_DGRAM)
                self._socket.connect((self.to.host, self.to.port))
            self._socket.send(message)
        except OSError as why:
            self._trouble = why.strerror or str(why)
            self.counts[self._trouble.lower()] += 1
        else:
            self.counts["sent"] += 1
            self._trouble = ""

    def _connect(self, now_us: int) -> None:
        self._again_us = now_us + AGAIN_US
        self._is_open = False
        made = _new_socket(self.to, socket.SOCK_STREAM)
        try:
            with contextlib.suppress(BlockingIOError):
                made.connect((self.to.host, self.to.port))
        except OSError as why:
            self._trouble = why.strerror or str(why)
            made.close()
            return
        self._socket = made

    def _flush(self, now_us: int) -> None:
        assert self._socket is not None  # noqa: S101  (who calls has looked)
        try:
            _check(self._socket)
            while self._waiting:
                sent = self._socket.send(self._waiting[0])
                self._is_open, self._trouble = True, ""
                self._bytes -= sent
                rest = self._waiting[0][sent:]
                if rest:
                    self._waiting[0] = rest
                else:
                    self._waiting.popleft()
                    self.counts["sent"] += 1
        except BlockingIOError:
            return
        except OSError as why:
            self._break(why, now_us)

    def _break(self, why: OSError, now_us: int) -> None:
        """Of a message that was sent in part the rest is useless to the next connection."""
        assert self._socket is not None  # noqa: S101  (who calls has looked)
        self._socket.close()
        self._socket, self._again_us = None, now_us + AGAIN_US
        self._trouble = why.strerror or str(why)
        if self._is_open and self._waiting:
            self._drop_oldest()

    def _drop_oldest(self) -> None:
        self._bytes -= len(self._waiting.popleft())
        self.counts["too slow" if self._is_open else "not connected"] += 1


def _new_socket(to: Destination, kind: socket.SocketKind) -> socket.socket:
    made = socket.socket(socket.AF_INET6 if ":" in to.host else socket.AF_INET, kind)
    made.setblocking(False)
    return made


def _check(connection: socket.socket) -> None:
    """Raise OSError if the connection failed."""
    if why := connection.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
        raise OSError(why, os.strerror(why))
