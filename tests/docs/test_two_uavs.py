"""The part of the tutorial that flies: two platforms, each with its specification, over real Zenoh."""

import secrets
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from queue import Empty, Queue
from threading import Thread
from time import monotonic

import pytest

from tests.docs.pages import DOCS, Shown, alike, commands, environment, fences, folder

PATIENCE_S = 100.0
PAGE = DOCS / "tutorial.md"
Start = Callable[[str], "Queue[str]"]
pytestmark = pytest.mark.live


def shown(about: str) -> list[Shown]:
    (found,) = [fence for fence in fences(PAGE) if fence.about == about]
    return commands(found)


@pytest.fixture
def place(tmp_path: Path) -> Path:
    return folder(tmp_path)


@pytest.fixture
def surroundings(place: Path) -> dict[str, str]:
    return {**environment(place), "DYKNOW_FEDERATION": f"docs-{secrets.token_hex(4)}"}


@pytest.fixture
def start(place: Path, surroundings: dict[str, str]) -> Iterator[Start]:
    """Starts a command that goes on; its lines as they come."""
    running = []

    def started(command: str) -> "Queue[str]":
        lines: Queue[str] = Queue()
        process = subprocess.Popen(
            ["/bin/sh", "-c", f"exec {command}"], cwd=place, env=surroundings, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        reader = Thread(target=lambda: [lines.put(line) for line in process.stdout or ()], daemon=True)
        reader.start()
        running.append(process)
        return lines

    yield started
    for process in running:
        process.send_signal(signal.SIGINT)
    for process in running:
        assert process.wait(PATIENCE_S) == 130


def come(lines: "Queue[str]", wanted: list[str]) -> None:
    """Wait until lines like these have come, in this order; others may come between."""
    until, left, seen = monotonic() + PATIENCE_S, [alike(line) for line in wanted], []
    while left:
        try:
            seen.append(lines.get(timeout=max(until - monotonic(), 0.01)))
        except Empty:
            raise AssertionError(f"there is no {left[0]!r} in\n{''.join(seen)}") from None
        if alike(seen[-1]) == left[0]:
            left.pop(0)


@pytest.mark.full  # the whole page is walked in test_hour
def test_the_two_uavs_of_the_tutorial_know_of_each_other(
    start: Start, place: Path, surroundings: dict[str, str]
) -> None:
    said = [(start(each.command), each.output.splitlines()) for unit in "10" for each in shown(f"live {unit}")]
    for lines, wanted in said:
        come(lines, wanted)
    for command, output in shown("live"):
        until = monotonic() + PATIENCE_S
        while True:
            done = subprocess.run(
                ["/bin/sh", "-c", command], cwd=place, env=surroundings, text=True, timeout=PATIENCE_S, check=False,
                capture_output=True,
            )  # fmt: skip
            found = [alike(line) for line in done.stdout.splitlines()]
            lacking = [line for line in output.splitlines() if alike(line) not in found]
            if done.returncode == 0 and not lacking:
                break
            assert monotonic() < until, f"{command}: there is no {lacking} in\n{done.stdout}\n{done.stderr}"


def test_a_platform_without_a_vehicle_ends_when_its_specification_is_wrong(
    place: Path, surroundings: dict[str, str]
) -> None:
    done = subprocess.run(
        ["dyknow", "join", "--unit", "7", "--spec", "examples/wrong.kpl"], cwd=place, env=surroundings, text=True,
        timeout=PATIENCE_S, check=False, capture_output=True,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.count("nothing makes sped[car1]") == 1
