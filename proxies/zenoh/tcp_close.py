"""Links to peers that timed out are closed without waiting for them.

Zenoh has the kernel wait up to ten seconds, when a TCP socket is closed, until all has been delivered (SO_LINGER). To a
peer behind a cut nothing is delivered, and the thread that closes its socket is one of those that receive for
the whole session: all other peers time out, too, and closing the session itself times out. Without that option the
kernel delivers what it can in its own time and no thread waits.
"""

import contextlib
import os
import socket
import stat
import struct
from pathlib import Path

_LINGER = struct.Struct("ii")  # whether to wait, and for how many seconds


class Closing:
    """Sees to it that no TCP socket of this process waits when it is closed. A socket is looked at once."""

    def __init__(self) -> None:
        self._seen = frozenset[int]()

    def stop_waiting(self) -> int:
        """Look at the sockets that are new; returns how many of them would have waited."""
        found, here = 0, set[int]()
        for name in Path("/dev/fd").iterdir():
            with contextlib.suppress(OSError):  # closed meanwhile
                opened = name.stat()
                if stat.S_ISSOCK(opened.st_mode):
                    here.add(opened.st_ino)
                    if opened.st_ino not in self._seen:
                        with socket.socket(fileno=os.dup(int(name.name))) as copy:
                            found += _stop_waiting(copy)
        self._seen = frozenset(here)
        return found


def _stop_waiting(copy: socket.socket) -> bool:
    if copy.type != socket.SOCK_STREAM or copy.family not in {socket.AF_INET, socket.AF_INET6}:
        return False
    waits, _ = _LINGER.unpack(copy.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _LINGER.size))
    if waits:
        copy.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _LINGER.pack(0, 0))
    return bool(waits)
