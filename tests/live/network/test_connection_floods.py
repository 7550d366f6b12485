"""Connections that never become links, as many as a stranger makes: whoever commands from the same machine is not held up."""

import json
import os
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from dyknow.runtime.configuration.run_directory import STATE_FILE
from dyknow.runtime.configuration.session import host_of
from tests.live.command_line.command import Dyknow

pytestmark = [pytest.mark.live, pytest.mark.timeout(300)]
UNITS = ("0", "1")
FULL = os.environ.get("DYKNOW_FULL") == "1"
HELD, HELD_IN_S, HELD_HALF_OPEN = (1300, 4.0, 1000) if FULL else (260, 1.0, 200)
RATE, CLOSED_FOR_S = (200, 30.0) if FULL else (200, 1.5)
JOINED_WITHIN_S = 5.0


@pytest.fixture
def secured(dyknow: Dyknow, tmp_path: Path) -> Iterator[tuple[Dyknow, list[str]]]:
    """Two hovering UAVs with a roster, and the endpoints at which others dial them."""
    dyknow.options = ("--roster", str(tmp_path / "trust" / "roster.toml"))
    dyknow.run("roster", "init", *UNITS, "2")
    dyknow.run("up", str(len(UNITS)), "--scenario", "hover", "--discover", "none", "--detach")
    state = json.loads((dyknow.directory / "dyknow" / dyknow.federation / STATE_FILE).read_text())
    assert len(state["endpoints"]) == len(set(state["local"].values())) == len(UNITS)
    assert not set(state["endpoints"]) & set(state["local"].values())
    yield dyknow, state["endpoints"]


class Flood:
    """Connects to all endpoints in turn, without a word, until a time is over or as many have been made."""

    def __init__(self, endpoints: list[str], rate: float) -> None:
        self._places = [(host_of(each), int(each.rpartition(":")[2])) for each in endpoints]
        self._rate, self.held, self.made = rate, list[socket.socket](), 0

    def run(self, seconds: float, hold: int = 0) -> None:
        begun_s, pace = time.monotonic(), threading.Event()
        while (elapsed_s := time.monotonic() - begun_s) < seconds:
            if self.made < elapsed_s * self._rate:
                self._connect(hold)
            else:
                pace.wait(1 / self._rate)

    def _connect(self, hold: int) -> None:
        made = socket.create_connection(self._places[self.made % len(self._places)], 1.0)
        self.made += 1
        self.held.append(made) if len(self.held) < hold else made.close()

    def end(self) -> None:
        for each in self.held:
            each.close()
        self.held.clear()


def alive(dyknow: Dyknow) -> set[int]:
    return {each["unit"] for each in dyknow.run("ls") if each["state"] == "alive"}


def found_all_after_s(dyknow: Dyknow, unit: str) -> float:
    """How long after its session was open a newcomer had found the others."""
    records = dyknow.directory / "dyknow" / dyknow.federation / "units" / f"{unit}.out"
    said = [json.loads(line) for line in records.read_text().splitlines()]
    (joined,) = (each for each in said if each["event"] == "joined")
    found = next(each for each in said if each["event"] == "directory" and set(UNITS) <= set(each["units"]))
    return round((found["at_us"] - joined["at_us"]) / 1e6, 2)


def test_commands_of_the_machine_work_while_strangers_flood_the_platforms_and_a_newcomer_joins_after_it(
    secured: tuple[Dyknow, list[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    dyknow, endpoints = secured
    assert alive(dyknow) == {0, 1}
    took: dict[str, float] = {}

    def asked(when: str) -> None:
        begun_s = time.monotonic()
        assert alive(dyknow) == {0, 1}, when
        took[when] = round(time.monotonic() - begun_s, 2)

    flood = Flood(endpoints, HELD / HELD_IN_S)
    flood.run(HELD_IN_S, HELD_HALF_OPEN)
    try:
        asked(f"{flood.made} made, {len(flood.held)} half open")
        assert dyknow.run("delegate", "hold", "--to", "0")[0]["performative"] == "agree"
    finally:
        flood.end()
    asked("all closed")
    flood = Flood(endpoints, RATE)
    flood.run(CLOSED_FOR_S)
    asked(f"{flood.made} made and closed in {CLOSED_FOR_S} s")
    dyknow.run("up", "3", "--scenario", "hover", "--discover", "none", "--detach")
    took["a newcomer has found all"] = found_all_after_s(dyknow, "2")
    assert took["a newcomer has found all"] <= JOINED_WITHIN_S
    dyknow.until("ls", state="alive")
    assert alive(dyknow) == {0, 1, 2}
    with capsys.disabled():
        print(json.dumps(took))
