"""Many sessions at once: the raw mesh of B11 and the discovery of B13, one process per session (see `workers`)."""

import resource
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from threading import Event
from typing import Any

import zenoh

from bench.wire.raw import PATIENCE_S, STAMP, closed, latencies, opened
from bench.workers import Worker
from dyknow.federation import keys
from dyknow.federation.transport import DeclareToken, TokenChanged, WatchTokens, WireEvent
from dyknow.proxies.zenoh.configuration import ZenohOptions
from dyknow.proxies.zenoh.edge import ZenohEdge

_HEAD_START_NS = 100_000_000
STREAMS = ("heli-position", "heli-altitude")


class MeshPeer:
    """A session that puts its streams and hears those of all others: the least a federation can cost."""

    def __init__(self, federation: str, number: int) -> None:
        self._session, self._found_ns, self._got = opened(federation), list[int](), dict[str, list[int]]()
        self._publishers = [
            self._session.declare_publisher(
                keys.stream(str(number), label, "0123abcd"), congestion_control=zenoh.CongestionControl.DROP
            )
            for label in STREAMS
        ]
        self._subscriber = self._session.declare_subscriber("x/**", self._on_sample)

    def _on_sample(self, found: zenoh.Sample) -> None:
        now_ns = time.monotonic_ns()
        number, sent_ns = STAMP.unpack_from(found.payload.to_bytes())
        self._got.setdefault(str(found.key_expr), []).append(number)
        self._found_ns.append(now_ns - sent_ns)

    def peers(self) -> int:
        return len(self._session.info.peers_zid())

    def fly(self, seconds: float, period_us: int, start_ns: int, size: int = 100) -> dict[str, float]:
        """Put every stream once per period; what that cost, what arrived, and how many numbers are missing."""
        self._found_ns.clear()
        self._got.clear()
        rest, due, number = bytes(size - STAMP.size), start_ns, 0
        time.sleep(max(0, due - time.monotonic_ns()) / 1e9)
        before_s = cpu_s()
        while due < start_ns + seconds * 1e9:
            for publisher in self._publishers:
                publisher.put(STAMP.pack(number, time.monotonic_ns()) + rest)
            number, due = number + 1, due + period_us * 1000
            time.sleep(max(0, due - time.monotonic_ns()) / 1e9)
        gaps = sum(numbers[-1] - numbers[0] + 1 - len(numbers) for numbers in self._got.values())
        return {**latencies(self._found_ns or [0]), "cpu_s": cpu_s() - before_s, "gaps": float(gaps)}

    def close(self) -> None:
        closed(self._session)


def cpu_s() -> float:
    """User and system time of this process so far."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


@contextmanager
def mesh(federation: str, size: int, what: str = "bench.wire.meshes:MeshPeer") -> Iterator[list[Worker]]:
    """`size` processes that are all linked with each other."""
    with ExitStack() as stack:
        found = [
            stack.enter_context(Worker(what, {"federation": federation, "number": number})) for number in range(size)
        ]
        until = time.monotonic() + PATIENCE_S + size
        while any(worker.call("peers") < size - 1 for worker in found):
            if time.monotonic() > until:
                raise TimeoutError(f"not all of {size} peers met")
            time.sleep(0.1)
        yield found


def together(workers: Sequence[Worker], method: str, **arguments: Any) -> list[Any]:
    """Call a method of all, which gets `start_ns`, an instant shortly ahead that all wait for."""
    start_ns = time.monotonic_ns() + _HEAD_START_NS
    for worker in workers:
        worker.begin(method, start_ns=start_ns, **arguments)
    return [worker.end() for worker in workers]


def flown(workers: Sequence[Worker], seconds: float, period_us: int = 100_000) -> dict[str, float]:
    """One flight of a raw mesh: share of one core that all together took, latency, and gaps in the numbers."""
    found = together(workers, "fly", seconds=seconds, period_us=period_us)
    return {
        "cpu_share": sum(figures["cpu_s"] for figures in found) / seconds,
        "p50_us": sorted(figures["p50_us"] for figures in found)[len(found) // 2],
        "p99_us": max(figures["p99_us"] for figures in found),
        "gaps": sum(figures["gaps"] for figures in found),
    }


class RawNewcomer:
    """Opens a session, declares its token and watches those of others, by zenoh-python alone."""

    def __init__(self, number: int) -> None:
        self._number = number

    def discover(self, federation: str, size: int, start_ns: int) -> float:
        """Milliseconds from the start until all `size` tokens are held."""
        time.sleep(max(0, start_ns - time.monotonic_ns()) / 1e9)
        seen = _Seen(size)
        session = opened(federation)
        liveliness = session.liveliness()
        watch = liveliness.declare_subscriber(keys.TOKENS, lambda found: seen.add(str(found.key_expr)), history=True)
        token = liveliness.declare_token(keys.token_platform(str(session.zid()), str(self._number), "uav", 1))
        found = seen.wait(start_ns)
        self._held = (session, watch, token)
        return found

    def leave(self) -> bool:
        closed(self._held[0])
        return True


class EdgeNewcomer:
    """The same by our edge."""

    def __init__(self, number: int) -> None:
        self._number = number

    def discover(self, federation: str, size: int, start_ns: int) -> float:
        time.sleep(max(0, start_ns - time.monotonic_ns()) / 1e9)
        seen = _Seen(size)

        def post(event: WireEvent) -> None:
            if isinstance(event, TokenChanged):
                seen.add(event.key)

        self._edge = ZenohEdge(ZenohOptions(federation), post, lambda: 0)
        self._edge.open()
        self._edge.perform(WatchTokens(keys.TOKENS))
        self._edge.perform(DeclareToken(keys.token_platform(self._edge.zid, str(self._number), "uav", 1)))
        return seen.wait(start_ns)

    def leave(self) -> bool:
        self._edge.close()
        return True


class _Seen:
    """Tokens by key, and when the last of `size` was first seen."""

    def __init__(self, size: int) -> None:
        self._size, self._keys, self._complete, self._complete_ns = size, set[str](), Event(), 0

    def add(self, key: str) -> None:
        self._keys.add(key)
        if len(self._keys) == self._size and not self._complete_ns:
            self._complete_ns = time.monotonic_ns()
            self._complete.set()

    def wait(self, start_ns: int) -> float:
        if not self._complete.wait(PATIENCE_S):
            raise TimeoutError(f"only {len(self._keys)} of {self._size} tokens seen")
        return (self._complete_ns - start_ns) / 1e6


def discovered(workers: Sequence[Worker], federation: str) -> float:
    """Milliseconds until each of the workers holds the tokens of all."""
    slowest = max(together(workers, "discover", federation=federation, size=len(workers)))
    for worker in workers:
        worker.call("leave")
    return float(slowest)


@contextmanager
def newcomers(what: str, sizes: Mapping[int, int]) -> Iterator[Callable[[str], dict[str, float]]]:
    """Processes of one kind; the function measures every size once, in federations named after its argument.

    Args:
        sizes: how many there are for each size that is reported.
    """
    with ExitStack() as stack:
        workers = [stack.enter_context(Worker(what, {"number": number})) for number in range(max(sizes.values()))]
        yield lambda name: {
            f"n{size}_ms": discovered(workers[:count], f"{name}-{size}") for size, count in sizes.items()
        }
