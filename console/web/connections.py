"""Connections to the page: only a few may be without its cookie, and the oldest of them makes room for the next.

A browser shows the cookie with its first bytes and is no stranger from then on, so connections that are held open
without it, with half a request or half a body, displace only each other.
"""

import asyncio
from typing import Any, Final, cast

from uvicorn.protocols.http.h11_impl import H11Protocol

from dyknow.console.web.access import Access

MOST_STRANGERS: Final = 64
MOST_KNOWN: Final = 64
HEAD_WITHIN_S: Final = 5.0
"""How long the first request may take to come, up to the end of its headers."""


class Strangers:
    """Connections without the cookie, the oldest first."""

    def __init__(self) -> None:
        self._waiting: dict[PageProtocol, None] = {}
        self.displaced = 0

    def add(self, stranger: "PageProtocol") -> None:
        """One more; if that is too many, the oldest is closed."""
        self._waiting[stranger] = None
        if len(self._waiting) > MOST_STRANGERS:
            oldest = next(iter(self._waiting))
            self.displaced += 1
            self.discard(oldest)
            oldest.transport.abort()

    def discard(self, stranger: "PageProtocol") -> None:
        """It has shown the cookie, or is gone."""
        self._waiting.pop(stranger, None)


class PageProtocol(H11Protocol):
    """Uvicorn's protocol of one connection; `protocol_of` gives it what it needs."""

    access: Access
    strangers: Strangers
    _head: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """A stranger has connected."""
        super().connection_made(cast("asyncio.Transport", transport))
        self._head = self.loop.call_later(HEAD_WITHIN_S, self.transport.abort)
        self.strangers.add(self)

    def data_received(self, data: bytes) -> None:
        """More of a request."""
        super().data_received(data)
        if self.scope is None:
            return
        self._stop_waiting()
        is_upgraded = self not in self.connections  # judged at once, and answered by another protocol from here on
        if is_upgraded or self.access.has_session(_cookies(self.headers)):
            self.strangers.discard(self)

    def connection_lost(self, exc: Exception | None) -> None:
        """It is gone."""
        self._stop_waiting()
        self.strangers.discard(self)
        super().connection_lost(exc)

    def _stop_waiting(self) -> None:
        if self._head is not None:
            self._head.cancel()
            self._head = None


def _cookies(headers: list[tuple[bytes, bytes]]) -> str:
    return next((value.decode("latin-1") for name, value in headers if name == b"cookie"), "")


def protocol_of(access: Access) -> type[PageProtocol]:
    """The protocol of a page's connections, for `uvicorn.Config(http=...)`."""
    members: dict[str, Any] = {"access": access, "strangers": Strangers()}
    return type("PageProtocol", (PageProtocol,), members)


def uvicorn_settings(access: Access) -> dict[str, Any]:
    """Small messages, few connections, no log, no name of the program."""
    return {
        "log_config": None, "access_log": False, "server_header": False, "date_header": False, "lifespan": "off",
        "ws": "websockets-sansio", "ws_max_size": 4096, "ws_per_message_deflate": False,
        "limit_concurrency": MOST_KNOWN + MOST_STRANGERS, "timeout_graceful_shutdown": 1, "http": protocol_of(access),
        "loop": "asyncio", "proxy_headers": False,
    }  # fmt: skip
