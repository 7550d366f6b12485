"""One UDP socket that any number of vehicles speak MAVLink on, distinguished by their system ids.

Datagrams are cut into frames here; a frame is decoded once, for the one feed that its system id belongs to. A system id
is bound to the address it was first heard from: while that address speaks, no other may use the id.
"""

import contextlib
import errno
import socket
import threading
import time
from collections import Counter
from typing import Any, Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.model.errors import EndpointFailed, TextError
from proxies.mavlink.frames import WANTED, Frame, decoded, frames
from proxies.mavlink.reports import is_autopilot

_TICK_S = 0.02
_HEARTBEAT_S = 1.0
_SILENT_S = 3.0
_DATAGRAM = 65_535
_SIGNATURE_EPOCH_S = 1_420_070_400  # 2015-01-01, where signature timestamps begin; they count 10 us

_REMEDIES = {
    errno.EADDRINUSE: "is another ground station on that port? End it, or choose another port",
    errno.EACCES: "choose a port from 1024 on",
    errno.EADDRNOTAVAIL: "name an address of this machine, such as 127.0.0.1",
}

Address = tuple[str, int]


class Listener(Protocol):
    """What a port tells a feed; all from the port's own thread."""

    @property
    def system(self) -> int | None: ...
    @property
    def component(self) -> int: ...
    def on_adopted(self, system: int) -> None: ...
    def on_message(self, message: Any) -> None: ...
    def on_tick(self, monotonic_us: int) -> None: ...


def parse_endpoint(text: str) -> tuple[str, Address]:
    """`udpin:HOST:PORT` (wait for vehicles there) or `udpout:HOST:PORT` (speak first).

    Raises:
        TextError: anything else.
    """
    kind, _, rest = text.partition(":")
    host, _, port = rest.rpartition(":")
    repair = "udpin:127.0.0.1:14550 or udpout:127.0.0.1:14550"
    if kind not in {"udpin", "udpout"} or not host or not port.isdecimal() or not 0 <= int(port) <= 65_535:
        raise TextError("a MAVLink endpoint names udpin or udpout, a host and a port", text=text, repair=repair)
    return kind, (host.strip("[]"), int(port))


class MavlinkPort:
    """A socket, its thread, and its listeners.

    Args:
        endpoint: see `parse_endpoint`.
        key: 32 bytes; frames without a valid signature are then refused, and ours are signed.
        source: our own system and component id.

    Raises:
        TextError: the endpoint does not parse.
        EndpointFailed: the socket cannot be bound, and what to do.
    """

    def __init__(self, endpoint: str, *, key: bytes | None = None, source: tuple[int, int] = (254, 190)) -> None:
        kind, address = parse_endpoint(endpoint)
        self.counts: Counter[str] = Counter()
        self._remote = address if kind == "udpout" else None
        self._codec = mavlink.MAVLink(None, srcSystem=source[0], srcComponent=source[1])
        if key is not None:
            signing = self._codec.signing
            signing.secret_key, signing.sign_outgoing = key, True
            signing.timestamp = int((time.time() - _SIGNATURE_EPOCH_S) * 1e5)
        self._listeners: dict[int, Listener] = {}
        self._waiting: list[Listener] = []
        self._peers: dict[int, tuple[Address, float]] = {}
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._stopping = threading.Event()
        self._heartbeat_s = 0.0
        self._socket = _opened(endpoint, kind, address)

    @property
    def address(self) -> Address:
        """Where the socket is bound: host and port."""
        found = self._socket.getsockname()
        return found[0], found[1]

    def attach(self, listener: Listener) -> None:
        """Route a vehicle's messages to `listener`: its `system`'s, or those of the first autopilot without a listener.

        Raises:
            ValueError: another feed has that system id.
        """
        with self._lock:
            if listener.system is None:
                self._waiting.append(listener)
            elif listener.system in self._listeners:
                raise ValueError(
                    f"system {listener.system} already has a feed on this port; give each vehicle its own id"
                )
            else:
                self._listeners[listener.system] = listener
            if self._thread is None:
                self._stopping.clear()
                self._thread = threading.Thread(target=self._run, name=f"mavlink-{self.address[1]}", daemon=True)
                self._thread.start()

    def detach(self, listener: Listener) -> None:
        """Forget a listener; the socket closes with the last one."""
        with self._lock:
            self._waiting = [each for each in self._waiting if each is not listener]
            self._listeners = {system: each for system, each in self._listeners.items() if each is not listener}
            if self._listeners or self._waiting:
                return
            thread, self._thread = self._thread, None
        self._stopping.set()
        if thread is not None and thread is not threading.current_thread():
            thread.join(timeout=2.0)
        self._socket.close()

    def send(self, system: int, message: Any) -> bool:
        """Send to where `system` was heard from; False when that is unknown. From any thread."""
        known = self._peers.get(system)
        address = known[0] if known is not None else self._remote
        return address is not None and self._send_to(address, message)

    def _send_to(self, address: Address, message: Any) -> bool:
        with self._lock:
            data = message.pack(self._codec)
            self._codec.seq = (self._codec.seq + 1) % 256
        try:
            self._socket.sendto(data, address)
        except OSError:
            self.counts["not sent"] += 1
            return False
        return True

    def _run(self) -> None:
        tick_s = 0.0
        while not self._stopping.is_set():
            with contextlib.suppress(OSError):  # the tick's timeout, or a peer's closed port
                self._on_datagram(*self._socket.recvfrom(_DATAGRAM))
            now_s = time.monotonic()
            if now_s >= tick_s:
                tick_s = now_s + _TICK_S
                self._on_tick(now_s)

    def _on_datagram(self, data: bytes, sender: Any) -> None:
        address = (sender[0], sender[1])
        for frame in frames(data):
            self._on_frame(frame, address)

    def _on_frame(self, frame: Frame, address: Address) -> None:
        listener = self._listeners.get(frame.system)
        if frame.message_id not in WANTED:
            self.counts["not wanted"] += 1
            return
        if listener is None and not self._waiting:
            self.counts["other system"] += 1
            return
        if frame.component != (listener or self._waiting[0]).component:
            self.counts["other component"] += 1
            return
        message = decoded(self._codec, frame)
        if message is None:
            self.counts["damaged or unsigned"] += 1
            return
        if listener is None:
            listener = self._adopted(frame.system, message)
        if listener is None or not self._bound(frame.system, address):
            return
        try:
            listener.on_message(message)
        except Exception as failure:  # noqa: BLE001 - one bad report must not end the thread that hears every vehicle
            self.counts[f"failed: {type(failure).__name__}"] += 1

    def _adopted(self, system: int, message: Any) -> Listener | None:
        if message.get_type() != "HEARTBEAT" or not is_autopilot(message):
            return None
        with self._lock:
            if not self._waiting:
                return None
            listener = self._waiting.pop(0)
            self._listeners[system] = listener
        listener.on_adopted(system)
        return listener

    def _bound(self, system: int, address: Address) -> bool:
        """Whether `address` may speak for `system`."""
        now_s = time.monotonic()
        known = self._peers.get(system)
        if known is not None and known[0] != address and now_s - known[1] < _SILENT_S:
            self.counts["foreign address"] += 1
            return False
        self._peers[system] = (address, now_s)
        return True

    def _on_tick(self, now_s: float) -> None:
        if now_s >= self._heartbeat_s:
            self._heartbeat_s = now_s + _HEARTBEAT_S
            beat = mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
            )
            addresses = {address for address, _ in list(self._peers.values())}
            for address in addresses | ({self._remote} if self._remote is not None else set()):
                self._send_to(address, beat)
        for listener in list(self._listeners.values()):
            listener.on_tick(int(now_s * 1e6))


def _opened(endpoint: str, kind: str, address: Address) -> socket.socket:
    opened = socket.socket(socket.AF_INET6 if ":" in address[0] else socket.AF_INET, socket.SOCK_DGRAM)
    opened.settimeout(_TICK_S)
    with contextlib.suppress(OSError):
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
    try:
        local = address if kind == "udpin" else ("::" if ":" in address[0] else "0.0.0.0", 0)  # noqa: S104 - answers only
        opened.bind(local)
    except OSError as error:
        opened.close()
        remedy = _REMEDIES.get(error.errno or 0, "check its host and port")
        raise EndpointFailed(f"MAVLink endpoint {endpoint}: {error.strerror}; {remedy}") from None
    return opened
