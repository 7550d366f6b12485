"""A connection between two processes of one machine and one user: messages with their lengths on a Unix domain socket.

A socket in a directory that only its owner may enter needs no password: a TCP port on 127.0.0.1 would be open to
every user of the machine. Two threads serve a connection, so that neither side ever waits for the other.
"""

import contextlib
import os
import socket
import stat
import threading
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from dyknow.federation.messages.unpacking import MAX_BYTES
from dyknow.model.errors import EndpointFailed

BEAT_S = 0.25
FINISH_S = 1.0
_LENGTH = 4
_CHUNK = 65_536
_LONGEST = 100
"""Characters of a socket's path; the system takes few more."""


class Line:
    """One end of a connection.

    Args:
        connected: the socket; it is closed with the line.
        on_message: gets every message, in the line's reading thread; where it waits the other side waits in the end.
        on_end: the connection is over; called once, in the reading thread.
        take: messages to be sent now, or none; called in the writing thread, at least every `BEAT_S`.
    """

    def __init__(
        self,
        connected: socket.socket,
        on_message: Callable[[bytes], None],
        on_end: Callable[[], None],
        take: Callable[[], Iterable[bytes]],
    ) -> None:
        self._socket, self._on_message, self._on_end, self._take = connected, on_message, on_end, take
        self._ready = threading.Event()
        self._finishing = self._closed = False
        self._threads = [threading.Thread(target=each, name="host", daemon=True) for each in (self._read, self._write)]

    def start(self) -> None:
        for thread in self._threads:
            thread.start()

    def wake(self) -> None:
        """There is something to be sent."""
        self._ready.set()

    def finish(self) -> None:
        """Send what there is, within `FINISH_S`, then close."""
        self._finishing = True
        self._ready.set()
        timer = threading.Timer(FINISH_S, self.close)
        timer.daemon = True
        timer.start()

    def close(self) -> None:
        """Both threads end by themselves; from any thread, and more than once is once."""
        self._closed = True
        self._ready.set()
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)

    def _read(self) -> None:
        buffer = bytearray()
        try:
            while chunk := self._socket.recv(_CHUNK):
                buffer += chunk
                at = 0
                while len(buffer) - at >= _LENGTH:
                    size = int.from_bytes(buffer[at : at + _LENGTH])
                    if size > MAX_BYTES:
                        return
                    if len(buffer) - at < _LENGTH + size:
                        break
                    self._on_message(bytes(buffer[at + _LENGTH : at + _LENGTH + size]))
                    at += _LENGTH + size
                del buffer[:at]
        except OSError:
            pass
        finally:
            self.close()
            self._on_end()

    def _write(self) -> None:
        try:
            while not self._closed:
                self._ready.clear()
                finishing = self._finishing
                messages = list(self._take())
                if messages:
                    self._socket.sendall(b"".join(len(each).to_bytes(_LENGTH) + each for each in messages))
                elif finishing:
                    break
                else:
                    self._ready.wait(BEAT_S)
        except OSError:
            pass
        finally:
            self.close()


def connect(path: Path) -> socket.socket:
    """Connect to the socket that listens at `path`; raises OSError if none does."""
    opened = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        with _address(path) as address:
            opened.connect(address)
    except OSError:
        opened.close()
        raise
    return opened


def listen(path: Path) -> socket.socket:
    """A socket that waits for connections at `path`, for this user alone.

    Raises:
        EndpointFailed: it does not open, and why.
    """
    opened = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        _make_private(path.parent)
        _insist_on_free(path)
        path.unlink(missing_ok=True)  # of a process that was killed
        with _address(path) as address:
            opened.bind(address)
        path.chmod(0o600)
        opened.listen(16)
    except OSError as wrong:
        opened.close()
        raise EndpointFailed(f"{path}: no hosts can register: {wrong}") from None
    except EndpointFailed:
        opened.close()
        raise
    return opened


def _make_private(directory: Path) -> None:
    directory.mkdir(mode=0o700, parents=True, exist_ok=True)
    found = directory.stat()
    if found.st_uid != os.getuid() or stat.S_IMODE(found.st_mode) & 0o077:
        raise EndpointFailed(
            f"{directory} is open to other users, which could feed streams there; chmod 700 {directory}"
        )


def _insist_on_free(path: Path) -> None:
    with contextlib.suppress(OSError), connect(path):
        raise EndpointFailed(f"{path}: another platform of this name takes hosts there; end it first")


@contextlib.contextmanager
def _address(path: Path) -> Iterator[str]:
    """The form of `path` for the system: a long one by way of its directory."""
    if len(os.fsencode(path)) <= _LONGEST:
        yield str(path)
        return
    held = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
    try:
        yield f"/proc/self/fd/{held}/{path.name}"
    finally:
        os.close(held)
