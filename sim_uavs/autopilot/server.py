"""One simulated vehicle on one UDP socket in one thread: the only place here that waits."""

import contextlib
import socket
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Self

from dyknow.federation.members.clock import FederationClock
from dyknow.navigation.vehicle import ImageReport
from dyknow.runtime.clock import NodeClock
from dyknow.sim_uavs.autopilot.autopilot import Autopilot, Sent
from dyknow.sim_uavs.dynamics.faults import SimulatedFault
from dyknow.sim_uavs.dynamics.flight import STEP_US
from dyknow.sim_uavs.dynamics.settings import VehicleConfig
from dyknow.sim_uavs.dynamics.slung import Hoist

if TYPE_CHECKING:
    from dyknow.sim_uavs.cameras.onboard import OnboardCameras

_LARGEST, _FRAME = 65_535, 1_400
_LONGEST_WAIT_S = 0.5
IMAGE_US = 40_000
"""25 images a second."""


def _is_here(address: str) -> bool:
    return address.startswith("127.")


class AutopilotServer:
    """Runs an `Autopilot` from `start` to `stop` on `host`, on `port` (0: any free one; then `port` says which).

    Names of given peers are resolved once, here. Without a `host` the vehicle is on loopback only, unless it is given
    a peer elsewhere: then that host, and no other, may speak to it as well.

    Attributes:
        carried: cameras on its mount; their images go to `on_image`, which must not block.
        hoist: a winch with a magnet.
        clock: how the vehicle's time follows `wall_us`; at speed 10 it flies ten times as fast.

    Raises:
        OSError: a given peer's name cannot be resolved, or the port is taken.
    """

    def __init__(
        self,
        config: VehicleConfig,
        *,
        host: str | None = None,
        port: int = 0,
        clock: FederationClock | None = None,
        wall_us: Callable[[], int] | None = None,
        carried: "OnboardCameras | None" = None,
        on_image: Callable[[ImageReport], None] = lambda _report: None,
        hoist: Hoist | None = None,
    ) -> None:
        peers = tuple((socket.gethostbyname(name), number) for name, number in config.peers)
        self.config, self.clock = replace(config, peers=peers), clock or FederationClock()
        self._elsewhere = frozenset(address for address, _ in peers if not _is_here(address))
        self._wall_us = wall_us or NodeClock().now_us
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((host or ("0.0.0.0" if self._elsewhere else "127.0.0.1"), port))  # noqa: S104  asked for
        self._autopilot = Autopilot(self.config, self.now_us())
        if hoist is not None:
            self._autopilot.carry(hoist)
        self._carried, self._on_image, self._image_us = carried, on_image, self.now_us()
        self._lock, self._stopping = threading.Lock(), threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"autopilot-{config.system_id}", daemon=True)

    @property
    def port(self) -> int:
        port: int = self._socket.getsockname()[1]
        return port

    def now_us(self) -> int:
        """The vehicle's time, before any clock fault."""
        return self.clock.federation_us(self._wall_us())

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """End the thread and close the socket; harmless when repeated."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join()
        self._socket.close()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def inject(self, fault: SimulatedFault, duration_us: int | None = None) -> int | None:
        """Begin a fault for `duration_us` of the vehicle's time, or for good; returns when it ends."""
        with self._lock:
            now_us = self.now_us()
            until_us = None if duration_us is None else now_us + duration_us
            self._autopilot.inject(fault, now_us, until_us)
        return until_us

    def _run(self) -> None:
        while not self._stopping.is_set():
            self._socket.settimeout(self._wait_s())
            try:
                data, peer = self._socket.recvfrom(_LARGEST)
            except TimeoutError:
                data, peer = b"", ("", 0)
            except OSError:  # a peer's closed port, told by ICMP: it may come back
                continue
            if data and not (_is_here(peer[0]) or peer[0] in self._elsewhere):
                continue
            with self._lock:
                now_us = self.now_us()
                sent = self._autopilot.on_bytes(data, peer, now_us) if data else self._autopilot.on_time(now_us)
            self._send(sent)
            if self._carried is not None and now_us >= self._image_us:
                self._look(self._carried, now_us)

    def _look(self, carried: "OnboardCameras", now_us: int) -> None:
        """Take the images of an instant at which the flight was stepped; late ones are skipped."""
        self._image_us = now_us - now_us % IMAGE_US + IMAGE_US
        valid_us = now_us - now_us % STEP_US
        with self._lock:
            seen = self._autopilot.looking(valid_us)
        report = None if seen is None else carried.image(valid_us, *seen)
        if report is not None:
            self._on_image(report)

    def _wait_s(self) -> float:
        due_us = self._autopilot.deadline_us
        if self._carried is not None:
            due_us = min(due_us, self._image_us)
        due_us = self.clock.wall_us(due_us)
        return min(_LONGEST_WAIT_S, max(1e-6, (due_us - self._wall_us()) / 1e6))

    def _send(self, sent: Sent) -> None:
        for peer, datagram in together(sent):
            with contextlib.suppress(OSError):  # nobody listens there at the moment
                self._socket.sendto(datagram, peer)


def together(sent: Sent) -> Iterator[tuple[tuple[str, int], bytes]]:
    """The messages for one peer, in their order, in as few datagrams as an Ethernet frame allows, as autopilots do."""
    waiting: dict[tuple[str, int], bytes] = {}
    for peer, data in sent:
        before = waiting.get(peer, b"")
        if before and len(before) + len(data) > _FRAME:
            yield peer, before
            before = b""
        waiting[peer] = before + data
    yield from waiting.items()
