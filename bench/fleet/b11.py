"""B11: what a federation of 16 platforms costs, beyond the messages themselves."""

import os
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from threading import Event, Thread
from typing import Any

import zenoh

from bench.fleet.members import PATIENCE_S, PERIOD_US, Member, Source
from bench.rows import Limit, Options, Ratio, Side
from bench.wire.raw import STAMP, closed, latencies, opened
from bench.workers import Worker
from dyknow import US_PER_S
from dyknow.agents.capabilities.flight.options import AvoidanceOptions
from dyknow.agents.exchange.gateway import stream_policy
from dyknow.agents.options import Chosen
from dyknow.agents.platform import Platform
from dyknow.federation import keys
from dyknow.federation.messages.codec import StreamSample, encode_samples
from dyknow.federation.messages.contents import MonitorProximity
from dyknow.reasoning import AlarmEvent

TITLE = "16 platforms, position and altitude all to all at 10 Hz, every one monitors proximity to all"
BARS = (Ratio("cpu_percent", 2.5), Limit("gaps", 0.0), Limit("alarms_missed", 0.0), Limit("alarm_p99_ms", 100.0))
PLATFORMS = 16
LEADER = "0"
SECONDS = 4.0
"""Of one round: 15 of them are the minute."""
LEAST_S = 2.5
"""Each pair comes too close once in 2 s."""

HOME = 57.7, 16.5, 60.0
APART_DEG = 0.003  # 180 m of longitude there
EVERY, LASTS = 20, 3
"""Each pair of neighbours is too close for 3 samples in every 20."""

STREAMS = ("heli-position", "heli-altitude")


def phase_us(index: int, platforms: int) -> int:
    """Platforms give their samples one after the other, as vehicles do that know nothing of each other."""
    return index * PERIOD_US // platforms


def too_close(index: int, valid_us: int) -> bool:
    return (valid_us // PERIOD_US + index // 2) % EVERY < LASTS


def shown_at_us(index: int, platforms: int, valid_us: int) -> int:
    """When the second of a pair's samples of that time is given."""
    return valid_us + phase_us(index | 1, platforms)


@contextmanager
def sides(options: Options) -> Iterator[dict[str, Side]]:
    platforms = options.size(PLATFORMS, 2)
    seconds = max(SECONDS * options.effort, LEAST_S)
    with ExitStack() as stack:

        def workers(side: str, what: str) -> list[Worker]:
            shared = {"federation": f"bench-b11-{os.getpid()}-{side}", "platforms": platforms}
            found = [stack.enter_context(Worker(what, {**shared, "index": index})) for index in range(platforms)]
            for worker in found:
                worker.begin("ready", platforms=platforms)
            for worker in found:
                worker.end()
            return found

        found: dict[str, Side] = {}
        if options.wants("raw"):
            raw = workers("raw", "bench.fleet.b11:Meshed")
            found["raw"] = lambda: _all(_each(raw, "run", seconds=seconds))
        if options.wants("ours"):
            ours = workers("ours", "bench.fleet.b11:Monitoring")

            def run() -> dict[str, float]:
                _each(ours, "begin")
                ours[1].call("delegate")
                _each(ours, "settled")
                figures = _all(_each(ours, "run", seconds=seconds))
                ours[1].call("cancel")
                _each(ours, "ended")
                return figures

            found["ours"] = run
        yield found


def _each(workers: list[Worker], method: str, **arguments: Any) -> list[Any]:
    for worker in workers:
        worker.begin(method, **arguments)
    return [worker.end() for worker in workers]


def _all(found: list[dict[str, Any]]) -> dict[str, float]:
    """One federation's figures: processor time in percent of one core, of all processes together."""
    alarms = [latency_ns for one in found for latency_ns in one.get("alarm_ns", ())]
    figures = {
        "cpu_percent": sum(one["cpu_percent"] for one in found),
        "received": sum(one["received"] for one in found),
        "gaps": sum(one["gaps"] for one in found),
    }
    if "expected" in found[0]:
        shown = latencies(alarms) if alarms else {"p50_us": 0.0, "p99_us": 0.0}
        figures |= {
            "alarms_missed": float(sum(one["expected"] for one in found) - len(alarms)),
            "alarm_p50_ms": shown["p50_us"] / 1e3,
            "alarm_p99_ms": shown["p99_us"] / 1e3,
            "recovered": sum(one["recovered"] for one in found),
        }
    else:
        figures["p50_ms"] = sum(one["p50_us"] for one in found) / len(found) / 1e3
    return figures


class _Watched(Platform):
    """A platform that notes when its monitors open an alarm."""

    def __init__(self, *given: Any, **named: Any) -> None:
        self.opened: list[tuple[int, int]] = []
        super().__init__(*given, **named)

    def _on_alarm(self, event: AlarmEvent) -> None:
        if event.event == "opened":
            self.opened.append((event.valid_us, time.monotonic_ns()))
        super()._on_alarm(event)


class Monitoring(Member):
    """One platform of the federation."""

    platform: _Watched

    def __init__(self, federation: str, index: int, platforms: int) -> None:
        self.index, self.platforms = index, platforms
        super().__init__(str(index), federation, platform=_Watched, options=Chosen(AvoidanceOptions(avoidance=False)))

    def _source(self) -> Source:
        return Source(self.platform, phase_us(self.index, self.platforms), self._place)

    def _place(self, valid_us: int) -> tuple[float, float, float]:
        latitude_deg, longitude_deg, altitude_m = HOME
        place = float(self.index)
        if self.index % 2 and too_close(self.index, valid_us):
            place -= 0.95
        return latitude_deg, longitude_deg + place * APART_DEG, altitude_m

    def begin(self) -> bool:
        self.give()
        return True

    def delegate(self) -> bool:
        """Ask the first platform to lead the task, as a command centre does: what it asks of others shows this request."""
        content = MonitorProximity(profile="proximity", avoidance=False)
        self.task = self.do(lambda: self.platform.ports.agent.delegate(LEADER, content, self.clock.now_us()))
        return True

    def settled(self) -> bool:
        """Every monitor has fresh inputs."""

        def fresh() -> bool:
            named = self.platform.built.monitors.named.get("proximity")
            return (
                named is not None
                and len(named.instances) == self.platforms - 1
                and all(instance.monitor.inputs == "fresh" for instance in named.instances.values())
            )

        try:
            self.wait_for(fresh, "fresh inputs of all")
        except TimeoutError:
            raise TimeoutError(f"{self.index}: {self.do(self._lacks)}") from None
        return True

    def _lacks(self) -> str:
        """What a platform says of the monitors that do not settle."""
        platform = self.platform
        named = platform.built.monitors.named.get("proximity")
        stale = {
            member: (instance.monitor.inputs, instance.monitor.missing_inputs, dict(instance.monitor.reasons))
            for member, instance in ({} if named is None else named.instances).items()
            if instance.monitor.inputs != "fresh"
        }
        present = [entry.unit for entry in platform.ports.directory.search()]
        standing = {unit: platform.member.offsets.standing(unit) for unit in stale}
        imports = {
            found.stream.label: (found.stream.account, found.stream.missing)
            for found in platform.built.gateway.importer.imports.streams.values()
            if found.stream.owner in stale
        }
        return f"{stale} of {present}; {standing}; {imports}; refused {dict(platform.built.gateway.importer.refused)}"

    def run(self, seconds: float) -> dict[str, Any]:
        """Measure for a while."""
        before, from_us = self.do(self._account), self.clock.now_us()
        cpu_ns = time.process_time_ns()
        time.sleep(seconds)
        cpu_ns = time.process_time_ns() - cpu_ns
        to_us = self.clock.now_us()
        after = self.do(self._account)
        time.sleep(0.3)  # what was shown last is still to be found
        opened = self.do(lambda: list(self.platform.opened))
        offset_ns = self.clock.now_us() * 1000 - time.monotonic_ns()
        wanted = set(self._shown(from_us, to_us))
        return {
            "cpu_percent": cpu_ns / seconds / 1e7,
            "received": float(after[0] - before[0]),
            "gaps": float(after[1]),
            "recovered": float(after[2] - before[2]),
            "expected": len(wanted),
            "alarm_ns": [
                at_ns + offset_ns - shown_at_us(self.index, self.platforms, valid_us) * 1000
                for valid_us, at_ns in opened
                if valid_us in wanted
            ],
        }

    def _shown(self, from_us: int, to_us: int) -> Iterator[int]:
        """The valid times between these at which this platform and its neighbour come too close."""
        first_us = (from_us // PERIOD_US + 1) * PERIOD_US
        for valid_us in range(first_us, to_us - PERIOD_US, PERIOD_US):
            if too_close(self.index, valid_us) and not too_close(self.index, valid_us - PERIOD_US):
                yield valid_us

    def _account(self) -> tuple[int, int, int]:
        """Samples received, numbers that lack, and those that came by asking, over all streams."""
        streams = [found.stream for found in self.platform.built.gateway.importer.imports.streams.values()]
        return (
            sum(stream.account.received for stream in streams),
            sum(stream.account.lost + stream.missing for stream in streams),
            sum(stream.account.recovered for stream in streams),
        )

    def cancel(self) -> bool:
        self.do(lambda: self.platform.ports.agent.cancel(LEADER, self.task, self.clock.now_us()))
        return True

    def ended(self) -> bool:
        """Nothing is monitored any more, and nothing exported."""
        self.wait_for(lambda: not self.platform.built.monitors.named, "the end of the task")
        self.rest()
        self.do(self.platform.opened.clear)
        self.wait_for(lambda: not self.platform.built.gateway.exporter.exports.streams(), "the end of the streams")
        return True


class Meshed:
    """The peer: a session that puts the same messages, and does nothing with those of all others."""

    def __init__(self, federation: str, index: int, platforms: int) -> None:
        self.index, self.platforms = index, platforms
        self._found_ns: list[int] = []
        self._session = opened(federation)
        policy_hash = stream_policy(PERIOD_US / US_PER_S, 0.5).content_hash()
        self._publishers = [
            self._session.declare_publisher(
                keys.stream(str(index), label, policy_hash), congestion_control=zenoh.CongestionControl.DROP
            )
            for label in STREAMS
        ]
        place = StreamSample(100_000, time.time_ns() // 1000, HOME[:2])
        height = place._replace(value=HOME[2:])
        self._sizes = [len(encode_samples(time.time_ns() // 1_000_000, [entry])) for entry in (place, height)]
        self._subscriber = self._session.declare_subscriber(
            "x/**", self._on_sample, allowed_origin=zenoh.Locality.REMOTE
        )

    def _on_sample(self, found: zenoh.Sample) -> None:
        self._found_ns.append(time.monotonic_ns() - STAMP.unpack_from(found.payload.to_bytes())[1])

    def ready(self, platforms: int) -> bool:
        until = time.monotonic() + PATIENCE_S
        while len(self._session.info.peers_zid()) < platforms - 1:
            if time.monotonic() > until:
                raise TimeoutError("the mesh is not complete")
            time.sleep(0.02)
        time.sleep(0.5)  # links are there; declarations follow
        return True

    def run(self, seconds: float) -> dict[str, Any]:
        self._found_ns.clear()
        stop, cpu_ns = Event(), time.process_time_ns()
        putting = Thread(target=self._put, args=(stop,))
        putting.start()
        time.sleep(seconds)
        cpu_ns = time.process_time_ns() - cpu_ns
        stop.set()
        putting.join()
        return {"cpu_percent": cpu_ns / seconds / 1e7, "gaps": 0.0, **latencies(self._found_ns)}

    def _put(self, stop: Event) -> None:
        """Both messages of each period, in the same phase as the platform of that index."""
        due_us = (time.time_ns() // 1000 // PERIOD_US + 1) * PERIOD_US + phase_us(self.index, self.platforms)
        number = 0
        while not stop.wait(max(0.0, due_us / 1e6 - time.time())):
            for publisher, size in zip(self._publishers, self._sizes, strict=True):
                publisher.put(STAMP.pack(number, time.monotonic_ns()).ljust(size, b"\0"))
            number += 1
            due_us += PERIOD_US

    def close(self) -> None:
        closed(self._session)
