"""Our side of a federated sample: generator -> export proxy -> Zenoh -> import proxy -> policy -> consumer.

The parts are those of a platform, and so is the loop; what is left out is the rest of the platform (agents, directory,
heartbeats), which samples do not pass through. Valid times are the monotonic clock, which all processes share.
"""

import time
from collections.abc import Callable
from typing import Any, NamedTuple

from bench.instants import grid
from bench.streams.experiments import fluent_streams
from bench.wire.raw import IDLE_S, PATIENCE_S, delays, latencies
from dyknow import Network, Policy, Sample, earlier
from dyknow.agents.config import PlatformConfig
from dyknow.agents.containment import Containment
from dyknow.agents.exchange.export_proxy import ExportProxy
from dyknow.agents.exchange.import_proxy import ImportProxy
from dyknow.agents.parts import PlatformParts
from dyknow.agents.ports import Ports
from dyknow.federation import keys
from dyknow.federation.members.clock import Offset
from dyknow.federation.sharing.exports import Exports
from dyknow.federation.sharing.ontology import Ontology
from dyknow.federation.sharing.translation import Translation
from dyknow.federation.transport import Answered, Arrived, Asked, AskEnded, DeclareQueryable, Put, Urgency, WireEffect
from dyknow.kpl import Instance, parse_specification
from dyknow.proxies.zenoh.configuration import ZenohOptions
from dyknow.proxies.zenoh.edge import ZenohEdge
from dyknow.runtime.loop import step
from dyknow.runtime.mailbox import Mailbox

LABEL = "bench-state"
ONTOLOGY = Ontology({}).extended(
    f'[{LABEL}]\nsort = "state"\nmeaning = "eight numbers, about 100 bytes on the wire"\n'
    'fields = { a = "m", b = "m", c = "m", d = "m", e = "m", f = "m", g = "m", h = "m" }\n',
    "bench",
)
VALUE = (1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5, 8.5)
POLICY = Policy()
OWNER, RECEIVER = "0", "1"
_OFFSET = Offset(0, 100)


def monotonic_us() -> int:
    return time.monotonic_ns() // 1000


def _unheard(*_news: object) -> None:
    """Takes notes that nobody reads here."""


class Exporter:
    """The owner: a source, its export, and the history that receivers recover from."""

    def __init__(self, federation: str) -> None:
        self._mailbox = Mailbox(monotonic_us)
        self._edge = ZenohEdge(ZenohOptions(federation), self._mailbox.post, monotonic_us)
        self._edge.open()
        self._network, translation = Network(), Translation(ONTOLOGY)
        self._local = translation.local_label(LABEL, OWNER)
        self._network.add_source(self._local, translation.local_sort(LABEL))
        self._exports = Exports(OWNER, 1)
        self._proxy = ExportProxy(self._exports, self._network, translation, self._edge.perform)
        self._proxy.start_exporting(self._local, LABEL, [RECEIVER], POLICY, "bench")
        self._edge.perform(DeclareQueryable(keys.history_expr(OWNER)))

    def ready(self) -> bool:
        """Somebody is linked; the receiver's own `ready` says that samples come through."""
        until = time.monotonic() + PATIENCE_S
        while not self._edge.peers():
            if time.monotonic() > until:
                raise TimeoutError("nobody there")
            time.sleep(0.01)
        return True

    def pace(self, count: int, period_us: int) -> dict[str, float]:
        due = time.monotonic_ns()
        for _ in range(count):
            due += period_us * 1000
            time.sleep(max(0, due - time.monotonic_ns()) / 1e9)
            self._push()
            self._proxy.flush()
        self._serve()
        return {}

    def flood(self, seconds: float) -> dict[str, float]:
        until, number = time.monotonic() + seconds, 0
        while time.monotonic() < until:
            for _ in range(64):
                self._push()
            self._proxy.flush()
            number += 64
            self._serve()
        return {"sent": float(number)}

    def serve(self, seconds: float) -> bool:
        """Answer those who miss samples, for a while."""
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            self._serve()
            time.sleep(0.001)
        return True

    def put_on_grid(self, count: int, period_us: int) -> dict[str, float]:
        """`count` samples, each valid and put at a multiple of a period."""
        for _, due_us in zip(range(count), grid(period_us), strict=False):
            self._network.push(self._local, Sample(monotonic_us(), due_us, VALUE))
            self._proxy.flush()
        self._serve()
        return {}

    def _push(self) -> None:
        now_us = monotonic_us()
        self._network.push(self._local, Sample(now_us, now_us, VALUE))

    def _serve(self) -> None:
        while len(self._mailbox):
            event = self._mailbox.get(0)
            if isinstance(event, Asked):
                for effect in self._exports.on_asked(event, LABEL):
                    self._edge.perform(effect)

    def close(self) -> None:
        self._edge.close()


class Importer:
    """The receiver: a node that only imports, stepped by the loop in this thread."""

    def __init__(self, federation: str) -> None:
        self._mailbox = Mailbox(monotonic_us)
        self._edge = ZenohEdge(ZenohOptions(federation), self._mailbox.post, monotonic_us)
        self._edge.open()
        self._node = _ImportingNode()
        for effect in self._node.effects():
            self._edge.perform(effect)

    def ready(self) -> bool:
        return True

    def collect(self, count: int, streams: int = 1, idle_s: float = IDLE_S) -> dict[str, float]:
        """What the last of `streams` consumers gets, until it has `count` samples or none came for `idle_s`."""
        found = self._node.consume(streams)
        self._take(found, count, idle_s)
        return self._figures(found)

    def collect_on_grid(self, count: int, period_us: int, streams: int = 1, idle_s: float = IDLE_S) -> dict[str, float]:
        """The same of `streams` streams as thesis 5.5 declares them."""
        found = self._node.specify(streams, period_us)
        self._take(found, count, idle_s)
        return {
            **self._figures(found),
            **delays(
                [each.at_ns - each.valid_us * 1000 for each in found],
                [(each.arrived_us - each.valid_us) * 1000 for each in found],
            ),
        }

    def _take(self, found: "list[_Found]", count: int, idle_s: float) -> None:
        last = 0
        self._node.wake_us = monotonic_us() + round(PATIENCE_S * 1e6)
        while len(found) < count and monotonic_us() < self._node.wake_us:
            step(self._node, self._mailbox, monotonic_us, self._edge.perform)
            if len(found) > last:
                last = len(found)
                self._node.wake_us = monotonic_us() + round(idle_s * 1e6)

    def _figures(self, found: "list[_Found]") -> dict[str, float]:
        arrived = [each.at_ns for each in found]
        seconds = (arrived[-1] - arrived[0]) / 1e9 if len(arrived) > 1 else 1.0
        return {
            **latencies([each.at_ns - each.valid_us * 1000 for each in found]),
            "rate_per_s": max(0, len(arrived) - 1) / seconds,
            "missing": float(self._node.account().lost + self._node.missing()),
        }

    def close(self) -> None:
        self._edge.close()


class _Found(NamedTuple):
    """A sample that reached its consumer, and when it had reached this process."""

    at_ns: int
    valid_us: int
    arrived_us: int


class _PortsOfKnownClock(Ports):
    @property
    def offset_of(self) -> Callable[[str], Offset | None]:
        return lambda _owner: _OFFSET


class _ImportingNode:
    def __init__(self) -> None:
        self.wake_us: int | None = None
        self._arrived_us = 0
        self._effects: list[Any] = []
        self._subscriptions: list[Any] = []
        built = PlatformParts(PlatformConfig(RECEIVER, 0, vehicle=False, ontology=ONTOLOGY))
        built.ports = _PortsOfKnownClock(
            built.config, 0, emit=self._effects.append, note=_unheard, refuse=_unheard, on_peer=_unheard, on_alarm=_unheard,
            services=tuple, labels=tuple, conditions=tuple, now_us=lambda: 0,
            contain=Containment(_unheard, lambda: 0, str, lambda _unit: False), above=built,
        )  # fmt: skip
        self._network, translation = built.ports.network, built.ports.translation
        self._local = translation.local_label(LABEL, OWNER)
        self._network.add_source(self._local, translation.local_sort(LABEL))
        self._imports, self._importer = built.ports.imports, built[ImportProxy]
        self._importer.expect(OWNER, LABEL, POLICY.content_hash(), POLICY, 0)
        self._instance = Instance(self._network)

    def consume(self, streams: int) -> list[_Found]:
        """`streams` consumers; the list that the last of them fills."""
        self._release()
        found: list[_Found] = []

        def ignore(sample: Sample) -> None:
            pass

        def keep(sample: Sample) -> None:
            found.append(_Found(time.monotonic_ns(), sample.valid_us, self._arrived_us))

        self._subscriptions = [
            self._network.connect(self._local, POLICY, consumer) for consumer in [ignore] * (streams - 1) + [keep]
        ]
        return found

    def specify(self, streams: int, period_us: int) -> list[_Found]:
        """The streams of a specification; the list that the last of them fills."""
        self._release()
        found: list[_Found] = []
        last = f"strm{streams}"

        def keep(name: str, sample: Sample) -> None:
            if name == last:
                found.append(_Found(time.monotonic_ns(), sample.valid_us, self._arrived_us))

        self._instance.hooks.on_output = keep
        text = fluent_streams(streams, str(self._local), period_us // 1000)
        self._instance.change(parse_specification(text), monotonic_us(), text)
        return found

    def _release(self) -> None:
        for subscription in self._subscriptions:
            subscription.cancel()
        self._subscriptions = []
        self._instance.change((), monotonic_us())

    def account(self) -> Any:
        return next(iter(self._imports.streams.values())).stream.account

    def missing(self) -> int:
        return next(iter(self._imports.streams.values())).stream.missing

    def effects(self) -> list[WireEffect]:
        effects, self._effects[:] = list(self._effects), []
        return effects

    @property
    def deadline_us(self) -> int | None:
        return earlier(self.wake_us, self._imports.deadline_us)

    def on_event(self, event: Any, _now_us: int) -> list[WireEffect]:
        if isinstance(event, Arrived):
            self._arrived_us = event.at_us
            self._imports.on_arrived(event)
        elif isinstance(event, Answered):
            self._imports.on_answered(event)
        elif isinstance(event, AskEnded):
            self._imports.on_ask_ended(event)
        return self.effects() if self._effects else []

    def on_time(self, now_us: int) -> list[WireEffect]:
        self._effects += self._imports.on_time(now_us)
        return self.effects()


class EdgeReceiver:
    """Only the edge, the mailbox and the loop: what an event costs before anything is done with it."""

    def __init__(self, federation: str) -> None:
        self._mailbox = Mailbox(monotonic_us)
        self._edge = ZenohEdge(ZenohOptions(federation), self._mailbox.post, monotonic_us)
        self._edge.open()
        for effect in _ImportingNode().effects():
            self._edge.perform(effect)

    def ready(self) -> bool:
        return True

    def collect(self, count: int, idle_s: float = IDLE_S) -> dict[str, float]:
        from bench.wire.raw import STAMP

        found: list[tuple[int, int]] = []

        class Node:
            deadline_us: int | None = monotonic_us() + round(PATIENCE_S * 1e6)

            def on_event(self, event: Any, _now_us: int) -> list[WireEffect]:
                if isinstance(event, Arrived):
                    found.append((time.monotonic_ns(), STAMP.unpack_from(event.payload)[1]))
                return []

            def on_time(self, _now_us: int) -> list[WireEffect]:
                return []

        node, last = Node(), 0
        while len(found) < count and monotonic_us() < (node.deadline_us or 0):
            step(node, self._mailbox, monotonic_us, self._edge.perform)
            if len(found) > last:
                last = len(found)
                node.deadline_us = monotonic_us() + round(idle_s * 1e6)
        arrived = [at_ns for at_ns, _ in found]
        seconds = (arrived[-1] - arrived[0]) / 1e9 if len(arrived) > 1 else 1.0
        return {
            **latencies([at_ns - sent_ns for at_ns, sent_ns in found]),
            "rate_per_s": max(0, len(arrived) - 1) / seconds,
        }

    def close(self) -> None:
        self._edge.close()


class EdgeSender:
    """The edge's put, and nothing before it."""

    def __init__(self, federation: str) -> None:
        self._edge = ZenohEdge(ZenohOptions(federation), lambda _event: None, monotonic_us)
        self._edge.open()
        self._key = keys.stream(OWNER, LABEL, POLICY.content_hash())

    def ready(self) -> bool:
        until = time.monotonic() + PATIENCE_S
        while not self._edge.peers():
            if time.monotonic() > until:
                raise TimeoutError("nobody there")
            time.sleep(0.01)
        time.sleep(0.2)  # the link is there; its declarations follow
        return True

    def pace(self, count: int, period_us: int, size: int = 100) -> dict[str, float]:
        from bench.wire.raw import STAMP

        rest = bytes(size - STAMP.size)
        due = time.monotonic_ns()
        for number in range(count):
            due += period_us * 1000
            time.sleep(max(0, due - time.monotonic_ns()) / 1e9)
            payload = STAMP.pack(number, time.monotonic_ns()) + rest
            self._edge.perform(Put(self._key, payload, Urgency.STREAM))
        return {}

    def flood(self, seconds: float, size: int = 100) -> dict[str, float]:
        from bench.wire.raw import STAMP

        rest = bytes(size - STAMP.size)
        until, number = time.monotonic_ns() + round(seconds * 1e9), 0
        while (now := time.monotonic_ns()) < until:
            self._edge.perform(Put(self._key, STAMP.pack(number, now) + rest, Urgency.STREAM))
            number += 1
        return {"sent": float(number)}

    def close(self) -> None:
        self._edge.close()
