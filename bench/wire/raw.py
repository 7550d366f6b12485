"""The peers: zenoh-python by itself, on the topology and quality of service that a federation uses.

Each class is one process (see `workers`). Payloads carry a number and the monotonic clock, which all processes of a
machine share.
"""

import json
import struct
import time
from collections.abc import Callable
from queue import Empty, SimpleQueue
from statistics import median
from typing import Any

import zenoh
from zenoh.handlers import Callback

from bench.instants import grid
from dyknow.proxies.zenoh.configuration import ZenohOptions, zenoh_config

STAMP = struct.Struct("<qq")
PATIENCE_S = 10.0
IDLE_S = 0.5


def opened(federation: str) -> zenoh.Session:
    config = zenoh_config(ZenohOptions(federation), lambda _interface: "127.0.0.1")
    return zenoh.open(zenoh.Config.from_json5(json.dumps(config)))


def closed(session: zenoh.Session) -> None:
    close: Callable[[], None] = session.close
    close()


def wait_matching(publisher: zenoh.Publisher, otherwise: str) -> None:
    """Until somebody subscribes."""
    until = time.monotonic() + PATIENCE_S
    while True:
        status: Any = publisher.matching_status
        if status.matching:
            return
        if time.monotonic() > until:
            raise TimeoutError(otherwise)
        time.sleep(0.01)


def handler(callback: str, take: Callable[[Any], None]) -> Any:
    return take if callback == "plain" else Callback(take, indirect=False)


def latencies(found_ns: list[int]) -> dict[str, float]:
    """Of nothing: zeros, and `received` says so."""
    if not found_ns:
        return {"p50_us": 0.0, "p99_us": 0.0, "received": 0.0}
    ordered = sorted(found_ns)
    return {
        "p50_us": median(ordered) / 1e3,
        "p99_us": ordered[min(len(ordered) - 1, len(ordered) * 99 // 100)] / 1e3,
        "received": float(len(ordered)),
    }


def delays(found_ns: list[int], channel_ns: list[int]) -> dict[str, float]:
    """The delays of thesis 5.5: until the last consumer has it, and of that until it reached the receiving process."""
    return {
        "total_us": median(found_ns) / 1e3 if found_ns else 0.0,
        "channel_us": median(channel_ns) / 1e3 if channel_ns else 0.0,
    }


class Receiver:
    """A subscriber whose handler puts into a queue; one thread reads it."""

    def __init__(self, federation: str, callback: str = "plain", key: str = "x/**") -> None:
        self._queue: SimpleQueue[tuple[int, bytes]] = SimpleQueue()
        self._session = opened(federation)
        self._subscriber = self._session.declare_subscriber(key, handler(callback, self._on_sample))

    def _on_sample(self, found: zenoh.Sample) -> None:
        self._queue.put((time.monotonic_ns(), found.payload.to_bytes()))

    def ready(self) -> bool:
        return True

    def collect(self, count: int, streams: int = 1, idle_s: float = IDLE_S) -> dict[str, float]:
        """What the last of `streams` consumers gets, until it has `count` samples or none came for `idle_s`."""
        found: list[int] = []
        channel: list[int] = []
        first = last = 0
        wait_s = PATIENCE_S

        def ignore(payload: bytes) -> None:
            pass

        def keep(payload: bytes) -> None:
            nonlocal first, last
            last = time.monotonic_ns()
            first = first or last
            found.append(last - STAMP.unpack_from(payload)[1])

        consumers = [ignore] * (streams - 1) + [keep]
        try:
            while len(found) < count:
                arrived_ns, payload = self._queue.get(timeout=wait_s)
                for consumer in consumers:
                    consumer(payload)
                channel.append(arrived_ns - STAMP.unpack_from(payload)[1])
                wait_s = idle_s
        except Empty:
            pass
        rate_per_s = (len(found) - 1) / ((last - first) / 1e9) if len(found) > 1 else 0.0
        return {**latencies(found), **delays(found, channel), "rate_per_s": rate_per_s}

    def collect_on_grid(self, count: int, period_us: int, streams: int = 1) -> dict[str, float]:
        """The same; whoever only calls has no grid."""
        del period_us
        return self.collect(count, streams)

    def close(self) -> None:
        closed(self._session)


class Sender:
    """A publisher. `express` sends every message by itself, at once."""

    def __init__(self, federation: str, *, express: bool = False, key: str = "x/0/position/aaaaaaaa") -> None:
        self._session = opened(federation)
        self._publisher = self._session.declare_publisher(
            key, congestion_control=zenoh.CongestionControl.DROP, express=express
        )

    def ready(self) -> bool:
        wait_matching(self._publisher, "nobody subscribes")
        return True

    def put_on_grid(self, count: int, period_us: int, size: int = 100) -> dict[str, float]:
        """`count` messages, each at a multiple of a period."""
        rest = bytes(size - STAMP.size)
        for number, due_us in zip(range(count), grid(period_us), strict=False):
            self._publisher.put(STAMP.pack(number, due_us * 1000) + rest)
        return {}

    def pace(self, count: int, period_us: int, size: int = 100) -> dict[str, float]:
        """`count` messages, one per period."""
        rest = bytes(size - STAMP.size)
        due = time.monotonic_ns()
        for number in range(count):
            due += period_us * 1000
            time.sleep(max(0, due - time.monotonic_ns()) / 1e9)
            self._publisher.put(STAMP.pack(number, time.monotonic_ns()) + rest)
        return {}

    def flood(self, seconds: float, size: int = 100) -> dict[str, float]:
        """As many as can be sent."""
        rest = bytes(size - STAMP.size)
        until, number = time.monotonic_ns() + round(seconds * 1e9), 0
        while (now := time.monotonic_ns()) < until:
            self._publisher.put(STAMP.pack(number, now) + rest)
            number += 1
        return {"sent": float(number)}

    def close(self) -> None:
        closed(self._session)


class Answerer:
    """A queryable that answers at once, in its handler."""

    def __init__(self, federation: str, key: str = "q/0/state") -> None:
        self._session, self._key = opened(federation), key
        self._queryable = self._session.declare_queryable(key, self._on_query)

    def _on_query(self, query: zenoh.Query) -> None:
        with query:
            query.reply(self._key, query.payload or b"")

    def ready(self) -> bool:
        return True

    def close(self) -> None:
        closed(self._session)


class Asker:
    """Blocking questions, one after the other."""

    def __init__(self, federation: str, key: str = "q/0/state") -> None:
        self._session, self._key = opened(federation), key

    def ready(self) -> bool:
        until = time.monotonic() + PATIENCE_S
        while not any(reply.ok for reply in self._session.get(self._key, payload=b"", timeout=1.0)):
            if time.monotonic() > until:
                raise TimeoutError("nobody answers")
            time.sleep(0.01)
        return True

    def ask(self, count: int, period_us: int = 5000, size: int = 200) -> dict[str, float]:
        """`count` questions, one per period: how long until the answer is there."""
        found, payload = [], bytes(size)
        for _ in range(count):
            time.sleep(period_us / 1e6)
            asked = time.monotonic_ns()
            replies = self._session.get(self._key, payload=payload, timeout=1.0)
            found += [time.monotonic_ns() - asked for reply in replies if reply.ok is not None]
        return latencies(found)

    def close(self) -> None:
        closed(self._session)


class Player:
    """Put to one another: `hit` waits for what `play` returns. Handlers put into a queue that one thread reads."""

    def __init__(self, federation: str, own: str, other: str, *, express: bool = False) -> None:
        self._queue: SimpleQueue[bytes] = SimpleQueue()
        self._session = opened(federation)
        self._subscriber = self._session.declare_subscriber(
            f"acl/{own}/**", lambda found: self._queue.put(found.payload.to_bytes())
        )
        self._publisher = self._session.declare_publisher(
            f"acl/{other}/{own}/interface",
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.INTERACTIVE_HIGH,
            express=express,
        )

    def ready(self) -> bool:
        wait_matching(self._publisher, "nobody there")
        return True

    def play(self, count: int) -> bool:
        for _ in range(count):
            self._publisher.put(self._queue.get(timeout=PATIENCE_S))
        return True

    def hit(self, count: int, period_us: int = 5000, size: int = 200) -> dict[str, float]:
        found, payload = [], bytes(size)
        for _ in range(count):
            time.sleep(period_us / 1e6)
            began = time.monotonic_ns()
            self._publisher.put(payload)
            self._queue.get(timeout=PATIENCE_S)
            found.append(time.monotonic_ns() - began)
        return latencies(found)

    def close(self) -> None:
        closed(self._session)
