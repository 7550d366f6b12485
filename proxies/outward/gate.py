"""A door before a WebSocket server that lets every page in: only requests by our name, and from pages that may, pass it.

The server itself listens where no page finds it: at a port and at an address of this machine that are drawn by lot.
"""

import asyncio
import contextlib
import secrets
import socket
import sys
import threading
from collections import Counter
from collections.abc import Collection
from ipaddress import ip_address
from typing import Final

from dyknow.model.errors import EndpointFailed

LONGEST_HEAD: Final = 16_384
HEAD_WITHIN_S: Final = 5.0
MOST_CLIENTS: Final = 64
MOST_WAITING: Final = 64
_PIECE: Final = 65_536


def hidden_address() -> str:
    """An address of this machine that cannot be known, where there are many."""
    if not sys.platform.startswith("linux"):
        return "127.0.0.1"
    return f"127.{secrets.randbelow(254) + 1}.{secrets.randbelow(256)}.{secrets.randbelow(254) + 1}"


class PageDoor:
    """Passes connections on until `close`.

    Args:
        host: the address that is listened at.
        port: 0 for any that is free.
        origins: pages that may connect; programs that are no browsers name none, and may.

    Attributes:
        refused: requests that did not pass, by HTTP status.

    Raises:
        EndpointFailed: the port is taken, or the address is none of this machine.
    """

    def __init__(self, host: str, port: int, origins: Collection[str]) -> None:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        try:
            self._listener = socket.create_server((host, port), family=family)
        except (OSError, OverflowError) as refused:
            raise EndpointFailed(f"{host}:{port} cannot be served: {refused}; choose another --port.") from None
        self.port: int = self._listener.getsockname()[1]
        self._origins, self._is_here = frozenset(origins), _is_loopback(host)
        self._target = "", 0
        self._passed = 0
        self._waiting: dict[asyncio.StreamWriter, None] = {}
        self.refused: Counter[int] = Counter()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, name="door", daemon=True)
        self._is_open = threading.Event()

    def open(self, host: str, port: int) -> None:
        """Let connections through to that server."""
        self._target = host, port
        self._thread.start()

    def close(self) -> None:
        """Close all connections."""
        if self._thread.ident is None:
            self._listener.close()
            return
        self._is_open.wait(2.0)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(2.0)

    def _run(self) -> None:
        loop = self._loop
        asyncio.set_event_loop(loop)
        server = loop.run_until_complete(asyncio.start_server(self._on_client, sock=self._listener, limit=LONGEST_HEAD))
        self._is_open.set()
        loop.run_forever()
        server.close()
        for task in asyncio.all_tasks(loop):
            task.cancel()
        loop.run_until_complete(asyncio.sleep(0.05))
        loop.close()

    async def _on_client(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            head = await self._head(reader, writer)
            status = self._refusal(head) or (503 if self._passed >= MOST_CLIENTS else 0)
            if status:
                self.refused[status] += 1
                writer.write(f"HTTP/1.1 {status} Refused\r\nConnection: close\r\nContent-Length: 0\r\n\r\n".encode())
                await writer.drain()
            else:
                await self._pass_on(head, reader, writer)
        except (OSError, TimeoutError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
            self.refused[400] += 1
        finally:
            writer.close()

    async def _head(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> bytes:
        """The head of a request. Of too many that have not sent theirs whole the oldest is closed."""
        self._waiting[writer] = None
        if len(self._waiting) > MOST_WAITING:
            oldest = next(iter(self._waiting))
            del self._waiting[oldest]
            oldest.transport.abort()
        try:
            async with asyncio.timeout(HEAD_WITHIN_S):
                return await reader.readuntil(b"\r\n\r\n")
        finally:
            self._waiting.pop(writer, None)

    def _refusal(self, head: bytes) -> int:
        """The HTTP status with which a request is refused; 0: it passes."""
        lines = head.decode("latin-1").split("\r\n")
        if not lines[0].startswith("GET "):
            return 405
        fields = [
            (name.strip().lower(), value.strip()) for name, _, value in (line.partition(":") for line in lines[1:])
        ]
        hosts, origins = ([value for name, value in fields if name == wanted] for wanted in ("host", "origin"))
        if len(hosts) != 1 or len(origins) > 1:
            return 400
        if self._is_here and not _is_loopback(hosts[0].rpartition(":")[0].strip("[]")):
            return 421
        return 403 if origins and origins[0] not in self._origins else 0

    async def _pass_on(self, head: bytes, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._passed += 1
        inner_writer: asyncio.StreamWriter | None = None
        try:
            inner_reader, inner_writer = await asyncio.open_connection(*self._target)
            inner_writer.write(head)
            ways = (_copied(reader, inner_writer), _copied(inner_reader, writer))
            await asyncio.wait([asyncio.ensure_future(way) for way in ways], return_when=asyncio.FIRST_COMPLETED)
        finally:
            self._passed -= 1
            if inner_writer is not None:
                inner_writer.close()


async def _copied(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Copy all bytes, as fast as the other side takes them."""
    with contextlib.suppress(OSError):
        while piece := await reader.read(_PIECE):
            writer.write(piece)
            await writer.drain()


def _is_loopback(host: str) -> bool:
    try:
        return host == "localhost" or ip_address(host).is_loopback
    except ValueError:
        return False
