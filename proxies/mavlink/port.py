"""One endpoint that any number of vehicles speak MAVLink at, distinguished by their system ids.

Bytes are cut into frames here; a frame is decoded once, for the one feed that its system id belongs to. A system id is
bound to the address it was first heard from: while that address speaks, no other may use the id. Each system is
answered in the version of the protocol that it speaks: 1, or 2 once a frame of version 2 was heard.
"""

import threading
import time
from collections import Counter
from collections.abc import Callable
from typing import Any, Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.federation.shares import TokenBucket
from dyknow.proxies.mavlink.endpoints import parse_endpoint
from dyknow.proxies.mavlink.frames import WANTED, Cutter, Frame, decoded
from dyknow.proxies.mavlink.hearing import Hearing
from dyknow.proxies.mavlink.links import TICK_S, Peer, open_link
from dyknow.proxies.mavlink.traffic import MOST_A_SECOND, TRAFFIC_IDS

TOO_MUCH_TRAFFIC = "too much traffic"
"""The count of messages of other aircraft that were not decoded."""
_HEARTBEAT_S = 1.0
_SILENT_S = 3.0
_MOST_PEERS = 64
_SIGNATURE_EPOCH_S = 1_420_070_400  # 2015-01-01, where signature timestamps begin; they count 10 us


class Listener(Protocol):
    """A port's interface to a feed; all calls come from the port's own thread.

    Attributes:
        system: its vehicle's system id; None: the first autopilot that no other listener has.
        component: its autopilot's component id; None: 1, until a HEARTBEAT shows which.
    """

    @property
    def system(self) -> int | None: ...
    @property
    def component(self) -> int | None: ...
    def on_adopted(self, system: int, component: int) -> None: ...
    def on_message(self, message: Any) -> None: ...
    def on_tick(self, monotonic_us: int) -> None: ...


class MavlinkPort:
    """A link, its thread, and its listeners.

    Args:
        endpoint: see `parse_endpoint`.
        key: 32 bytes; frames without a valid signature are then refused, and ours are signed.
        source: our own system and component id.

    Attributes:
        forwards: take each intact frame of a system that is heard, from the address that may speak for it.

    Raises:
        TextError: the endpoint does not parse.
        EndpointFailed: it cannot be opened, and what to do.
    """

    def __init__(self, endpoint: str, *, key: bytes | None = None, source: tuple[int, int] = (254, 190)) -> None:
        found = parse_endpoint(endpoint)
        self.counts: Counter[str] = Counter()
        self.hearing = Hearing(found, has_key=key is not None)
        self._codec = mavlink.MAVLink(None, srcSystem=source[0], srcComponent=source[1])
        if key is not None:
            signing = self._codec.signing
            signing.secret_key, signing.sign_outgoing = key, True
            signing.timestamp = int((time.time() - _SIGNATURE_EPOCH_S) * 1e5)
        self.has_key = key is not None
        self._listeners: dict[int, Listener] = {}
        self._waiting: list[Listener] = []
        self._peers: dict[int, tuple[Peer, float]] = {}
        self._versions: dict[int, int] = {}
        self._cutters: dict[Peer, Cutter] = {}
        self._traffic = TokenBucket(MOST_A_SECOND, MOST_A_SECOND, MOST_A_SECOND)
        self.forwards: tuple[Callable[[Frame], None], ...] = ()
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._stopping = threading.Event()
        self._heartbeat_s = 0.0
        self._beats = 0
        self._link = open_link(found)

    @property
    def address(self) -> Peer:
        """Where it is: host and port, or a device and its rate."""
        return self._link.address

    @property
    def problem(self) -> str:
        """Why the link is not open; empty while it is."""
        return self._link.problem

    @property
    def taken(self) -> frozenset[int]:
        """The systems that have a listener."""
        return frozenset(self._listeners)

    def version(self, system: int) -> int:
        """The version of the protocol in which a system is answered."""
        return 2 if self.has_key else self._versions.get(system, 2)

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
        """Forget a listener; the link closes with the last one."""
        with self._lock:
            self._waiting = [each for each in self._waiting if each is not listener]
            self._listeners = {system: each for system, each in self._listeners.items() if each is not listener}
            if self._listeners or self._waiting:
                return
            thread, self._thread = self._thread, None
        self._stopping.set()
        if thread is not None and thread is not threading.current_thread():
            thread.join(timeout=2.0)
        self._link.close()

    def send(self, system: int, message: Any) -> bool:
        """Send to where `system` was heard from; False when that is unknown. From any thread."""
        known = self._peers.get(system)
        peer = known[0] if known is not None else self._link.callee
        return peer is not None and self._send_to(peer, message, self.version(system))

    def pass_on(self, system: int, data: bytes) -> bool:
        """Send a frame of another station, unchanged, to where `system` was heard from. From any thread."""
        known = self._peers.get(system)
        if known is None:
            return False
        with self._lock:
            try:
                self._link.send(data, known[0])
            except OSError:
                self.counts["not sent"] += 1
                return False
        return True

    def _send_to(self, peer: Peer, message: Any, version: int) -> bool:
        with self._lock:
            data = message.pack(self._codec, force_mavlink1=version == 1)
            self._codec.seq = (self._codec.seq + 1) % 256
            try:
                self._link.send(data, peer)
            except OSError:
                self.counts["not sent"] += 1
                return False
        return True

    def _run(self) -> None:
        tick_s = 0.0
        while not self._stopping.is_set():
            for data, peer in self._link.receive():
                self._on_bytes(data, peer)
            now_s = time.monotonic()
            if now_s >= tick_s:
                tick_s = now_s + TICK_S
                self._on_tick(now_s)

    def _on_bytes(self, data: bytes, peer: Peer) -> None:
        self.hearing.on_bytes(time.monotonic())
        cutter = self._cutters.get(peer)
        if cutter is None:
            if len(self._cutters) >= _MOST_PEERS:
                del self._cutters[next(iter(self._cutters))]
            cutter = self._cutters[peer] = Cutter()
        damaged = cutter.damaged
        for frame in cutter.cut(data):
            self._on_frame(frame, peer)
        self.counts["damaged"] += cutter.damaged - damaged

    def _on_frame(self, frame: Frame, peer: Peer) -> None:
        now_s = time.monotonic()
        self.hearing.on_frame(frame, now_s)
        known = self._peers.get(frame.system)
        if known is not None and known[0] == peer:
            for forward in self.forwards:
                forward(frame)
        if frame.message_id not in WANTED:
            self.counts["not wanted"] += 1
            return
        listener = self._listeners.get(frame.system)
        is_beat = frame.message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT
        is_traffic = frame.message_id in TRAFFIC_IDS
        if not is_beat and not (is_traffic and listener is not None) and not self._is_for(listener, frame):
            return
        if is_traffic and not self._traffic.take(round(now_s * 1e6)):
            self.counts[TOO_MUCH_TRAFFIC] += 1
            return
        message = decoded(self._codec, frame)
        if message is None:
            self.counts["unsigned or unreadable"] += 1
            return
        if is_beat:
            self.hearing.on_heartbeat(frame, message, now_s)
            listener = self._adopted(frame, now_s)
            if not self._is_for(listener, frame):
                return
        if listener is None or not self._bound(frame, peer, now_s):
            return
        try:
            listener.on_message(message)
        except Exception as failure:  # noqa: BLE001 - one bad report must not end the thread that hears every vehicle
            self.counts[f"failed: {type(failure).__name__}"] += 1

    def _is_for(self, listener: Listener | None, frame: Frame) -> bool:
        """Whether the frame is of the component that the listener to its system takes."""
        if listener is None:
            self.counts["other system"] += 1
        elif frame.component != (mavlink.MAV_COMP_ID_AUTOPILOT1 if listener.component is None else listener.component):
            self.counts["other component"] += 1
        else:
            return True
        return False

    def _adopted(self, frame: Frame, now_s: float) -> Listener | None:
        """The listener to the system of a heartbeat, which may thereby have found its vehicle."""
        system = frame.system
        with self._lock:
            listener = self._listeners.get(system) or (self._waiting[0] if self._waiting else None)
            if listener is None or (listener.system is not None and listener.component is not None):
                return listener
            component = self.hearing.autopilot(system, listener.component, now_s)
            if component is None:
                return listener if listener.system is not None else None
            if listener.system is None:
                self._waiting.pop(0)
                self._listeners[system] = listener
        listener.on_adopted(system, component)
        return listener

    def _bound(self, frame: Frame, peer: Peer, now_s: float) -> bool:
        """Whether `peer` may speak for the system of the frame."""
        system = frame.system
        known = self._peers.get(system)
        is_silent = known is None or now_s - known[1] >= _SILENT_S
        if known is not None and known[0] != peer and not is_silent:
            self.counts["foreign address"] += 1
            return False
        self._peers[system] = (peer, now_s)
        self._versions[system] = frame.version if is_silent else max(frame.version, self._versions[system])
        return True

    def _on_tick(self, now_s: float) -> None:
        if now_s >= self._heartbeat_s:
            self._heartbeat_s = now_s + _HEARTBEAT_S
            self._beat()
        for listener in [*self._listeners.values(), *self._waiting]:
            listener.on_tick(int(now_s * 1e6))

    def _beat(self) -> None:
        """A heartbeat to all, in the oldest version spoken there; a peer that has not spoken yet is called in both in turn."""
        beat = mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
        )
        self._beats += 1
        versions: dict[Peer, int] = {}
        for system, (peer, _) in list(self._peers.items()):
            versions[peer] = min(versions.get(peer, 2), self.version(system))
        callee = self._link.callee
        if callee is not None and not self._link.problem:
            versions.setdefault(callee, 2 if self.has_key else 1 + self._beats % 2)
        for peer, version in versions.items():
            self._send_to(peer, beat, version)
