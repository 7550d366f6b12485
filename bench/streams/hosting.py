"""An instance with a chain of three units, here or at a host, and the host's process: `python -m bench.streams.hosting SOCKET ...`."""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil

from bench.wire.raw import PATIENCE_S, latencies
from dyknow import Network, Sample, UnitPrototype, of_values
from dyknow.agents.effects import HostEffect
from dyknow.agents.hosts.host_desk import HostDesk
from dyknow.agents.hosts.knowledge_host import KnowledgeHost
from dyknow.federation.hosts.messages import WINDOW
from dyknow.federation.members.clock import FederationClock
from dyknow.kpl import Hooks, Instance, parse_specification
from dyknow.proxies.hosts.listener import HostDoor
from dyknow.runtime.clock import NodeClock
from dyknow.runtime.hosts.host_process import HostProcess
from dyknow.runtime.loop import step
from dyknow.runtime.mailbox import Mailbox

CHAIN = ("smooth", "scale", "offset")
SPEC = "source number raw\nstrmgen raw = raw\n" + "".join(
    f"compunit number {unit}(number)\nstrmgen {unit}_ = {unit}({before})\n"
    for unit, before in zip(CHAIN, ("raw", *(f"{unit}_" for unit in CHAIN)), strict=False)
)
FUNCTIONS = (lambda value: 0.9 * value, lambda value: 2.0 * value, lambda value: value + 1.0)
PROTOTYPES = [
    UnitPrototype(name, "number", ("number",), lambda function=function: of_values(function))
    for name, function in zip(CHAIN, FUNCTIONS, strict=True)
]


class Site:
    """A node that pushes samples into the chain and takes them at its end, in the caller's thread."""

    def __init__(self, path: Path) -> None:
        self.clock = NodeClock()
        self.mailbox = Mailbox(self.clock.now_us)
        self.instance = Instance(Network(), hooks=Hooks(on_output=self._on_output))
        text = f"{SPEC}stream out = {CHAIN[-1]}_\n"
        self.instance.change(parse_specification(text), self.clock.now_us(), text)
        self.desk = HostDesk(self.instance, FederationClock(), lambda _said: None, self.clock.monotonic_offset_us)
        self.door = HostDoor(path, self.mailbox.post, self.clock.now_us)
        self._pushed_ns: list[int] = []
        self.took_ns: list[int] = []

    def push(self) -> None:
        """One sample enters the chain."""
        now_us = self.clock.now_us()
        self._pushed_ns.append(time.monotonic_ns())
        self.instance.push("raw", Sample(now_us, now_us, 1.0))
        self._perform(self.desk.flush())

    def until(self, done: Any, deadline_us: int | None = None) -> None:
        """Step until `done`, and at the latest until `deadline_us`."""
        self._deadline_us = deadline_us
        ends_s = time.monotonic() + PATIENCE_S
        while not done():
            if time.monotonic() > ends_s:
                raise TimeoutError(f"{len(self.took_ns)} of {len(self._pushed_ns)} came through")
            step(self, self.mailbox, self.clock.now_us, self.door.perform)

    def clear(self) -> None:
        self._pushed_ns.clear()
        self.took_ns.clear()

    @property
    def under_way(self) -> int:
        return len(self._pushed_ns) - len(self.took_ns)

    @property
    def deadline_us(self) -> int:
        now_us = self.clock.now_us()
        return min(now_us + 100_000, self.desk.deadline_us or now_us + 100_000, self._deadline_us or now_us + 100_000)

    def on_event(self, event: Any, now_us: int) -> list[HostEffect]:
        self.desk.on_event(event, now_us)
        return self.desk.flush()

    def on_time(self, now_us: int) -> list[HostEffect]:
        self.desk.on_time(now_us)
        return self.desk.flush()

    def _on_output(self, _name: str, _sample: Sample) -> None:
        self.took_ns.append(time.monotonic_ns() - self._pushed_ns[len(self.took_ns)])

    def _perform(self, effects: list[HostEffect]) -> None:
        for effect in effects:
            self.door.perform(effect)


@contextmanager
def site(*options: str, hosted: bool = True) -> Iterator["Measured"]:
    """A node, and a host with these options beside it, or the units in the node itself."""
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "hosts"
        node = Site(path)
        if not hosted:
            node.instance.offer(PROTOTYPES, node.clock.now_us())
            yield Measured(node, None)
            return
        node.door.open()
        host = subprocess.Popen([sys.executable, "-m", "bench.streams.hosting", str(path), *options])
        try:
            node.until(lambda: not node.instance.lacking)
            yield Measured(node, psutil.Process(host.pid))
        finally:
            node.door.close()
            host.terminate()
            host.wait()


class Measured:
    """What one site is asked."""

    def __init__(self, node: Site, host: psutil.Process | None) -> None:
        self._node, self._processes = node, [psutil.Process(), *([] if host is None else [host])]

    def paced(self, count: int, period_us: int) -> dict[str, float]:
        """How long one sample takes, when there is little to do."""
        node = self._node
        node.clear()
        at_us = node.clock.now_us()
        for _ in range(count):
            at_us += period_us
            node.until(lambda at_us=at_us: node.clock.now_us() >= at_us, at_us)
            node.push()
        node.until(lambda: not node.under_way)
        return latencies(node.took_ns)

    def flooded(self, count: int) -> dict[str, float]:
        """How many samples a second, and how much of both processes' time each of them takes."""
        node = self._node
        node.clear()
        began, busy = time.monotonic(), self._busy_s()
        for _ in range(count):
            node.push()
            if node.under_way >= WINDOW:
                node.until(lambda: node.under_way < WINDOW // 2)
        node.until(lambda: not node.under_way)
        return {
            "rate_per_s": count / (time.monotonic() - began),
            "cpu_us": (self._busy_s() - busy) / count * 1e6,
        }

    def _busy_s(self) -> float:
        return sum(sum(each.cpu_times()[:2]) for each in self._processes)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("path", type=Path)
    parser.add_argument("--batch", type=int, default=1)
    parser.add_argument("--train", action="store_true")
    chosen = parser.parse_args()
    host = KnowledgeHost(PROTOTYPES, os.getpid(), "bench", batch=chosen.batch, train=chosen.train)
    HostProcess(host, chosen.path, lambda _said: None).run()


if __name__ == "__main__":
    main()
