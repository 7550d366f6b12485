"""A new user's hour: what a page prints is typed in its order, in a fresh copy of the checkout on a machine of its own.

The machine is a network namespace (`tests/netlab.py`), so that names, ports and addresses are the printed ones. Nobody types:
the time that typing takes at 40 words a minute is computed and added to what the commands took.

    python -m tests.docs.hour [PAGE...]      # walks pages and prints their times; needs root
"""

import contextlib
import itertools
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from queue import Empty, Queue
from tempfile import TemporaryDirectory
from threading import Thread
from typing import NamedTuple, Self

from tests.docs.pages import DOCS, PAGES, ROOT, Fence, alike, commands
from tests.netlab import Host, Lab, lab_of

WORD = 5
"""Strokes of a word, as typing is measured."""
STROKES_A_SECOND = 40 * WORD / 60
PATIENCE_S = 60.0
AGAIN_S = 15.0
"""How long a step may be repeated, beyond the time of typing it. The typing itself is not waited for."""
_ANY_FENCE = re.compile(r"^```(\w*)([^\n`]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_COMMAND = re.compile(r"(dyknow|make|export|python|openssl|chmod|sed|cp|echo) ")
LEFT_OUT = {
    "make test": "is what runs this",
    "python -m bench": "measures for minutes",
    "python3 -m venv /opt": "installs for the whole machine",
    "cp compose/systemd": "does as well",
}
ADDRESSES = ("192.168.1.10", "192.168.1.11")
VEHICLE = """
import signal, sys
from dyknow.sim_uavs.autopilot.server import AutopilotServer
from dyknow.sim_uavs.dynamics.settings import HomePlace, VehicleConfig
for system in map(int, sys.argv[2:]):
    home = HomePlace(55.7240, 13.4600, 20.0)
    peers = (("127.0.0.1", int(sys.argv[1])),)
    AutopilotServer(VehicleConfig(system, home, "ardupilot", peers=peers, airborne_m=40.0)).start()
signal.pause()
"""


class Step(NamedTuple):
    """A command, and how it is judged: `exact` output, lines like `wanted`, or that it ends well."""

    command: str
    wanted: tuple[str, ...]
    exact: bool
    block: int
    plain: bool

    @property
    def typing_s(self) -> float:
        typed = self.command.partition("   # ")[0].rstrip()
        return (len(typed) + 1) / STROKES_A_SECOND

    @property
    def words(self) -> list[str]:
        return shlex.split(self.command, comments=True)

    @property
    def continues(self) -> bool:
        """Whether it runs until it is interrupted."""
        words = self.words
        if words[0] != "dyknow" or {"--help", "--count", "--detach"} & {*words}:
            return False
        whole = words[1] in {"join", "host", "web", "top"} or {"--follow", "--watch", "--stay"} & {*words}
        return bool(whole) or words[1] == "up" or (words[1] == "watch" and not {"--to", "--for"} & {*words})

    @property
    def claims(self) -> set[str]:
        """What only one command can have at a time: a unit's name, an endpoint."""
        words = self.words
        if words[1:2] == ["web"]:
            return {f"{self.host} page"}
        if words[1:2] != ["join"]:
            return set()
        taken = {f"{a} {b.rpartition(':')[2]}" for a, b in itertools.pairwise(words) if a in {"--unit", "--mavlink"}}
        return {f"{self.host} {each}" for each in taken}

    @property
    def host(self) -> int:
        """On which of the two machines it is typed."""
        return f"--listen tls/{ADDRESSES[1]}" in self.command


def steps(page: Path) -> list[Step]:
    """The commands of a page in their order."""
    found: list[Step] = []
    for number, match in enumerate(_ANY_FENCE.finditer(page.read_text(encoding="utf-8"))):
        fence = Fence(match[1], match[2].strip(), match[3])
        if fence.language == "console":
            shown = ((each.command, tuple(each.output.splitlines())) for each in commands(fence))
            live = fence.about.startswith("live")
            found += [Step(command, wanted, not live, number, plain=False) for command, wanted in shown]
        elif fence.language in {"", "sh"}:
            lines = fence.text.replace("\\\n", " ").splitlines()
            typed = [line for line in lines if _COMMAND.match(line) and not re.match(r"dyknow [a-z ]+: ", line)]
            found += [Step(line, (), exact=False, block=number, plain=True) for line in typed]
    return [step for step in found if not step.command.startswith(tuple(LEFT_OUT)) and "TASK" not in step.command]


@dataclass
class Taken:
    """What a page took, in seconds."""

    page: str
    commands: int = 0
    typing_s: float = 0.0
    running_s: float = 0.0
    each: list[tuple[float, str]] = field(default_factory=list)

    def add(self, step: Step, seconds: float) -> None:
        self.commands += 1
        self.typing_s += step.typing_s
        self.running_s += seconds
        self.each.append((seconds, step.command))

    def of(self, command: str) -> float:
        """How long the commands that begin so took, without their typing."""
        return sum(seconds for seconds, typed in self.each if typed.startswith(command))

    @property
    def total_s(self) -> float:
        return self.typing_s + self.running_s

    def __str__(self) -> str:
        longest_s, command = max(self.each)
        return (
            f"{self.page}: {self.commands} commands, {self.total_s / 60:.1f} min: typing {self.typing_s / 60:.1f}, "
            f"running {self.running_s / 60:.1f}; longest {longest_s:.1f} s: {command.partition('   # ')[0]}"
        )


@dataclass
class Terminal:
    """A command that runs, and its lines as they come."""

    step: Step
    process: "subprocess.Popen[str]"
    lines: "Queue[str]" = field(default_factory=Queue)
    seen: list[str] = field(default_factory=list)
    vehicle: "subprocess.Popen[str] | None" = None

    def __post_init__(self) -> None:
        Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        for line in self.process.stdout or ():
            self.lines.put(line.rstrip())
        self.lines.put("")

    def come(self, wanted: tuple[str, ...]) -> list[str]:
        """Wait until lines like these have come, in this order; without any, for a first line. What is wrong."""
        left = [_flat([line]) for line in wanted if line.strip()] or None
        looked = 0
        until_s = time.monotonic() + PATIENCE_S
        while left is None or left:
            try:
                line = self.lines.get(timeout=max(until_s - time.monotonic(), 0.01))
            except Empty:
                return [f"{self.step.command}: no {left or 'line'} in\n" + "\n".join(self.seen)]
            self.seen.append(line)
            if not line and self.process.poll() is not None:
                return [f"{self.step.command} ended\n" + "\n".join(self.seen)]
            if left is None and line:
                return []
            if left and left[0] in _flat(self.seen[looked:]):
                looked = len(self.seen)
                left.pop(0)
        return []

    def interrupt(self) -> list[str]:
        """Ctrl-C: it ends with 130, or with 0. What is wrong."""
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGINT)
        code = self.process.wait(PATIENCE_S)
        if self.vehicle is not None:
            self.vehicle.kill()
            self.vehicle.wait()
        while not self.lines.empty():
            self.seen.append(self.lines.get())
        return [] if code in {0, 130} else [f"{self.step.command} ended with {code}\n" + "\n".join(self.seen)]


class Machine:
    """Two hosts at the addresses that the pages print, and a fresh checkout on both."""

    def __init__(self, lab: Lab, parent: Path) -> None:
        self.lab, self.running = lab, list[Terminal]()
        self.place = checkout(parent / "dyknow")
        self._run = parent / "run"
        self._run.mkdir(mode=0o700)
        self._exported: dict[str, str] = {}
        self._conversation = "cc"
        for host, address in zip(lab.hosts, ADDRESSES, strict=True):
            for words in (f"address add {address}/24 dev eth0", "link set lo multicast on"):
                subprocess.run(["ip", "-n", host.namespace, *words.split()], check=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        for terminal in self.running:
            if terminal.process.poll() is None:
                terminal.process.kill()
        for pid in self.left():
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)

    def left(self) -> list[int]:
        """The processes that run on these machines."""
        asked = [["ip", "netns", "pids", host.namespace] for host in self.lab.hosts]
        return [int(pid) for each in asked for pid in subprocess.check_output(each, text=True).split()]

    def walk(self, page: Path) -> Taken:
        """Type what the page prints; what continues is interrupted before the next command of its block, or at the end.

        Raises:
            AssertionError: a step failed, or something still runs at the end.
        """
        taken, faults = Taken(page.name), list[str]()
        for step in steps(page):
            for terminal in [*self.running]:
                same = terminal.step.plain and terminal.step.block == step.block
                if same or terminal.step.claims & step.claims:
                    faults += self._end(terminal)
            begun_s = time.monotonic()
            faults += self._take(step)
            taken.add(step, time.monotonic() - begun_s)
        for terminal in [*self.running]:
            faults += self._end(terminal)
        for name in sorted(path.name for path in (self._run / "dyknow").glob("*")):
            self._start(Step(f"dyknow down --federation {name}", (), False, -1, True)).process.wait(PATIENCE_S)
        until_s = time.monotonic() + PATIENCE_S
        while self.left() and time.monotonic() < until_s:
            time.sleep(0.1)
        faults += [f"processes are left: {left}"] if (left := self.left()) else []
        assert not faults, f"{page.name}:\n\n" + "\n\n".join(faults)
        return taken

    def _end(self, terminal: Terminal) -> list[str]:
        self.running.remove(terminal)
        return terminal.interrupt()

    def _take(self, step: Step) -> list[str]:
        if step.command.startswith("export "):
            name, _, value = step.words[1].partition("=")
            known = {**self._environment(), "PWD": str(self.place)}
            self._exported[name] = re.sub(r"\$(\w+)", lambda each: known.get(each[1], ""), value)
            return []
        if step.continues:
            terminal = self._start(step)
            self.running.append(terminal)
            return terminal.come(step.wanted)
        until_s = time.monotonic() + step.typing_s + AGAIN_S
        while (fault := self._once(step)) and not step.exact and time.monotonic() < until_s:
            pass
        return [fault] if fault else []

    def _once(self, step: Step) -> str:
        """Run a command that ends; what is wrong with it, or nothing. What is not there yet is asked for again."""
        terminal = self._start(step)
        try:
            code = terminal.process.wait(PATIENCE_S * 2)
        except subprocess.TimeoutExpired:
            code = -1
        if terminal.vehicle is not None:
            terminal.vehicle.kill()
        while (line := terminal.lines.get(timeout=PATIENCE_S)) or not terminal.lines.empty():
            terminal.seen.append(line)
        said = "\n".join(terminal.seen)
        if made := re.search(r"\bcc-\d+", said):
            self._conversation = made[0]
        if step.exact:
            wanted = "\n".join(step.wanted)
            return "" if said.strip() == wanted.strip() else f"{step.command}\n{said}\ninstead of\n{wanted}"
        seen = _flat(terminal.seen)
        lacking = [line for line in step.wanted if any(_flat([part]) not in seen for part in line.split("..."))]
        return "" if code == 0 and not lacking else f"{step.command} ended with {code}, lacks {lacking}\n{said}"

    def _start(self, step: Step) -> Terminal:
        host = self.lab.hosts[step.host]
        command = re.sub(r"\bcc-\d+", self._conversation, step.command)
        command = f"exec {command}" if step.continues else command
        vehicle = self._vehicle(step, host)
        started = host.start(
            ["/bin/sh", "-c", command], cwd=self.place, env=self._environment(), text=True, start_new_session=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, preexec_fn=_as_in_a_terminal,
        )  # fmt: skip
        return Terminal(step, started, vehicle=vehicle)

    def _vehicle(self, step: Step, host: Host) -> "subprocess.Popen[str] | None":
        """What sends MAVLink where the command waits for it."""
        port = re.search(r"--mavlink udpin:[\d.]+:(\d+)", step.command)
        if port is None:
            return None
        systems = [b for a, b in zip(step.words, step.words[1:], strict=False) if a == "--sysid"] or ["1"]
        return host.start([sys.executable, "-c", VEHICLE, port[1], *systems], env=self._environment(), text=True)

    def _environment(self) -> dict[str, str]:
        kept = {name: value for name, value in os.environ.items() if not name.startswith("DYKNOW_")}
        path = f"{self.place / '.venv' / 'bin'}{os.pathsep}{kept.get('PATH', '')}"
        own = {"PATH": path, "PYTHONPATH": str(self.place), "COLUMNS": "80", "TERM": "dumb"}
        return {**kept, **own, "XDG_RUNTIME_DIR": str(self._run), **self._exported}


def _flat(lines: Sequence[str]) -> str:
    """Lines as one, without their numbers: a narrow terminal folds where the page's did not, and rules are as wide as tables."""
    return re.sub("─+", "─", alike(" ".join(lines)))


def _as_in_a_terminal() -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def checkout(place: Path) -> Path:
    """A copy of what a clone holds, with the environment that `make` would set up in it."""
    listed = ["git", "-C", str(ROOT), "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    for name in subprocess.check_output(listed, text=True).split("\0"):
        if name and (ROOT / name).is_file() and not name.startswith(("tests/", "bench/results/")):
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, place / name)
    (place / ".venv").symlink_to(sys.prefix)
    ready = Path(sys.prefix, ".ready")
    if ready.exists():  # what is set up is not older than what it is set up from
        os.utime(place / "pyproject.toml", (ready.stat().st_mtime - 1,) * 2)
    return place


@contextlib.contextmanager
def machine() -> Iterator[Machine]:
    with TemporaryDirectory() as parent, lab_of(2) as lab, Machine(lab, Path(parent)) as found:
        yield found


if __name__ == "__main__":
    for each in [DOCS / name for name in sys.argv[1:]] or [ROOT / "README.md", *PAGES]:
        if steps(each):
            with machine() as found:
                print(found.walk(each.resolve()), flush=True)
