"""The door before a server for pages: connections that never ask for anything keep nobody out."""

import socket
import threading
from collections.abc import Iterator
from contextlib import suppress

import pytest

from dyknow.proxies.outward.gate import MOST_CLIENTS, PageDoor

ANSWER = b"HTTP/1.1 101 Switching\r\n\r\n"


@pytest.fixture
def door() -> Iterator[PageDoor]:
    """A door before a server that answers each connection, and keeps it open."""
    kept: list[socket.socket] = []
    with socket.create_server(("127.0.0.1", 0), backlog=128) as inner:

        def serve() -> None:
            with suppress(OSError):  # closed at the end
                while True:
                    kept.append(inner.accept()[0])
                    kept[-1].sendall(ANSWER)

        threading.Thread(target=serve, daemon=True).start()
        made = PageDoor("127.0.0.1", 0, ())
        made.open("127.0.0.1", inner.getsockname()[1])
        yield made
        made.close()
        inner.shutdown(socket.SHUT_RDWR)
    for each in kept:
        each.close()


def connected(door: PageDoor) -> socket.socket:
    return socket.create_connection(("127.0.0.1", door.port), 5)


def asks(door: PageDoor) -> tuple[socket.socket, bytes]:
    made = connected(door)
    made.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{door.port}\r\n\r\n".encode())
    return made, made.recv(12)


def test_requests_that_are_sent_by_halves_keep_nobody_out(door: PageDoor) -> None:
    held = [connected(door) for _ in range(500)]
    for each in held:
        with suppress(OSError):  # closed already: an older one that made room
            each.sendall(b"GET / HTTP/1.1\r\nX: ")
    made, answer = asks(door)
    assert answer == ANSWER[:12]
    for each in (*held, made):
        each.close()


def test_only_as_many_as_are_served_pass(door: PageDoor) -> None:
    found = [asks(door) for _ in range(MOST_CLIENTS + 1)]
    assert [answer for _, answer in found] == [ANSWER[:12]] * MOST_CLIENTS + [b"HTTP/1.1 503"]
    assert door.refused == {503: 1}
    for made, _ in found:
        made.close()
