"""Ways that bytes come in and go out: UDP sockets, TCP connections, serial lines.

One thread receives, any may send. A broken link (a server that ends, a cable that is pulled) is opened again every
second, and says why it is not open.
"""

import contextlib
import errno
import fcntl
import os
import select
import socket
import termios
import threading
import time
import tty
from collections.abc import Callable, Sequence
from typing import Protocol

from dyknow.model.errors import EndpointFailed
from dyknow.proxies.mavlink.endpoints import Endpoint

TICK_S = 0.05
AGAIN_S = 1.0
_SILENT_S = 5.0
_DATAGRAM = 65_535
_CONNECT_S = 1.0

Peer = tuple[str, int]
"""An address that bytes come from: host and port, or the device and the rate of a serial line."""

_REMEDIES = {
    errno.EADDRINUSE: "is another ground station on that port? End it, or choose another port; several vehicles of one "
    "port are joined by one command: --unit a --sysid 1 --unit b --sysid 2",
    errno.EACCES: "choose a port from 1024 on",
    errno.EADDRNOTAVAIL: "name an address of this machine, such as 127.0.0.1",
}
_LINE_REMEDIES = {
    errno.ENOENT: "is it plugged in?",
    errno.EACCES: "may this user open it (group dialout)?",
    errno.EBUSY: "another program has it",
    errno.ENOTTY: "it is no serial line",
    errno.ECONNREFUSED: "no server listens there yet",
}


class ByteLink(Protocol):
    """Bytes to and from peers.

    Attributes:
        problem: why it is not open; empty while it is.
    """

    problem: str

    @property
    def address(self) -> Peer: ...
    @property
    def callee(self) -> Peer | None: ...
    def receive(self) -> Sequence[tuple[bytes, Peer]]: ...
    def send(self, data: bytes, peer: Peer) -> None: ...
    def close(self) -> None: ...


class UdpLink:
    """A UDP socket.

    Raises:
        EndpointFailed: it cannot be bound, and what to do.
    """

    def __init__(self, endpoint: Endpoint) -> None:
        self.problem = ""
        at = (endpoint.place, endpoint.number)
        self.callee: Peer | None = at if endpoint.kind == "udpout" else None
        is_six = ":" in endpoint.place
        self._socket = socket.socket(socket.AF_INET6 if is_six else socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.settimeout(TICK_S)
        with contextlib.suppress(OSError):
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        try:
            anywhere = ("::" if is_six else "0.0.0.0", 0)  # noqa: S104 - answers only
            self._socket.bind(anywhere if self.callee else at)
        except OSError as error:
            self._socket.close()
            remedy = _REMEDIES.get(error.errno or 0, "check its host and port")
            raise EndpointFailed(f"MAVLink endpoint {endpoint}: {error.strerror}; {remedy}") from None

    @property
    def address(self) -> Peer:
        """Where it is bound."""
        found = self._socket.getsockname()
        return found[0], found[1]

    def receive(self) -> Sequence[tuple[bytes, Peer]]:
        """The next datagram, waiting at most a tick."""
        try:
            data, sender = self._socket.recvfrom(_DATAGRAM)
        except OSError:  # the tick is over, or a peer has closed its port
            return ()
        return ((data, (sender[0], sender[1])),)

    def send(self, data: bytes, peer: Peer) -> None:
        """Raises OSError."""
        self._socket.sendto(data, peer)

    def close(self) -> None:
        self._socket.close()


class StreamLink:
    """A connection of one peer, opened again whenever it breaks.

    Args:
        endpoint: what to open.
        opens: opens a file descriptor that does not block; raises OSError.
        silent_s: after so long without a byte it is opened again: a server that lost us does not say so.
    """

    def __init__(self, endpoint: Endpoint, opens: Callable[[Endpoint], int], silent_s: float | None = None) -> None:
        self.address: Peer = endpoint.place, endpoint.number
        self.callee: Peer | None = self.address
        self.problem = "not opened yet"
        self._endpoint, self._opens, self._silent_s = endpoint, opens, silent_s
        self._fd: int | None = None
        self._lock = threading.Lock()  # a descriptor that was closed may be another file's a moment later
        self._again_s = self._heard_s = 0.0

    def receive(self) -> Sequence[tuple[bytes, Peer]]:
        """The bytes that are there, waiting at most a tick; opens what is closed."""
        fd, now_s = self._fd, time.monotonic()
        if fd is None:
            if now_s >= self._again_s:
                self._open(now_s)
            else:
                time.sleep(TICK_S)
            return ()
        if not select.select([fd], [], [], TICK_S)[0]:
            if self._silent_s is not None and now_s - self._heard_s > self._silent_s:
                self._broke(f"nothing came for {self._silent_s:.0f} s")
            return ()
        try:
            data = os.read(fd, _DATAGRAM)
        except BlockingIOError:
            return ()
        except OSError as error:
            self._broke(error.strerror or str(error))
            return ()
        if not data:
            self._broke("the other side closed it")
            return ()
        self._heard_s = now_s
        return ((data, self.address),)

    def _open(self, now_s: float) -> None:
        try:
            self._fd = self._opens(self._endpoint)
        except OSError as error:
            remedy = _LINE_REMEDIES.get(error.errno or 0, "")
            self._broke(f"{error.strerror or error}{f': {remedy}' if remedy else ''}")
        else:
            self.problem, self._heard_s = "", now_s

    def _broke(self, problem: str) -> None:
        self.close()
        self.problem, self._again_s = problem, time.monotonic() + AGAIN_S

    def send(self, data: bytes, peer: Peer) -> None:  # noqa: ARG002 - there is one
        """Raises OSError: closed, or not all of it could be written."""
        with self._lock:
            if self._fd is None:
                raise BrokenPipeError(errno.EPIPE, self.problem)
            written = os.write(self._fd, data)
        if written < len(data):
            raise BlockingIOError(errno.EAGAIN, "the line is slower than what is sent")

    def close(self) -> None:
        with self._lock:
            fd, self._fd = self._fd, None
            if fd is not None:
                os.close(fd)


def open_link(endpoint: Endpoint) -> ByteLink:
    """The link of an endpoint.

    Raises:
        EndpointFailed: a UDP port that cannot be bound, a baud rate that there is not. The others wait and try again.
    """
    if endpoint.kind == "tcp":
        return StreamLink(endpoint, _connected, _SILENT_S)
    if endpoint.kind == "serial":
        if not hasattr(termios, f"B{endpoint.number}"):
            raise EndpointFailed(f"MAVLink endpoint {endpoint}: there is no rate of {endpoint.number} baud; try 57600")
        return StreamLink(endpoint, _line)
    return UdpLink(endpoint)


def _connected(endpoint: Endpoint) -> int:
    connection = socket.create_connection((endpoint.place, endpoint.number), timeout=_CONNECT_S)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.setblocking(False)
    return connection.detach()


def _line(endpoint: Endpoint) -> int:
    """A serial line in raw mode, 8N1, for this process alone."""
    fd = os.open(endpoint.place, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        fcntl.ioctl(fd, termios.TIOCEXCL)
        tty.setraw(fd)
        attributes = termios.tcgetattr(fd)
        attributes[2] = (attributes[2] & ~(termios.CSTOPB | termios.PARENB | termios.CRTSCTS)) | termios.CLOCAL
        attributes[4] = attributes[5] = getattr(termios, f"B{endpoint.number}")
        termios.tcsetattr(fd, termios.TCSANOW, attributes)
    except termios.error as error:
        os.close(fd)
        raise OSError(*error.args) from None
    except OSError:
        os.close(fd)
        raise
    return fd
