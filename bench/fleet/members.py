"""A platform in a process of its own, run as `dyknow.runtime.process` runs one: edge, mailbox, loop, and the whole platform.

What it lacks is a vehicle: where positions are needed, a source in the process gives the estimates.
"""

import time
from collections.abc import Callable, Iterable
from functools import cache, partial
from queue import SimpleQueue
from threading import Thread
from typing import Any, NamedTuple

from dyknow import Sample
from dyknow.agents.capabilities.flight.flight import FlightAgent
from dyknow.agents.config import PlatformConfig
from dyknow.agents.directory.directory import DirectoryAgent
from dyknow.agents.monitoring.monitor_plans import PlanBook
from dyknow.agents.platform import Platform
from dyknow.federation.messages import contents
from dyknow.federation.sharing.ontology import default_ontology
from dyknow.federation.transport import Put, WireEffect
from dyknow.navigation.fusion import Estimate
from dyknow.proxies.zenoh.configuration import ZenohOptions
from dyknow.proxies.zenoh.edge import ZenohEdge
from dyknow.reasoning import builtin_profiles
from dyknow.runtime.clock import NodeClock
from dyknow.runtime.loop import step
from dyknow.runtime.mailbox import Mailbox

PATIENCE_S = 60.0
PERIOD_US = 100_000
_POLL_S = 0.02


class Do(NamedTuple):
    """An event: work for the node thread, which puts what comes of it into `done`."""

    work: Callable[[], Any]
    done: "SimpleQueue[Any]"


class Source:
    """Estimates on the grid of a period, each given `phase_us` after its valid time; `place` says where at that time."""

    def __init__(self, platform: Platform, phase_us: int, place: Callable[[int], tuple[float, float, float]]) -> None:
        self._platform, self._phase_us, self._place = platform, phase_us, place
        self.next_us: int | None = None

    def start(self, now_us: int) -> None:
        self.next_us = (now_us // PERIOD_US + 1) * PERIOD_US

    def stop(self) -> None:
        self.next_us = None

    @property
    def deadline_us(self) -> int | None:
        return None if self.next_us is None else self.next_us + self._phase_us

    def on_time(self, now_us: int) -> None:
        own = self._platform.part(FlightAgent).streams
        while own is not None and self.next_us is not None and self.next_us + self._phase_us <= now_us:
            estimate = Estimate(*self._place(self.next_us), 0.0, 0.0, 0.0, *(0.1,) * 6)
            own._push([Sample(now_us, self.next_us, estimate)], now_us)
            self.next_us += PERIOD_US


class _Node:
    """What the loop steps: the platform, its source, and work that the process was asked for."""

    def __init__(self, platform: Platform, source: Source | None) -> None:
        self._platform, self._source = platform, source
        self.wake_us: int | None = None
        self.on_wake: Callable[[int], None] = lambda _now_us: None

    @property
    def deadline_us(self) -> int:
        due_us = self._platform.deadline_us
        for other_us in (self.wake_us, None if self._source is None else self._source.deadline_us):
            if other_us is not None and other_us < due_us:
                due_us = other_us
        return due_us

    def on_event(self, event: Any, now_us: int) -> Iterable[Any]:
        if type(event) is Do:
            event.done.put(event.work())
            return self._platform.settle()
        return self._platform.on_event(event, now_us)

    def on_time(self, now_us: int) -> Iterable[Any]:
        if self._source is not None:
            self._source.on_time(now_us)
        if self.wake_us is not None and self.wake_us <= now_us:
            self.wake_us = None
            self.on_wake(now_us)
            return self._platform.settle()
        return self._platform.on_time(now_us)


class Member:
    """One platform process. A thread of its own steps it; `do` has that thread do something."""

    def __init__(self, unit: str, federation: str, *, platform: type[Platform] = Platform, **config: Any) -> None:
        prepare()
        self.clock = NodeClock()
        self.mailbox = Mailbox(self.clock.now_us)
        self._edge = ZenohEdge(ZenohOptions(federation), self.mailbox.post, self.clock.now_us)
        self._edge.open()
        now_us = self.clock.now_us()
        self.platform = platform(PlatformConfig(unit=unit, boot=now_us // 1000, zid=self._edge.zid, **config), now_us)
        self.source = self._source()
        self.node = _Node(self.platform, self.source)
        self._going = True
        for effect in self.platform.start(now_us):
            self._perform(effect)
        self._thread = Thread(target=self._run, daemon=True)
        self._thread.start()

    def _source(self) -> Source | None:
        return None

    def _run(self) -> None:
        while self._going:
            step(self.node, self.mailbox, self.clock.now_us, self._perform)
            self._stepped()

    def _stepped(self) -> None:
        """For what is to be seen at once."""

    def _perform(self, effect: Any) -> None:
        """Those of the wire; no vehicle, host or file is there for the others."""
        if type(effect) is Put or isinstance(effect, WireEffect):
            self._edge.perform(effect)

    def give(self) -> None:
        """Let the source give estimates from now on."""
        if self.source is None:
            raise ValueError(f"expected a source, got none in {type(self).__name__}; write its `_source`")
        self.do(partial(self.source.start, self.clock.now_us()))

    def rest(self) -> None:
        """Let the source give no more."""
        if self.source is not None:
            self.do(self.source.stop)

    def do(self, work: Callable[[], Any]) -> Any:
        done: SimpleQueue[Any] = SimpleQueue()
        self.mailbox.post(Do(work, done))
        return done.get(timeout=PATIENCE_S)

    def wait_for(self, condition: Callable[[], bool], what: str) -> None:
        until = time.monotonic() + PATIENCE_S
        while not self.do(condition):
            if time.monotonic() > until:
                raise TimeoutError(f"{self.platform.unit}: {what} within {PATIENCE_S:g} s")
            time.sleep(_POLL_S)

    def ready(self, platforms: int) -> bool:
        """That many are in the directory, this one included."""
        self.wait_for(lambda: len(self.platform.part(DirectoryAgent).members) == platforms, f"{platforms} platforms")
        return True

    def close(self) -> None:
        self._going = False
        self.mailbox.post(Do(lambda: None, SimpleQueue()))
        self._thread.join()
        for effect in self.platform.on_time(self.clock.now_us()):
            self._perform(effect)
        self._edge.close()


@cache
def prepare() -> None:
    """What a platform process reads and builds before it joins, once."""
    contents.prepare()
    default_ontology()
    PlanBook("0", builtin_profiles()).prepare()
