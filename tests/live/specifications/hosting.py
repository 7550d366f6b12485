"""An instance that lets hosts in by a real door, in the test's own process; the hosts are processes of their own."""

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from dyknow import Label, Network, Policy, Sample, Sort
from dyknow.agents.effects import HostEffect
from dyknow.agents.hosts.host_desk import HostDesk
from dyknow.federation.members.clock import FederationClock
from dyknow.kpl import Hooks, Instance, parse_specification
from dyknow.proxies.hosts.listener import HostDoor
from dyknow.runtime.clock import NodeClock
from dyknow.runtime.loop import step
from dyknow.runtime.mailbox import Mailbox

PATIENCE_S = 30.0
PERIOD_US = 100_000

UNITS = """
import itertools
from dyknow import SourcePrototype, UnitPrototype, of_values

def ticking(from_us):
    for number in itertools.count(1):
        yield from_us + {period_us} * number, number

for i in range({sources}):
    globals()[f"s{{i}}"] = SourcePrototype(f"s{{i}}", "number", ticking, f"ticks[{{i}}]")
for i in range({units}):
    globals()[f"u{{i}}"] = UnitPrototype(f"u{{i}}", "number", ("number",), lambda: of_values(lambda value: -value))
"""


class Tick(NamedTuple):
    at_us: int
    number: int


class Node:
    """A network with streams of its own, ten times a second, and whatever a specification and hosts add."""

    def __init__(self, path: Path, own: int = 0, text: str = "") -> None:
        self.clock = NodeClock()
        self.mailbox = Mailbox(self.clock.now_us)
        self.network = Network()
        self.own = [Label("own", (str(i),)) for i in range(own)]
        self.samples: dict[str, list[Sample]] = {}
        self.links: dict[str, list[bool]] = {}
        self.notes: list[str] = []
        hooks = Hooks(
            self._on_output,
            lambda name, linked: self.links.setdefault(name, []).append(linked),
            on_fault=lambda label, said: self.notes.append(f"{label}: {said}"),
        )
        self.instance = Instance(self.network, hooks=hooks)
        for label in self.own:
            self.network.add_source(label, Sort("number"))
            self.network.connect(label, Policy(), lambda sample, name=str(label): self._on_output(name, sample))
        self.instance.change(parse_specification(text), self.clock.now_us(), text)
        offset_us = self.clock.monotonic_offset_us
        self.desk = HostDesk(self.instance, FederationClock(), self.notes.append, offset_us)
        self.door = HostDoor(path, self.mailbox.post, self.clock.now_us)
        self.door.open()
        self._over = threading.Event()
        self._ticker = threading.Thread(target=self._tick, daemon=True)
        self._ticker.start()

    def close(self) -> None:
        self._over.set()
        self._ticker.join()
        self.door.close()

    def until(self, done: Callable[[], bool], within_s: float = PATIENCE_S) -> None:
        """Step until so far."""
        ends_s = time.monotonic() + within_s
        while not done():
            assert time.monotonic() < ends_s, (self.notes[-5:], self.links)
            step(self, self.mailbox, self.clock.now_us, self.door.perform)

    def step_for(self, seconds: float) -> None:
        ends_s = time.monotonic() + seconds
        self.until(lambda: time.monotonic() >= ends_s)

    def connect(self, label: str) -> None:
        """A client of a stream, told whether there is one."""
        self.network.connect(
            Label.parse(label), Policy(),
            lambda sample: self._on_output(label, sample),
            lambda linked: self.links.setdefault(label, []).append(linked),
        )  # fmt: skip

    # As `dyknow.runtime.loop` steps it

    @property
    def deadline_us(self) -> int | None:
        dues = [due_us for due_us in (self.network.deadline_us, self.desk.deadline_us) if due_us is not None]
        return min(dues, default=self.clock.now_us() + PERIOD_US)

    def on_event(self, event: Any, now_us: int) -> list[HostEffect]:
        if isinstance(event, Tick):
            for label in self.own:
                self.network.push(label, Sample(now_us, event.at_us, event.number))
            for source in self.instance.sources():
                self.instance.push(source, Sample(now_us, event.at_us, event.number))
        else:
            self.desk.on_event(event, now_us)
        return self.desk.flush()

    def on_time(self, now_us: int) -> list[HostEffect]:
        self.network.on_time(now_us)
        self.desk.on_time(now_us)
        return self.desk.flush()

    def _on_output(self, name: str, sample: Sample) -> None:
        self.samples.setdefault(name, []).append(sample)

    def _tick(self) -> None:
        number = 0
        while not self._over.wait(PERIOD_US / 1e6):
            number += 1
            self.mailbox.post(Tick(self.clock.now_us(), number))
