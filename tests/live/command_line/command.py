"""The command `dyknow` in processes of its own, in a federation and a run directory that nobody else uses."""

import contextlib
import json
import os
import queue
import secrets
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil

from dyknow.runtime.configuration.run_directory import STATE_FILE
from tests import command

PATIENCE_S = 100.0
RUN = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); from dyknow.console.main import main; main()"
"""As a terminal starts it: what runs in the background of a shell ignores Ctrl-C, and so would its children."""


def free_tcp_ports(count: int) -> int:
    """The first of adjacent ports to listen on, each free and below those that systems give to outgoing connections.

    One of those may be the near end of a link by the time that a slow process listens there.
    """
    while True:
        first = 10_000 + secrets.randbelow(10_000 - count)
        with contextlib.ExitStack() as held, contextlib.suppress(OSError):
            for port in range(first, first + count):
                held.enter_context(socket.socket()).bind(("127.0.0.1", port))
            return first


@dataclass
class Dyknow:
    """Runs commands; `close` ends whatever of them is left, by id."""

    directory: Path
    federation: str = field(default_factory=lambda: f"cli-{secrets.token_hex(4)}")
    options: tuple[str, ...] = ()
    started: list["subprocess.Popen[str]"] = field(default_factory=list)

    def start(self, *arguments: str) -> "subprocess.Popen[str]":
        started = subprocess.Popen(
            [sys.executable, "-c", RUN, *self._words(arguments)],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=self._environment(),
        )  # fmt: skip
        self.started.append(started)
        return started

    def _words(self, arguments: tuple[str, ...]) -> list[str]:
        """Options before the command's own arguments: what looks like a negative number is a time."""
        words = 2 if arguments[0] in {"kpl", "mission", "ontology", "roster"} else 1
        return [*arguments[:words], "--federation", self.federation, *self.options, *arguments[words:]]

    def _environment(self) -> dict[str, str]:
        kept = {name: value for name, value in os.environ.items() if not name.startswith("DYKNOW_")}
        return {**kept, "XDG_RUNTIME_DIR": str(self.directory), "COLUMNS": "80"}

    def run(self, *arguments: str, code: int | None = 0) -> list[dict[str, Any]]:
        """The JSON lines of a command that must end with `code`; None: with any."""
        out, err = self.raw(*arguments, "--json", code=code)
        del err
        return [json.loads(line) for line in out.splitlines()]

    def raw(self, *arguments: str, code: int | None = 0) -> tuple[str, str]:
        done = command.run(self._words(arguments), self._environment())
        assert code in {None, done.returncode}, f"dyknow {' '.join(arguments)} ended with {done.returncode}\n{done}"
        return done.stdout, done.stderr

    def until(self, *arguments: str, within_s: float = 20.0, **wanted: Any) -> list[dict[str, Any]]:
        """Ask again until every line has what is wanted; the command itself paces the asking."""
        until = time.monotonic() + within_s
        while True:
            done = command.run(self._words((*arguments, "--json")), self._environment())
            found = [json.loads(line) for line in done.stdout.splitlines()]
            if found and all(line.get(name) == value for line in found for name, value in wanted.items()):
                return found
            assert time.monotonic() < until, f"dyknow {' '.join(arguments)} still says {found}"

    def close(self) -> None:
        if (self.directory / "dyknow" / self.federation / STATE_FILE).exists():
            self.start("down").wait(timeout=PATIENCE_S)
        for started in self.started:
            if started.poll() is None:
                started.terminate()
                started.wait(timeout=PATIENCE_S)
            for pipe in (started.stdout, started.stderr):
                if pipe is not None:
                    pipe.close()


def lines(started: "subprocess.Popen[str]") -> Iterator[dict[str, Any]]:
    """The JSON lines of a running command, as they come."""
    assert started.stdout is not None
    for line in started.stdout:
        yield json.loads(line)


class Follower:
    """`dyknow alarms --follow`, and when each of its lines came."""

    def __init__(self, dyknow: Dyknow) -> None:
        self._lines: queue.Queue[tuple[float, dict[str, Any]]] = queue.Queue()
        self.process = dyknow.start("alarms", "--follow", "--json")
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        for line in lines(self.process):
            self._lines.put((time.monotonic(), line))

    def until(self, since_s: float, **wanted: Any) -> float:
        """How long after `since_s` the first line came that says this."""
        return self.line(since_s, **wanted)[0] - since_s

    def hears(self, within_s: float, **wanted: Any) -> bool:
        """Whether a line that says this comes in time."""
        until = time.monotonic() + within_s
        while (left_s := until - time.monotonic()) > 0:
            try:
                _, line = self._lines.get(timeout=left_s)
            except queue.Empty:
                return False
            if all(line.get(name) == value for name, value in wanted.items()):
                return True
        return False

    def line(self, since_s: float, **wanted: Any) -> tuple[float, dict[str, Any]]:
        """The first line from `since_s` on that says this, and when it came."""
        while True:
            at_s, line = self._lines.get(timeout=PATIENCE_S)
            if at_s >= since_s and all(line.get(name) == value for name, value in wanted.items()):
                return at_s, line


def gone(pids: list[int], within_s: float = 15.0) -> bool:
    """Whether none of these processes is there any more, at the latest after that long."""
    left = []
    for pid in pids:
        try:
            left.append(psutil.Process(pid))
        except psutil.NoSuchProcess:
            continue
    _ended, alive = psutil.wait_procs(left, timeout=within_s)
    return not alive
