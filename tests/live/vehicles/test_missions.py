"""A mission over real processes and MAVLink, whose vehicle a real MAVLink client takes over in the middle, and gives back."""

import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from pymavlink import mavutil

from dyknow import connect
from dyknow.model.errors import NothingFound
from tests.live.command_line.command import RUN, Dyknow

pytestmark = pytest.mark.live
EXAMPLES = Path(__file__).parents[3] / "examples" / "missions"
LOGISTICS = EXAMPLES.parent / "logistics"
PROBLEM = """
#objects uav = {uav0}
#objects place = {barn, pond}
#init x-of(barn) := 0, y-of(barn) := 6
#init x-of(pond) := 0, y-of(pond) := 45
#goal survey: forall place: seen(place)
"""
LOITER, GUIDED = 5, 4
PATIENCE_S = 90.0


@contextmanager
def ground_station(port: int) -> Iterator[Any]:
    """A MAVLink client that hears the vehicle; `set_mode` is what a pilot does at another station."""
    link = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}", source_system=250)
    try:
        yield link
    finally:
        link.close()


def take(link: Any, mode: int) -> None:
    """Change the vehicle's mode, until its heartbeat shows it."""
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        heard = link.recv_match(type="HEARTBEAT", blocking=True, timeout=2.0)
        if heard is not None and heard.custom_mode == mode:
            return
        link.mav.set_mode_send(link.target_system or 1, mavutil.mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, mode)
    raise AssertionError("the mode does not change")


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])


def phase(dyknow: Dyknow) -> str:
    return str(dyknow.run("mission", "status")[0]["phase"])


def until_phase(dyknow: Dyknow, wanted: str) -> None:
    until = time.monotonic() + PATIENCE_S
    while phase(dyknow) != wanted:
        assert time.monotonic() < until, dyknow.run("mission", "status")


def test_a_mode_change_in_the_middle_is_never_fought_and_the_mission_ends_well_once_it_is_resumed(
    dyknow: Dyknow, tmp_path: Path
) -> None:
    problem, port = tmp_path / "near.prob", free_port()
    problem.write_text(PROBLEM, "utf-8")
    with ground_station(port) as link:
        dyknow.run("up", "1", "--scenario", "hover", "--gcs", f"127.0.0.1:{port}", "--detach")
        dyknow.run("mission", "start", str(EXAMPLES / "survey.dom"), str(problem), "--name", "m1", "--detach")
        until = time.monotonic() + PATIENCE_S
        while not any(each.startswith("running") for each in dyknow.run("mission", "status")[0]["actions"]):
            assert time.monotonic() < until
        take(link, LOITER)
        until_phase(dyknow, "waiting for the pilot")
        modes: list[int] = []
        stop, enough = threading.Event(), threading.Event()

        def listen() -> None:
            while not stop.is_set():
                heard = link.recv_match(type="HEARTBEAT", blocking=True, timeout=0.5)
                if heard is not None and heard.autopilot != mavutil.mavlink.MAV_AUTOPILOT_INVALID:
                    modes.append(heard.custom_mode)
                    if len(modes) > 1:
                        enough.set()

        listening = threading.Thread(target=listen)
        listening.start()
        refused = dyknow.run("delegate", "resume", "--to", "0", code=1)
        assert "guided mode" in str(refused)
        assert enough.wait(PATIENCE_S)
        stop.set()
        listening.join()
        assert set(modes) == {LOITER}, "nothing has taken the vehicle out of its pilot's mode"
        take(link, GUIDED)
        until = time.monotonic() + PATIENCE_S
        while dyknow.run("delegate", "resume", "--to", "0", code=None)[0]["performative"] != "agree":
            assert time.monotonic() < until
        until_phase(dyknow, "ended")
        entry = dyknow.run("mission", "status")[0]
        assert (entry["why"], entry["replans"]) == ("the plan is done", 1)


@pytest.mark.full
@pytest.mark.timeout(300)
def test_a_box_that_another_platforms_vehicle_drops_is_found_by_its_camera_and_delivered(dyknow: Dyknow) -> None:
    dyknow.run("up", "2", "--scenario", "logistics", "--fault", "0 dropped-box at load+7s", "--detach")
    texts = [str(LOGISTICS / name) for name in ("logistics.dom", "one.prob")]
    dyknow.run("mission", "start", *texts, "--name", "m1", "--to", "1", "--detach")

    def until(wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        until_s = time.monotonic() + 2 * PATIENCE_S
        while not wanted(entry := dyknow.run("mission", "status")[0]):
            assert time.monotonic() < until_s, entry
        return entry

    entry = until(lambda entry: entry["phase"] == "locating")
    assert entry["why"] == "looking for b1"
    entry = until(lambda entry: entry["phase"] not in {"locating", "searching for a plan", "executing"})
    assert (entry["phase"], entry["why"], entry["replans"]) == ("ended", "the plan is done", 1), entry


def answered(dyknow: Dyknow, answer: str, *arguments: str) -> "subprocess.CompletedProcess[str]":
    """A command whose question is answered on its standard input."""
    words = [sys.executable, "-c", RUN, *dyknow._words(arguments)]
    return subprocess.run(
        words,
        input=f"{answer}\n",
        capture_output=True,
        text=True,
        env=dyknow._environment(),
        timeout=PATIENCE_S,
        check=False,
    )


@pytest.mark.full
@pytest.mark.timeout(300)
def test_the_cheaper_of_two_proposals_is_flown_if_it_is_consented_to_and_a_program_delegates_as_the_command_does(
    dyknow: Dyknow, monkeypatch: pytest.MonkeyPatch
) -> None:
    dyknow.run("up", "2", "--scenario", "hover", "--detach")
    texts = [str(EXAMPLES / name) for name in ("survey.dom", "two.prob")]
    start = ("mission", "start", *texts, "--name", "m1", "--to", "0,1", "--consent")
    declined = answered(dyknow, "n", *start)
    assert declined.returncode == 1 and "not consented" in declined.stderr, declined
    assert all(f"platform {unit} proposes " in declined.stdout for unit in (0, 1)), declined
    flown = answered(dyknow, "y", *start)
    assert flown.returncode == 0 and flown.stdout.splitlines()[-1].startswith("m1: reached"), flown
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(dyknow.directory))
    domain, problem = ((EXAMPLES / name).read_text("utf-8") for name in ("survey.dom", "one.prob"))
    with connect(dyknow.federation) as fed:
        task = fed.mission(domain, problem, to="0,1", name="m2", search_s=5.0)
        lines = [str(each) for each in task.events]
    assert any("reached" in each for each in lines), lines
    assert {entry["mission"] for entry in dyknow.run("mission", "status")} == {"m1", "m2"}


@pytest.mark.timeout(200)
def test_a_program_ends_a_mission_at_each_platform(dyknow: Dyknow, monkeypatch: pytest.MonkeyPatch) -> None:
    dyknow.run("up", "2", "--scenario", "hover", "--detach")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(dyknow.directory))
    domain, problem = ((EXAMPLES / name).read_text("utf-8") for name in ("survey.dom", "one.prob"))
    with connect(dyknow.federation) as fed:
        fed.mission(domain, problem, to=0, name="m3", search_s=5.0)
        found = fed.abort_mission("m3")
        assert (found.name, set(found.ended), dict(found.unsure)) == ("m3", {"0", "1"}, {})
        with pytest.raises(NothingFound):
            fed.abort_mission("never")
    (entry,) = dyknow.run("mission", "status")
    assert entry["phase"] == "ended", entry
