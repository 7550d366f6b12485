"""The platform processes that `dyknow up` starts: started, followed until they are ready, and ended by their id.

The run directory of the federation has in `state.json` the processes that run, and in `units/`, where no name of a unit
meets another file, the configuration of each platform, its events (`.out`, JSON lines) and its log (`.log`).
"""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

import psutil

from dyknow.console.errors import WRONG
from dyknow.console.output.output import Output
from dyknow.model.errors import FederationFailed, WrongCall
from dyknow.runtime.configuration.run_directory import Running

VEHICLES = "dyknow.sim_uavs.simulated"
"""The module that registers simulated vehicles with a platform process."""
GRACE_S = 5.0
_POLL_S = 0.02


def end(running: Iterable[Running], grace_s: float = GRACE_S) -> None:
    """End these processes and wait until they are gone: politely first, after `grace_s` not."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        running = [
            found for found in running if (process := found.process()) is not None and _signalled(process, number)
        ]
        until = time.monotonic() + grace_s
        # A process that has ended but that its parent has not asked about is gone, too: so not psutil's waiting.
        while any(found.process() is not None for found in running) and time.monotonic() < until:
            time.sleep(_POLL_S)


def _signalled(process: psutil.Process, number: signal.Signals) -> bool:
    """Send a signal that also reaches a stopped process; False if it is gone."""
    try:
        process.send_signal(number)
        if process.status() == psutil.STATUS_STOPPED:
            process.send_signal(signal.SIGCONT)
    except psutil.NoSuchProcess:
        return False
    return True


class Fleet:
    """Platform processes of one federation, children of this process."""

    def __init__(self, directory: Path, *, lifeline: bool) -> None:
        """With `lifeline` a platform's standard input stays open until this process ends, however it ends."""
        directory.mkdir(mode=0o700, parents=True, exist_ok=True)
        self.directory, self._units, self._lifeline = directory, directory / "units", lifeline
        self._units.mkdir(mode=0o700, exist_ok=True)
        self._children: dict[str, subprocess.Popen[bytes]] = {}
        self._heard: dict[str, tuple[int, int]] = {}
        self._first: dict[str, str] = {}
        self.running: dict[str, Running] = {}

    def start(self, unit: str, configuration: str, module: str = "dyknow.runtime.node") -> None:
        """Start the platform `unit` with its configuration, a JSON text."""
        self.start_together({unit: configuration}, module)

    def start_together(self, configurations: Mapping[str, str], module: str = "dyknow.runtime.node") -> None:
        """Start platforms, by name, in one process; its events and its log are those of the first."""
        first = next(iter(configurations))
        out = self._units / f"{first}.out"
        for records in (out, _before(out)):
            records.unlink(missing_ok=True)
        words = [sys.executable, "-m", module, "--vehicles", VEHICLES]
        for unit, configuration in configurations.items():
            config = self._units / f"{unit}.json"
            config.write_text(configuration, encoding="utf-8")
            words += ["--config", str(config)]
        with (self._units / f"{first}.log").open("wb") as log:
            child = subprocess.Popen(  # noqa: S603 - our own module, our own interpreter
                [*words, "--records", str(out)],
                stdin=subprocess.PIPE if self._lifeline else subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )
        self._heard[first] = (0, 0)
        for unit in configurations:
            self._children[unit], self._first[unit] = child, first
            self.running[unit] = Running(unit, child.pid, psutil.Process(child.pid).create_time())

    def heard(self) -> Iterator[tuple[str, dict[str, Any]]]:
        """Events of the platforms since the last call: whole JSON lines, also across a file that was begun again."""
        for unit in self._heard:
            for line in self._lines(unit):
                try:
                    said = json.loads(line)
                except ValueError:
                    continue
                if isinstance(said, dict):
                    yield str(said.get("unit", unit)), said

    def _lines(self, unit: str) -> Iterator[bytes]:
        inode, at = self._heard[unit]
        path = self._units / f"{unit}.out"
        for part in (_before(path), path):
            try:
                with part.open("rb") as out:
                    found = os.fstat(out.fileno()).st_ino
                    if part is not path and found != inode:
                        continue  # read before
                    out.seek(at if found == inode else 0)
                    whole, newline, _torn = out.read().rpartition(b"\n")
            except FileNotFoundError:
                continue
            at = (at if found == inode else 0) + len(whole) + len(newline)
            inode, self._heard[unit] = found, (found, at)
            yield from whole.splitlines()

    def ended(self) -> dict[str, int]:
        """The platforms that have ended, with their exit codes (negative: the signal that ended them)."""
        return {unit: code for unit, child in self._children.items() if (code := child.poll()) is not None}

    def wait(self, on_ended: Callable[[str, int], None] = lambda _unit, _code: None) -> dict[str, int]:
        """Wait until all have ended, reporting each as it does; their exit codes."""
        told: set[str] = set()
        while True:
            ended = self.ended()
            for unit in ended.keys() - told:
                told.add(unit)
                on_ended(unit, ended[unit])
            if len(ended) == len(self._children):
                return ended
            time.sleep(10 * _POLL_S)

    def follow(
        self, done: Callable[[], bool], on_heard: Callable[[str, dict[str, Any]], None], timeout_s: float
    ) -> bool:
        """Hear the platforms until `done` or the time is over; True if done.

        Raises:
            FederationFailed, WrongCall: if one ends meanwhile, the latter if its configuration is wrong; its
                last words are in the message.
        """
        until = time.monotonic() + timeout_s
        while True:
            for unit, said in self.heard():
                on_heard(unit, said)
            if done():
                return True
            for unit, code in self.ended().items():
                raise (WrongCall if code == WRONG else FederationFailed)(
                    f"platform {unit} ended with code {code} before it was ready.\n{self.last_words(unit)}"
                )
            if time.monotonic() > until:
                return False
            time.sleep(_POLL_S)

    def last_words(self, unit: str, lines: int = 8) -> str:
        """The end of a platform's log, and where the whole of it is."""
        log = self._units / f"{self._first.get(unit, unit)}.log"
        said = log.read_text(encoding="utf-8", errors="replace").splitlines()[-lines:] if log.exists() else []
        return "\n".join([*(f"    {line}" for line in said), f"the whole log: {log}"])

    def end(self) -> None:
        """End all and wait until they are gone."""
        end(self.running.values())
        for child in self._children.values():
            if child.stdin is not None:
                child.stdin.close()
            child.wait(timeout=GRACE_S)


def _before(records: Path) -> Path:
    """The part of a file of records before the one that is written."""
    return records.with_name(f"{records.name}.1")


@contextmanager
def _handled(handler: Any, *numbers: signal.Signals) -> Iterator[None]:
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, former in before.items():
            signal.signal(number, former)


def interruptible() -> AbstractContextManager[None]:
    """SIGTERM and SIGHUP interrupt as SIGINT does, so that what was started is ended in every case.

    Once the platforms are ready a closed terminal no longer ends them: see `outlasting`.
    """

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    return _handled(interrupt, signal.SIGTERM, signal.SIGHUP)


def outlasting(output: Output) -> None:
    """From now on nothing that happens to the terminal ends the platforms: SIGINT and SIGTERM do, and `dyknow down`."""
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    output.outlast()


def uninterrupted() -> AbstractContextManager[None]:
    """While processes are being ended a second SIGINT must not leave half of them running."""
    return _handled(signal.SIG_IGN, signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
