"""What `join` refuses before it starts anything."""

from pathlib import Path

import pytest

from dyknow.console.centre import client
from dyknow.console.command import Call
from dyknow.console.commands.fleet.join import join
from dyknow.federation.members.clock import FederationClock
from dyknow.model.errors import WrongCall
from dyknow.runtime.configuration.settings import UnitFile
from tests.box import EPOCH, Box
from tests.proxies import logs


def _join(call: Call, unit: str, file: Path, *, speed: float = 1.0, from_: str = "0s") -> int:
    return join(call, unit=unit, own=UnitFile(replay=file, from_=from_), speed=speed)


@pytest.fixture
def flight(tmp_path: Path) -> Path:
    found = tmp_path / "flight.tlog"
    found.write_bytes(logs.tlog())
    return found


def test_a_beginning_after_the_end_of_the_recording_is_refused_with_its_length(call: Call, flight: Path) -> None:
    lasts_s = 49 * logs.STEP_US // 1_000_000
    with pytest.raises(WrongCall, match=rf"--replay from: .*flight\.tlog ends {lasts_s} s after its first position"):
        _join(call, "9", flight, from_="5000s")


def test_a_speed_that_is_not_the_federations_is_refused(
    monkeypatch: pytest.MonkeyPatch, call: Call, flight: Path
) -> None:
    world = Box(clock=FederationClock(EPOCH - 5_000_000, 4.0))
    world.fly("0", 0.0, 0.0)
    monkeypatch.setattr(client, "_client_ports", lambda _call: world.client_ports())
    with pytest.raises(WrongCall, match=r"runs 4 times as fast as the wall, .* 2 times as fast; join with --speed 4\."):
        _join(call, "9", flight, speed=2.0)


def test_a_name_that_is_taken_is_refused(world: Box, call: Call, flight: Path) -> None:
    with pytest.raises(WrongCall, match="there is a platform 1"):
        _join(call, "1", flight)


def test_an_elevation_file_that_is_cut_is_refused_before_anything_starts(call: Call, tmp_path: Path) -> None:
    (tmp_path / "ground.asc").write_text(
        "ncols 40\nnrows 30\nxllcorner 436000\nyllcorner 6180000\ncellsize 50\n" + "1 " * 1200
    )
    with pytest.raises(WrongCall, match=r"--elevation: .*ground\.asc: header: cells of 50 are no degrees .*gdalwarp"):
        own = UnitFile(mavlink="udpin:127.0.0.1:0", control="guided", elevation=tmp_path / "ground.asc")
        join(call, unit="1", own=own)
