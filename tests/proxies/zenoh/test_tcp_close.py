import contextlib
import os
import socket
import struct
import threading
from dataclasses import replace
from pathlib import Path

import pytest

from dyknow.federation.transport import Reopen, Subscribe
from dyknow.proxies.zenoh.configuration import ZenohOptions
from dyknow.proxies.zenoh.edge import ZenohEdge
from dyknow.proxies.zenoh.tcp_close import Closing

PATIENCE_S, PACE_S = 20.0, 0.05
OPENED = Path("/dev/fd")


def waits(of: socket.socket) -> bool:
    return bool(struct.unpack("ii", of.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER, 8))[0])


def test_a_socket_that_waits_on_closing_does_so_no_more() -> None:
    with socket.socket() as lingers, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        lingers.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 10))
        other.bind(("127.0.0.1", 0))
        opened = len(list(OPENED.iterdir()))
        closing = Closing()
        assert closing.stop_waiting() >= 1
        assert not waits(lingers)
        assert Closing().stop_waiting() == 0
        lingers.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 10))
        with socket.socket() as another:
            another.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 10))
            assert closing.stop_waiting() == 1, "a socket is looked at once"
            assert not waits(another)
        assert len(list(OPENED.iterdir())) == opened


@pytest.mark.live
def test_no_link_of_a_session_waits_on_closing_not_even_after_it_was_opened_anew() -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    options = ZenohOptions("closing", discover="none")
    here = ZenohEdge(replace(options, listen=(endpoint,)), lambda _event: None, lambda: 0)
    there = ZenohEdge(replace(options, connect=(endpoint,)), lambda _event: None, lambda: 0)
    try:
        here.open()
        there.open()
        assert linked(here, there)
        for edge in (here, there):
            edge.perform(Reopen("a test"))
            assert linked(here, there)
    finally:
        there.close()
        here.close()


def linked(here: ZenohEdge, there: ZenohEdge) -> bool:
    """Wait until both have a link, and none that waits."""
    pause = threading.Event()
    for _ in range(round(PATIENCE_S / PACE_S)):
        for edge in (here, there):
            edge.perform(Subscribe("x/**"))
        if here.is_open and there.is_open and here.peers() and there.peers() and not lingering():
            return True
        pause.wait(PACE_S)
    return False


def lingering() -> list[str]:
    """The TCP sockets of this process that would wait."""
    found = []
    for opened in OPENED.iterdir():
        if opened.is_socket():
            with contextlib.suppress(OSError), socket.socket(fileno=os.dup(int(opened.name))) as copy:
                if copy.type == socket.SOCK_STREAM and waits(copy):
                    found.append(opened.name)
    return found
