"""Platform processes as `dyknow up` starts them, what they say, and an observer who asks them."""

import json
import os
import secrets
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, Self

from dyknow.federation.messages.contents import Content, ImportCounts, ImportList, MonitorEntry, MonitorList, read
from dyknow.runtime.clock import NodeClock
from tests.federation.expressions import parse_expr

PATIENCE_S = 60.0
PACE_S = 0.25
SCENARIO = "hover"
_CLI = "from dyknow.console.main import main; main()"


class Heard(NamedTuple):
    """What came of one question to one platform. `us` is how long it took."""

    unit: str
    contents: list[Content]
    trouble: str | None
    us: int
    conversation: str


class Process:
    """A process that says JSON lines; `changed` is notified of each."""

    def __init__(self, argv: Sequence[str], changed: threading.Condition, log: Path) -> None:
        self._changed, self._log = changed, log
        self.lines: list[dict[str, Any]] = []
        with log.open("w") as errors:
            self.popen = subprocess.Popen(
                [*argv], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, text=True
            )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.popen.stdout is not None
        for line in self.popen.stdout:
            if not line.startswith("{"):
                with self._log.open("a") as log:
                    log.write(line)
                continue
            with self._changed:
                self.lines.append(json.loads(line))
                self._changed.notify_all()

    def write(self, command: dict[str, Any]) -> None:
        assert self.popen.stdin is not None
        self.popen.stdin.write(json.dumps(command) + "\n")
        self.popen.stdin.flush()

    def signal(self, number: signal.Signals) -> None:
        self.popen.send_signal(number)

    def end(self) -> None:
        """Let it go; one that stands still, or does not go, is killed."""
        if self.popen.poll() is None:
            self.signal(signal.SIGCONT)
            self.signal(signal.SIGTERM)
        try:
            self.popen.wait(10.0)
        except subprocess.TimeoutExpired:
            self.popen.kill()
            self.popen.wait()
        self._reader.join(5.0)
        for stream in (self.popen.stdin, self.popen.stdout):
            if stream is not None:
                stream.close()


class Node(Process):
    """One platform."""

    def __init__(self, unit: str, argv: Sequence[str], changed: threading.Condition, log: Path) -> None:
        super().__init__(argv, changed, log)
        self.unit = unit

    @property
    def found(self) -> set[str]:
        """Whom it has found, itself included."""
        told = [line["units"] for line in self.lines if line["event"] == "directory"]
        return set(told[-1]) if told else set()

    @property
    def joined_us(self) -> int | None:
        return next((line["at_us"] for line in self.lines if line["event"] == "joined"), None)

    def found_us(self, units: Iterable[str], since_us: int) -> int | None:
        """When, after `since_us`, it had found exactly these."""
        wanted = set(units)
        for line in self.lines:
            if line["event"] == "directory" and line["at_us"] >= since_us and set(line["units"]) == wanted:
                return int(line["at_us"])
        return None


class Place(NamedTuple):
    """Where a process runs and how it is reached; no endpoints: multicast on loopback."""

    prefix: tuple[str, ...] = ()
    listen: tuple[str, ...] = ()
    connect: tuple[str, ...] = ()


HERE = Place()


class Fleet:
    """A federation of its own name: platforms, observers, and their ends.

    Args:
        directory: for configurations and what processes say on standard error.
        count: how many vehicles the scenario has.
        places: where each unit and observer runs, by name.
    """

    def __init__(self, directory: Path, count: int, places: Callable[[str], Place] = lambda _name: HERE) -> None:
        self.name = f"live-{secrets.token_hex(4)}"
        self.nodes: dict[str, Node] = {}
        self.changed = threading.Condition()
        self.now_us = NodeClock().now_us
        self._directory, self._count, self._places = directory, count, places
        self._observers: dict[str, Process] = {}
        self._numbers = 0
        self.troubles: dict[str, str] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for process in [*self._observers.values(), *self.nodes.values()]:
            process.end()

    # Who takes part

    def start(self, *units: str, **config: Any) -> None:
        for unit in units:
            place = self._places(unit)
            vehicle = {"kind": "simulated", "scenario": SCENARIO, "index": int(unit), "count": self._count}
            wire = {"federation": self.name, "listen": place.listen, "connect": place.connect}
            wire["open"] = bool(place.listen)  # a laboratory of namespaces is no machine that strangers reach
            path = self._directory / f"{unit}.json"
            found = {"unit": unit, "wire": wire, "vehicle": vehicle, "shedding": False, **config}  # samples are counted
            path.write_text(json.dumps(found))
            argv = [
                *place.prefix,
                sys.executable,
                "-m",
                "dyknow.runtime.node",
                "--vehicles",
                "dyknow.sim_uavs.simulated",
                "--config",
                str(path),
            ]
            self.nodes[unit] = Node(unit, argv, self.changed, self._directory / f"{unit}.err")

    def others(self, *units: str) -> list[Node]:
        return [node for unit, node in self.nodes.items() if unit not in units]

    def kill(self, unit: str) -> int:
        """As a crash; returns when."""
        at_us = self.now_us()
        self.nodes[unit].signal(signal.SIGKILL)
        return at_us

    def freeze(self, unit: str) -> int:
        at_us = self.now_us()
        self.nodes[unit].signal(signal.SIGSTOP)
        return at_us

    def thaw(self, unit: str) -> int:
        at_us = self.now_us()
        self.nodes[unit].signal(signal.SIGCONT)
        return at_us

    def notes(self, since_us: int = 0) -> list[str]:
        """What platforms noted."""
        said = [line for node in self.nodes.values() for line in node.lines if line["event"] == "note"]
        said.sort(key=lambda line: line["at_us"])
        return [f"{(line['at_us'] - since_us) / 1e6:.1f} s {line['unit']}: {line['text']}" for line in said]

    def failed(self) -> str:
        """What those platforms said last that ended although nobody ended them."""
        ended = [node for node in self.nodes.values() if node.popen.poll() not in {None, -signal.SIGKILL}]
        return "\n".join(f"{node.unit}: {(self._directory / f'{node.unit}.err').read_text()[-2000:]}" for node in ended)

    @contextmanager
    def frozen(self, unit: str) -> Iterator[int]:
        """A platform stands still meanwhile; since when."""
        at_us = self.freeze(unit)
        try:
            yield at_us
        finally:
            self.thaw(unit)

    # Waiting

    def wait(self, condition: Callable[[], bool], timeout_s: float = PATIENCE_S) -> bool:
        """Wait until something that a process said makes `condition` true."""
        with self.changed:
            if self.changed.wait_for(condition, timeout_s):
                return True
        failed = self.failed()
        assert not failed, failed
        return False

    def pause(self, seconds: float = PACE_S) -> None:
        """Let time pass: a fault lasts, or a question is asked again."""
        self.wait(lambda: False, max(0.0, seconds))

    def seen_after(self, nodes: Iterable[Node], units: Iterable[str], since_us: int, within_s: float) -> dict[str, int]:
        """How many us after `since_us` each of `nodes` had found exactly `units`; waits `within_s` at most."""
        nodes, wanted = list(nodes), set(units)
        self.wait(lambda: all(node.found_us(wanted, since_us) is not None for node in nodes), within_s)
        found = {node.unit: node.found_us(wanted, since_us) for node in nodes}
        late = {node.unit: sorted(node.found) for node in nodes if found[node.unit] is None}
        assert not late, f"{sorted(wanted)} was not found within {within_s} s; instead {late}"
        return {unit: at_us - since_us for unit, at_us in found.items() if at_us is not None}

    def complete(self, timeout_s: float = PATIENCE_S) -> None:
        """Wait until everybody has found everybody."""
        units = set(self.nodes)
        if not self.wait(lambda: all(node.found == units for node in self.nodes.values()), timeout_s):
            raise AssertionError(f"not everybody was found: { {u: sorted(n.found) for u, n in self.nodes.items()} }")

    # Asking

    def observer(self, name: str = "cc-1") -> Process:
        found = self._observers.get(name)
        if found is None:
            place = self._places(name)
            given = {"federation": self.name, "unit": name, "listen": place.listen, "connect": place.connect}
            argv = [*place.prefix, sys.executable, "-m", "tests.live.network.observer", json.dumps(given)]
            found = self._observers[name] = Process(argv, self.changed, self._directory / f"{name}.err")
        return found

    def platforms(self, by: str = "cc-1") -> dict[str, str]:
        """Whom an observer sees, and in which state."""
        told = [line["units"] for line in self.observer(by).lines if line.get("event") == "platforms"]
        return dict(told[-1]) if told else {}

    def observed(self, units: Iterable[str], by: str = "cc-1") -> None:
        """Wait until an observer sees exactly these, all alive."""
        wanted = dict.fromkeys(units, "alive")
        self.observer(by)
        assert self.wait(lambda: self.platforms(by) == wanted), f"{by} sees {self.platforms(by)}, not {sorted(wanted)}"

    def ask(
        self,
        units: Iterable[str],
        say: str,
        performative: str = "query-ref",
        *,
        within_s: float = 2.0,
        lasting: bool = False,
        by: str = "cc-1",
    ) -> Iterator[Heard]:
        """Ask platforms; what each said, in the order in which they were done."""
        command = {"say": say, "performative": performative, "within_s": within_s, "lasting": lasting}
        yield from self._commanded(by, [*units], command)

    def cancel(self, unit: str, conversation: str, by: str = "cc-1") -> Heard:
        return next(self._commanded(by, [unit], {"cancel": conversation}))

    def _commanded(self, by: str, units: list[str], command: dict[str, Any]) -> Iterator[Heard]:
        observer = self.observer(by)
        self._numbers += 1
        number, began_us = self._numbers, self.now_us()
        observer.write({"id": number, "units": units, **command})
        told = 0
        while told < len(units):

            def answers() -> list[dict[str, Any]]:
                return [line for line in observer.lines if line.get("id") == number]

            assert self.wait(lambda: len(answers()) > told, PATIENCE_S), f"{by} does not answer"  # noqa: B023
            for line in answers()[told:]:
                told += 1
                contents = [
                    read(parse_expr(text)) for said, text in line["said"] if said == "inform" and text != "None"
                ]
                yield Heard(line["unit"], contents, line["trouble"], line["at_us"] - began_us, line["conversation"])

    def monitors(self, units: Iterable[str], by: str = "cc-1") -> list[MonitorEntry]:
        """Every monitor of these platforms, as far as they answer; `troubles` is why others do not."""
        heards = list(self.ask(units, "(monitors)", by=by))
        self.troubles = {heard.unit: heard.trouble for heard in heards if heard.trouble is not None}
        lists = [said for heard in heards for said in heard.contents]
        return [monitor for said in lists if isinstance(said, MonitorList) for monitor in said.monitors]

    def monitors_until(
        self, units: Sequence[str], condition: Callable[[list[MonitorEntry]], bool], timeout_s: float, by: str = "cc-1"
    ) -> list[MonitorEntry]:
        """Ask for the monitors four times a second until they are as they should be."""
        until_us = self.now_us() + round(timeout_s * 1e6)
        while True:
            found = self.monitors(units, by)
            if condition(found):
                return found
            if self.now_us() >= until_us:
                said = [f"{one.by} {one.name} {one.units} {one.inputs} {one.shows} {one.which}" for one in found]
                said = ["the monitors are not as they should be", *said, str(self.troubles), *self.notes(until_us)]
                raise AssertionError("\n".join([*said, *self.known(units, by)]))
            self.pause()

    def known(self, units: Sequence[str], by: str = "cc-1") -> list[str]:
        """What these platforms know: whom they find, what they import, which acts passed; for when a test fails."""
        says = ["(search service: dyknow-federation)", "(import-list)", "(tasks)"]
        heard = [(say, one) for say in says for one in self.ask(units, say, by=by)]
        said = [f"{one.unit} {say}: {one.trouble or [str(c.expr()) for c in one.contents]}" for say, one in heard]
        acts = sorted(self.dyknow("acts"), key=lambda line: int(line.get("at_us", 0)))
        acts = [act for act in acts if str(act.get("peer")) in self.nodes][-400:]
        return [*said, f"the directory: {self.dyknow('ls')}", *map(str, acts)]

    def imports(self, units: Iterable[str], by: str = "cc-1") -> dict[tuple[str, str, str], ImportCounts]:
        """What became of the samples of each stream, by (receiver, owner, label)."""
        return {
            (heard.unit, one.owner, one.semantic_label): one
            for heard in self.ask(units, "(import-list)", by=by)
            for said in heard.contents
            if isinstance(said, ImportList)
            for one in said.imports or ()
        }

    def dyknow(self, *arguments: str, at: str = "cc-9", timeout_s: float = 60.0) -> list[dict[str, Any]]:
        """Run the command; its JSON lines."""
        place = self._places(at)
        reach = [word for endpoint in place.connect for word in ("--connect", endpoint)]
        reach += [word for endpoint in place.listen for word in ("--listen", endpoint)]
        kept = {name: value for name, value in os.environ.items() if not name.startswith("DYKNOW_")}
        argv = [*place.prefix, sys.executable, "-c", _CLI, *arguments, "--json", "--federation", self.name, *reach]
        done = subprocess.run(argv, capture_output=True, text=True, env=kept, timeout=timeout_s, check=False)
        assert done.returncode in {0, 1}, f"dyknow {' '.join(arguments)} ended with {done.returncode}: {done.stderr}"
        return [json.loads(line) for line in done.stdout.splitlines()]

    def ls(self, at: str = "cc-9") -> dict[str, str]:
        """`dyknow ls`: state by unit."""
        return {str(line["unit"]): line["state"] for line in self.dyknow("ls", at=at)}


def report(what: str, **figures: Any) -> None:
    """Print a measurement; shown with -rP, and when a test fails."""
    said = ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in figures.items())
    sys.stdout.write(f"measured: {what}: {said} (load {os.getloadavg()[0]:.1f}, {time.strftime('%H:%M:%S')})\n")


def ms(durations_us: Iterable[int]) -> str:
    """Durations for people: least to greatest."""
    found = sorted(durations_us)
    return f"{found[0] / 1e3:.0f}..{found[-1] / 1e3:.0f} ms"
