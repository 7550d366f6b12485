"""`dyknow join --replay`, by hand, in processes of their own: recordings that share an epoch share one time."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from tests.live.flights.federated import Federated, command_centre, separations
from tests.live.flights.replays import file
from tests.live.flights.test_real_flights import DATAFLASH, EPOCH_US, TELEMETRY, both_airborne, separation

pytestmark = [
    pytest.mark.live,
    pytest.mark.skipif("DYKNOW_FLIGHT_DATA" not in os.environ, reason="DYKNOW_FLIGHT_DATA names no directory of logs"),
]

S = 1_000_000
END_S = PATIENCE_S = 20.0
SPEED = 2.0
LEAD_S = 5
"""From the commands to the epoch. Where they need longer, the beginning of the flights is missed, and no more."""
DELAY_S, FROM_S = 390, 45
"""From there on both fly for 66 s, and after a pause for another 55 s: at twice the speed, for a minute."""
ENOUGH = 50


@contextmanager
def joining(directory: Path, federation: str, unit: str, log: str, *options: str) -> Iterator[Callable[[], dict]]:
    """The command, started; calling what is entered waits until it says that it joined."""
    argv = ["join", "--unit", unit, "--replay", file(log), "--federation", federation, "--json", *options]
    with (directory / f"{unit}.err").open("wb") as errors:
        child = subprocess.Popen(
            [sys.executable, "-c", "from dyknow.console.main import main; main()", *argv],
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
        child.terminate()
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

    assert federation.wait_for(alive, PATIENCE_S), centre.platforms()
    assert federation.wait_for(lambda: centre.clock.speed == SPEED, PATIENCE_S)


def separation_errors(federation: Federated, epoch_us: int) -> list[float]:
    """How far the federated separations are from those of the raw fixes, so far, where both fly."""
    found = []
    for at_us, metres in separations(federation.track("tel"), federation.track("fla")).items():
        pair = both_airborne(DELAY_S * S, at_us - epoch_us + EPOCH_US + FROM_S * S)
        if pair is not None:
            found.append(abs(metres - separation(*pair)[0]))
    return found


def test_two_that_are_given_one_epoch_and_one_that_comes_later_share_a_clock(tmp_path) -> None:
    name = f"test-join-{os.getpid()}"
    epoch_us = time.time_ns() // 1000 + LEAD_S * S
    shared = ("--speed", str(SPEED), "--epoch", str(epoch_us))
    with ExitStack() as stack:
        enter = stack.enter_context
        first = enter(joining(tmp_path, name, "tel", TELEMETRY, *shared, "--from", f"{FROM_S + DELAY_S}s"))
        other = enter(joining(tmp_path, name, "fla", DATAFLASH, *shared, "--from", f"{FROM_S}s"))
        said = first()
        assert (said["event"], said["unit"]) == ("joined", "tel")
        assert "heli-position" in said["labels"]
        assert other()["unit"] == "fla"
        client = enter(command_centre(name))
        federation = Federated(None, client)
        clocks(federation, {"tel", "fla"})
        assert client.centre.clock.epoch_us == epoch_us
        federation.stream_positions(["tel", "fla"], 2.0 * SPEED)
        federation.until_us(epoch_us)
        began_us = client.federation_us()
        enter(joining(tmp_path, name, "late", DATAFLASH, "--speed", str(SPEED)))()
        clocks(federation, {"late"})
        federation.stream_positions(["late"], 2.0 * SPEED)
        assert federation.wait_for(lambda: len(federation.track("late")) >= ENOUGH, PATIENCE_S)
        # It is in the federation's time, from the moment it came.
        assert min(federation.track("late")) > began_us
        assert federation.wait_for(lambda: len(separation_errors(federation, epoch_us)) >= ENOUGH, PATIENCE_S)
        errors = separation_errors(federation, epoch_us)
    assert sorted(errors)[len(errors) // 2] < 0.6
