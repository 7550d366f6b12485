"""Links to peers that fell silent are closed without waiting for them.

Zenoh has the kernel wait up to ten seconds, when a TCP socket is closed, until all has been delivered (SO_LINGER). To a
peer behind a cut nothing is delivered any more, and the thread that closes its socket is one of those that receive for
the whole session: all other peers fall silent, too, and closing the session itself times out. Without that option the
kernel delivers what it can in its own time and nobody waits.
"""

import contextlib
import os
import socket
import struct
from pathlib import Path

_LINGER = struct.Struct("ii")  # whether to wait, and for how many seconds


def stop_waiting() -> int:
    """Have every TCP socket of this process that waits on closing not do so; returns how many did."""
    found = 0
    for opened in Path("/dev/fd").iterdir():
        if opened.is_socket():
            with contextlib.suppress(OSError), socket.socket(fileno=os.dup(int(opened.name))) as copy:
                found += _stop_waiting(copy)  # an OSError: closed meanwhile
    return found


def _stop_waiting(copy: socket.socket) -> bool:
    if copy.type != socket.SOCK_STREAM or copy.family not in {socket.AF_INET, socket.AF_INET6}:
        return False
    waits, _ = _LINGER.unpack(copy.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _LINGER.size))
    if waits:
        copy.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _LINGER.pack(0, 0))
    return bool(waits)
