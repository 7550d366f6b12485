"""A federation live in Foxglove: the channels and messages of a recording, over its WebSocket protocol.

A client may watch and do nothing else. Of rare topics each client gets the newest messages when it subscribes:
platforms, monitors, tasks, and the alarms that are open.
"""

import json
from collections.abc import Callable, Mapping
from typing import Any, Final

from dyknow.model.errors import EndpointFailed, UnitError
from dyknow.proxies.outward.gate import PageDoor, hidden_address
from dyknow.runtime.recordings.foxglove import SCENE, schema_of
from dyknow.runtime.recordings.recording_file import ALARM, LONGEST_MESSAGE, MONITOR, MOST_CHANNELS, PLATFORM, TASK

MOST_KEPT: Final = 1024
"""Messages that are kept for clients to come."""
_BACKLOG: Final = 4096
"""Messages that wait for a client; for a slower client the oldest are left out."""
_TIME_US: Final = 100_000
ORIGINS: Final = ("https://app.foxglove.dev", "https://studio.foxglove.dev", "file://")
"""Foxglove in a browser, and on the desktop; other pages may not connect."""


class LiveServer:
    """Takes what a recorder takes, and serves it until `close`.

    Args:
        host: the address that is listened at.
        port: 0 for any that is free.
        name: the server's name, which clients show.
        now_us: federation time, which clients are notified.

    Attributes:
        lost: messages that were not sent: too long, no JSON, or of one topic too many.

    Raises:
        UnitError: foxglove-sdk is not installed.
        EndpointFailed: the port is taken, or the address is none of this machine.
    """

    def __init__(self, host: str, port: int, name: str, now_us: Callable[[], int]) -> None:
        try:
            import foxglove
            from foxglove.websocket import Capability
        except ImportError:
            raise UnitError(
                "dyknow foxglove needs foxglove-sdk, which is not installed; install the extra: "
                "pip install 'dyknow-federation[foxglove]'"
            ) from None
        self.lost, self._now_us, self._timed_us = 0, now_us, 0
        self._kept: dict[tuple[str, str], tuple[bytes, int]] = {}
        self._channels: dict[str, Any] = {}
        self._schemas: dict[str, Any] = {}
        self._sdk, self._context = foxglove, foxglove.Context()
        foxglove.set_log_level("ERROR")
        listener: Any = _Subscribers(self._catch_up)
        self._door = PageDoor(host, port, ORIGINS)
        try:
            inner = hidden_address()
            self._server: Any = foxglove.start_server(
                name=name,
                host=inner,
                port=0,
                capabilities=[Capability.Time],
                server_listener=listener,
                context=self._context,
                message_backlog_size=_BACKLOG,
            )
        except (RuntimeError, ValueError, OSError) as refused:
            self._door.close()
            raise EndpointFailed(f"{host}:{port} cannot be served: {refused}.") from None
        self._door.open(inner, int(self._server.port))

    @property
    def port(self) -> int:
        """Where it listens."""
        return self._door.port

    @property
    def refused(self) -> int:
        """Connections that were not let in: of a page that may not, or by another name than that of this machine."""
        return sum(self._door.refused.values())

    def add(self, topic: str, schema: str, message: Mapping[str, Any], at_us: int, _valid_us: int | None = None) -> int:
        """Send a message to the clients of its topic; its bytes, 0 if it is not sent."""
        try:
            data = json.dumps(message, separators=(",", ":"), allow_nan=False).encode()
        except (TypeError, ValueError, RecursionError):
            data = b""
        if not 0 < len(data) <= LONGEST_MESSAGE or (
            topic not in self._channels and len(self._channels) >= MOST_CHANNELS
        ):
            self.lost += 1
            return 0
        if topic not in self._channels:
            self._channels[topic] = self._channel(topic, schema)
        log_ns = max(0, at_us) * 1000
        self._keep(topic, schema, message, data, log_ns)
        self._channels[topic].log(data, log_time=log_ns)
        return len(data)

    def on_time(self) -> None:
        """Tell clients the federation's time, ten times a second."""
        now_us = self._now_us()
        if now_us - self._timed_us >= _TIME_US:
            self._timed_us = now_us
            self._server.broadcast_time(now_us * 1000)

    def close(self) -> None:
        """Close the connections of all clients."""
        self._door.close()
        self._server.stop()

    def _channel(self, topic: str, schema: str) -> Any:
        if schema not in self._schemas:
            self._schemas[schema] = self._sdk.Schema(name=schema, encoding="jsonschema", data=schema_of(schema))
        return self._sdk.Channel(topic, schema=self._schemas[schema], message_encoding="json", context=self._context)

    def _keep(self, topic: str, schema: str, message: Mapping[str, Any], data: bytes, log_ns: int) -> None:
        for name, is_over in _lasting(schema, message):
            self._kept.pop((topic, name), None)
            if not is_over:
                self._kept[topic, name] = data, log_ns
        while len(self._kept) > MOST_KEPT:
            del self._kept[next(iter(self._kept))]

    def _catch_up(self, client: int, topic: str) -> None:
        """From a thread of the server."""
        channel = self._channels.get(topic)
        for (of, _), (data, log_ns) in list(self._kept.items()):
            if of == topic and channel is not None:
                channel.log(data, log_time=log_ns, sink_id=client)


def _lasting(schema: str, message: Mapping[str, Any]) -> list[tuple[str, bool]]:
    """The names under which a message holds until the next of that name, and whether each is over with this message."""
    match message:
        case {"unit": str(unit), "labels": list()} if schema == PLATFORM:
            return [(unit, False)]
        case {"unit": str(unit), "state": str(state)} if schema == PLATFORM:
            return [(f"{unit} state", state == "alive")]
        case {"by": by, "monitor": monitor, "units": units, "verdict": _} if schema == MONITOR:
            return [(f"{by} {monitor} {units}", False)]
        case {"by": by, "conversation": conversation} if schema == TASK:
            return [(f"{by} {conversation}", False)]
        case {"id": name, "by": by, "event": event} if schema == ALARM:
            return [(f"{by} {name}", event != "opened")]
        case {"deletions": list(deleted), "entities": list(entities)} if schema == SCENE:
            lines = [(each["id"], False) for each in entities if each["lines"]]
            return [*lines, *((each["id"], True) for each in deleted)]
    return []


class _Subscribers:
    """The server's callbacks; clients may do nothing but subscribe."""

    def __init__(self, on_subscribed: Callable[[int, str], None]) -> None:
        self._on_subscribed = on_subscribed

    def on_subscribe(self, client: Any, channel: Any) -> None:
        self._on_subscribed(client.id, channel.topic)

    def on_unsubscribe(self, client: Any, channel: Any) -> None:
        pass
