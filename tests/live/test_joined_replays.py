"""`dyknow join --replay`, by hand, in processes of their own: recordings that share an epoch share one time."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from tests.live.federated import Federated, command_centre, separations
from tests.live.replays import file
from tests.live.test_real_flights import DATAFLASH, EPOCH_US, TELEMETRY, both_airborne, separation

pytestmark = [
    pytest.mark.live,
    pytest.mark.skipif("DYKNOW_FLIGHT_DATA" not in os.environ, reason="DYKNOW_FLIGHT_DATA names no directory of logs"),
]

S = 1_000_000
END_S = 20.0


@contextmanager
def joining(directory: Path, federation: str, unit: str, log: str, *options: str) -> Iterator[Callable[[], dict]]:
    """The command, started; calling what is entered waits until it says that it joined."""
    argv = ["join", "--unit", unit, "--replay", file(log), "--federation", federation, "--json", *options]
    with (directory / f"{unit}.err").open("wb") as errors:
        child = subprocess.Popen(
            [sys.executable, "-c", "from console.main import main; main()", *argv],
            stdout=subprocess.PIPE,
            stderr=errors,
            env={**os.environ, "XDG_RUNTIME_DIR": str(directory)},
        )
    assert child.stdout is not None
    lines = child.stdout

    def joined() -> dict:
        said = lines.readline()
        assert said, (directory / f"{unit}.err").read_text()
        return json.loads(said)

    try:
        yield joined
    finally:
        child.send_signal(signal.SIGINT)
        try:
            child.wait(END_S)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()
        lines.close()


def clocks(federation: Federated, units: set[str]) -> None:
    """All of them are in the directory, and none is refused for another clock."""
    centre = federation.client.centre

    def alive() -> bool:
        return {seen.unit for seen in centre.platforms() if seen.state == "alive"} >= units

    assert federation.wait_for(alive, 20.0), centre.platforms()
    assert federation.wait_for(lambda: centre.clock.speed == 10.0, 2.0)


def test_two_that_are_given_one_epoch_and_one_that_comes_later_share_a_clock(tmp_path) -> None:
    name = f"test-join-{os.getpid()}"
    epoch_us = time.time_ns() // 1000 + 20 * S
    shared = ("--speed", "10", "--epoch", str(epoch_us))
    with ExitStack() as stack:
        enter = stack.enter_context
        first = enter(joining(tmp_path, name, "tel", TELEMETRY, *shared, "--from", "685s"))
        other = enter(joining(tmp_path, name, "fla", DATAFLASH, *shared, "--from", "90s"))
        said = first()
        assert (said["event"], said["unit"]) == ("joined", "tel")
        assert "heli-position" in said["labels"]
        assert other()["unit"] == "fla"
        client = enter(command_centre(name))
        federation = Federated(None, client)
        clocks(federation, {"tel", "fla"})
        assert client.centre.clock.epoch_us == epoch_us
        federation.stream_positions(["tel", "fla"], 20.0)
        federation.until_us(epoch_us + 20 * S)
        enter(joining(tmp_path, name, "late", DATAFLASH, "--speed", "10"))()
        clocks(federation, {"late"})
        federation.stream_positions(["late"], 20.0)
        federation.wait_for(lambda: len(federation.track("late")) >= 20, 20.0)
        # It is in the federation's time, from the moment it came.
        assert min(federation.track("late")) > epoch_us + 20 * S
        apart = separations(federation.track("tel"), federation.track("fla"))
    errors = []
    for at_us, metres in apart.items():
        pair = both_airborne(595 * S, at_us - epoch_us + EPOCH_US + 90 * S)
        if pair is not None:
            errors.append(abs(metres - separation(*pair)[0]))
    assert len(errors) > 50
    assert sorted(errors)[len(errors) // 2] < 0.6
