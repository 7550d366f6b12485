"""The list of handlings, shared by the processes of a federation on one machine: a file that only grows.

Each line is one handling, appended in one write, so that no process sees a part of one, and all see the same order. A
thing that a dying process carried falls.
"""

import json
import os
import threading
from pathlib import Path
from typing import Protocol

from dyknow.sim_uavs.boxes.handled import BoxWorld, Handling, Placed, SeenThing

_LONGEST_LINE = 1000


class HandlingLog(Protocol):
    """Where handlings are written to and read from."""

    def append(self, handling: Handling) -> None:
        """Put it after those that are there."""

    def news(self) -> list[Handling]:
        """The handlings that this reader has not seen."""


class HandlingList:
    """Of one process."""

    def __init__(self) -> None:
        self._waiting: list[Handling] = []

    def append(self, handling: Handling) -> None:
        self._waiting.append(handling)

    def news(self) -> list[Handling]:
        found, self._waiting = self._waiting, []
        return found


class HandlingFile:
    """Of several processes.

    Attributes:
        damaged: lines that were no handlings.

    Raises:
        OSError: the file cannot be written.
    """

    def __init__(self, file: Path) -> None:
        self.damaged = 0
        self._descriptor = os.open(file, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o600)
        self._read = 0
        self._rest = b""

    def append(self, handling: Handling) -> None:
        os.write(self._descriptor, json.dumps(handling).encode() + b"\n")

    def news(self) -> list[Handling]:
        size = os.fstat(self._descriptor).st_size
        if size <= self._read:
            return []
        data = os.pread(self._descriptor, size - self._read, self._read)
        self._read += len(data)
        *lines, self._rest = (self._rest + data).split(b"\n")
        self._rest = self._rest[:_LONGEST_LINE]
        found = [self._handling(line) for line in lines]
        return [each for each in found if each is not None]

    def close(self) -> None:
        os.close(self._descriptor)

    def _handling(self, line: bytes) -> Handling | None:
        try:
            at_us, what, thing, by, place, velocity = json.loads(line[:_LONGEST_LINE])
            x, y, up = map(float, place)
            vx, vy, vu = map(float, velocity)
            return Handling(int(at_us), what, str(thing), str(by), (x, y, up), (vx, vy, vu))
        except (ValueError, TypeError):
            self.damaged += 1
            return None


class SharedBoxes:
    """The things of a scenario as one process sees and handles them, from any thread."""

    def __init__(self, world: BoxWorld, log: HandlingLog) -> None:
        self.world, self._log, self._lock = world, log, threading.Lock()

    def at(self, now_us: int) -> list[Placed]:
        """All things at a time (federation time)."""
        with self._lock:
            self._catch_up()
            return self.world.at(now_us)

    def do(self, handling: Handling) -> bool:
        """Handle a thing; whether this UAV has it then."""
        with self._lock:
            self._log.append(handling)
            self._catch_up()
            return self.world.holder(handling.thing) == handling.by

    def _catch_up(self) -> None:
        for handling in self._log.news():
            self.world.on_handling(handling)


class BoxesOnGround:
    """The things that cameras see: a thing on a line is too near below to be in an image."""

    def __init__(self, boxes: SharedBoxes) -> None:
        self._boxes = boxes

    def at(self, now_us: int) -> list[SeenThing]:
        return [each.seen for each in self._boxes.at(now_us) if each.holder is None]
