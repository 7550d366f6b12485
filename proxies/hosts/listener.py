"""Where knowledge process hosts come in: a socket in the run directory of this platform's federation."""

import contextlib
import socket
import threading
from collections import deque
from collections.abc import Callable, Iterable
from functools import partial
from itertools import count
from pathlib import Path

from dyknow.agents.effects import DropHost, HostCame, HostEffect, HostEvent, HostLeft, HostMessage, TakeHost, TellHost
from dyknow.proxies.hosts.connection import Line, connect, listen

UNTAKEN = 64
"""Messages of one host that the node has not dealt with; further ones wait where they come from."""
MAX_UNSENT = 16_777_216
"""A host that leaves more bytes than this unread is closed."""


class _Guest:
    """One connection: its line, and the messages to send."""

    def __init__(self, line: Callable[["_Guest"], Line]) -> None:
        self.untaken = threading.Semaphore(UNTAKEN)
        self.unsent: deque[bytes] = deque()
        self._lock = threading.Lock()
        self._bytes = 0
        self.line = line(self)

    def put(self, payloads: Iterable[bytes]) -> None:
        with self._lock:
            for payload in payloads:
                self.unsent.append(payload)
                self._bytes += len(payload)
            full = self._bytes > MAX_UNSENT
        if full:
            self.line.close()
        self.line.wake()

    def take(self) -> list[bytes]:
        with self._lock:
            taken = list(self.unsent)
            self.unsent.clear()
            self._bytes = 0
        return taken


class HostDoor:
    """Posts messages of hosts and sends them the platform's. The node thread never waits here.

    Args:
        path: of the socket, in a directory of its own user.
        post: takes events for the node.
        now_us: the node clock.
    """

    def __init__(self, path: Path, post: Callable[[HostEvent], None], now_us: Callable[[], int]) -> None:
        self.path, self._post, self._now_us = path, post, now_us
        self._guests: dict[int, _Guest] = {}
        self._numbers = count(1)
        self._socket: socket.socket | None = None

    def open(self) -> None:
        """Let hosts come; raises EndpointFailed."""
        self._socket = listen(self.path)
        threading.Thread(target=self._admit, args=(self._socket,), name="hosts", daemon=True).start()

    def close(self) -> None:
        """End every connection; harmless where `open` was not called."""
        opened, self._socket = self._socket, None
        if opened is None:
            return
        with contextlib.suppress(OSError), connect(self.path):  # wakes who waits there
            pass
        opened.close()
        self.path.unlink(missing_ok=True)
        for guest in tuple(self._guests.values()):
            guest.line.close()

    def perform(self, effect: HostEffect) -> None:
        """Perform an effect on a host; for a host that has left there is none."""
        guest = self._guests.get(effect.host)
        if guest is None:
            return
        match effect:
            case TellHost(_, payloads):
                guest.put(payloads)
            case TakeHost():
                guest.untaken.release()
            case DropHost():
                guest.line.finish()

    def _admit(self, opened: socket.socket) -> None:
        while self._socket is not None:
            try:
                connected, _ = opened.accept()
            except OSError:
                return
            if self._socket is None:
                connected.close()
                return
            number = next(self._numbers)
            guest = self._guests[number] = _Guest(partial(self._line, number, connected))
            self._post(HostCame(self._now_us(), number))
            guest.line.start()

    def _line(self, number: int, connected: socket.socket, guest: _Guest) -> Line:
        def said(payload: bytes) -> None:
            guest.untaken.acquire()
            self._post(HostMessage(self._now_us(), number, payload))

        def left() -> None:
            self._guests.pop(number, None)
            connected.close()
            self._post(HostLeft(self._now_us(), number))

        return Line(connected, said, left, guest.take)
