"""The run directory of a federation on this machine: its processes here, and their endpoints.

It is `$XDG_RUNTIME_DIR/dyknow/<federation>` or `~/.cache/dyknow/<federation>`; `dyknow up` writes `state.json` there, and
each `dyknow join` a file of the same form in `joined/`. A
process is known by its id together with its start time: ids are used again.
"""

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from psutil import Process

STATE_FILE = "state.json"
HANDLINGS_FILE = "boxes.jsonl"
"""The handlings of boxes by simulated UAVs; empty at the start of a federation."""
JOINED = "joined"
"""The folder with a state file for each `dyknow join`."""


class Running(NamedTuple):
    """One process: its platform, id, and start time in seconds since the epoch as the system states it."""

    unit: str
    pid: int
    started: float

    def process(self) -> "Process | None":
        """The process itself, or None if it has ended, even if its id is in use again."""
        import psutil  # a tenth of the time of a command, which mostly has nothing to look up here

        try:
            found = psutil.Process(self.pid)
            alive = found.create_time() == self.started and found.status() != psutil.STATUS_ZOMBIE
        except psutil.NoSuchProcess:
            return None
        return found if alive else None


def this_process() -> Running:
    """The process that calls, as a supervisor of platforms."""
    from psutil import Process

    mine = Process()
    return Running("", mine.pid, mine.create_time())


class ProcessState(NamedTuple):
    """Recorded state of a federation on this machine: its processes (unit "" is the supervisor) and their endpoints.

    `local` pairs an endpoint with the one on loopback of the same platform.
    """

    running: tuple[Running, ...] = ()
    endpoints: tuple[str, ...] = ()
    local: tuple[tuple[str, str], ...] = ()

    def dialled(self, endpoints: Iterable[str]) -> tuple[str, ...]:
        """The same platforms, those of this machine at their endpoints on loopback."""
        local = dict(self.local)
        return tuple(dict.fromkeys(local.get(endpoint, endpoint) for endpoint in endpoints))


def run_directory(federation: str) -> Path:
    """Where the run directory of a federation is, or would be."""
    runtime = os.environ.get("XDG_RUNTIME_DIR")
    base = Path(runtime) if runtime and Path(runtime).is_dir() else Path.home() / ".cache"
    return base / "dyknow" / federation


def noted_state(directory: Path, file: str = STATE_FILE) -> ProcessState:
    """The noted processes of this federation, whether they still run or not."""
    try:
        noted = json.loads((directory / file).read_text(encoding="utf-8"))
        running = tuple(
            Running(str(entry["unit"]), int(entry["pid"]), float(entry["started"])) for entry in noted["running"]
        )
        endpoints = tuple(str(endpoint) for endpoint in noted["endpoints"])
        local = tuple((str(endpoint), str(own)) for endpoint, own in noted.get("local", {}).items())
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return ProcessState()
    return ProcessState(running, endpoints, local)


def read_state(directory: Path) -> ProcessState:
    """The processes of this federation that still run; the endpoints only if any does."""
    noted = noted_state(directory)
    alive = tuple(found for found in noted.running if found.process() is not None)
    return ProcessState(alive, noted.endpoints, noted.local) if alive else ProcessState()


def joined_states(directory: Path) -> dict[Path, ProcessState]:
    """The noted processes of each `dyknow join` of this federation, by file."""
    files = sorted((directory / JOINED).glob("*.json"))
    return {file: noted_state(file.parent, file.name) for file in files}


def write_state(directory: Path, state: ProcessState, file: str = STATE_FILE) -> Path:
    """Write the state, whole or not at all; returns the file."""
    directory.mkdir(mode=0o700, parents=True, exist_ok=True)
    running = [found._asdict() for found in state.running]
    noted = {"running": running, "endpoints": state.endpoints, "local": dict(state.local)}
    new = directory / f"{file}.new"
    new.write_text(json.dumps(noted), encoding="utf-8")
    return new.replace(directory / file)
