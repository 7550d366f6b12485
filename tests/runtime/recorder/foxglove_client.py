"""A client of Foxglove's WebSocket protocol, as its documentation has it: JSON from the server, and binary messages.

Nothing of the SDK that serves is used here.
"""

import json
import struct
import threading
from collections import defaultdict
from typing import Any, Self

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

MESSAGE, TIME = 1, 2


class FoxgloveClient:
    """Subscribes to every channel that is advertised.

    Attributes:
        info: what the server says of itself.
        channels: by topic.
        messages: (log time in us, message) by topic.
        times_us: the server's time, as it was told.
    """

    def __init__(self, url: str, **options: Any) -> None:
        self.info: dict[str, Any] = {}
        self.channels: dict[str, dict[str, Any]] = {}
        self.messages: defaultdict[str, list[tuple[int, dict[str, Any]]]] = defaultdict(list)
        self.times_us: list[int] = []
        self.statuses: list[dict[str, Any]] = []
        self._topics: dict[int, str] = {}
        protocol = Subprotocol("foxglove.sdk.v1")
        self._connection = connect(url, subprotocols=[protocol], max_size=None, **options)
        self.socket: ClientConnection = self._connection.__enter__()
        assert self.socket.subprotocol == protocol
        self._thread = threading.Thread(target=self._receive, daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._connection.__exit__(None, None, None)
        self._thread.join(5)

    def _receive(self) -> None:
        try:
            for data in self.socket:
                if isinstance(data, str):
                    self._on_json(json.loads(data))
                elif data[0] == MESSAGE:
                    subscription, log_ns = struct.unpack_from("<IQ", data, 1)
                    self.messages[self._topics[subscription]].append((log_ns // 1000, json.loads(data[13:])))
                elif data[0] == TIME:
                    self.times_us.append(struct.unpack_from("<Q", data, 1)[0] // 1000)
        except ConnectionClosed:
            pass

    def _on_json(self, told: dict[str, Any]) -> None:
        if told["op"] == "serverInfo":
            self.info = told
        elif told["op"] == "status":
            self.statuses.append(told)
        elif told["op"] == "advertise":
            asked = []
            for channel in told["channels"]:
                self.channels[channel["topic"]] = channel
                self._topics[channel["id"]] = channel["topic"]
                asked.append({"id": channel["id"], "channelId": channel["id"]})
            self.socket.send(json.dumps({"op": "subscribe", "subscriptions": asked}))
