"""A real ArduCopter over every link: joined in the version that it speaks, or why not is reported within 5 s.

One autopilot for most tests, in this order. Skipped where no ArduCopter can be started.
"""

import time
from collections.abc import Iterator
from contextlib import closing

import pytest

from dyknow.navigation.vehicle import BatteryReport, Command, CommandResult, PositionReport, SetGuided
from tests.live.vehicles.sitl import Sitl, absence
from tests.live.vehicles.test_arducopter import free_port
from tests.proxies.mavlink.test_heard import KEY, WITHIN_US, Joined

pytestmark = [pytest.mark.live, pytest.mark.skipif(bool(absence()), reason=absence())]
_SIGNING_EPOCH_S = 1_420_070_400


@pytest.fixture(scope="module")
def copter(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Sitl]:
    """Without satellites at first; its third serial port, a TCP server, speaks MAVLink 1."""
    parameters = {"SERIAL2_PROTOCOL": 1, "SIM_GPS1_ENABLE": 0}
    with Sitl(tmp_path_factory.mktemp("sitl"), free_port(), parameters=parameters) as booting:
        yield booting


def test_satellites_that_are_missing_found_and_lost_are_reported_over_udp(copter: Sitl) -> None:
    with closing(Joined(f"udpin:127.0.0.1:{copter.peer}")) as joined:
        assert joined.link(ok=False) == "hears system 1, ArduCopter, no GPS fix"
        assert joined.reported_us - joined.started_us < WITHIN_US
        joined.next(BatteryReport)
        copter.parameter("SIM_GPS1_ENABLE", 1)
        assert joined.link(ok=True) == "hears system 1, ArduCopter, MAVLink 2"
        copter.parameter("SIM_GPS1_ENABLE", 0)
        assert joined.link(ok=False) == "system 1, ArduCopter: position without GPS"
        copter.parameter("SIM_GPS1_ENABLE", 1)
        assert joined.link(ok=True) == "hears system 1, ArduCopter, MAVLink 2"
        assert joined.feed.port.counts["not wanted"] < 200, "messages are asked for one by one, not by group"


def test_a_port_that_speaks_version_1_is_answered_in_it_over_tcp(copter: Sitl) -> None:
    with closing(Joined(f"tcp:127.0.0.1:{copter.tcp}", 1)) as joined:
        assert joined.link(ok=True) == "hears system 1, ArduCopter, MAVLink 1"
        joined.next(PositionReport)
        joined.feed.command(Command(1, SetGuided()))
        assert joined.next(CommandResult).accepted


def test_once_it_has_a_key_it_is_heard_and_obeys_with_the_key_only(tmp_path_factory: pytest.TempPathFactory) -> None:
    with Sitl(tmp_path_factory.mktemp("sitl"), free_port()) as copter:
        station, stamp = copter._station, int((time.time() - _SIGNING_EPOCH_S) * 1e5)
        with closing(Joined(f"tcp:127.0.0.1:{copter.tcp}", 1)) as joined:
            joined.link(ok=True)
        station.mav.setup_signing_send(1, 1, list(KEY), stamp)
        station.setup_signing(KEY)
        copter.heard("HEARTBEAT")
        with closing(Joined(f"tcp:127.0.0.1:{copter.tcp}", 1, key=KEY)) as joined:
            assert joined.link(ok=True) == "hears system 1, ArduCopter, MAVLink 2"
            joined.feed.command(Command(1, SetGuided()))
            assert joined.next(CommandResult).accepted
        with closing(Joined(f"tcp:127.0.0.1:{copter.tcp}", 1, key=bytes(32))) as joined:
            assert joined.link(ok=False) == "heard frames that are signed with another key (--signing-key)"
            assert joined.reported_us - joined.started_us < WITHIN_US


def test_an_autopilot_that_ends_is_reported_and_one_that_does_not_listen_is_waited_for(copter: Sitl) -> None:
    with closing(Joined(f"tcp:127.0.0.1:{copter.tcp}", 1)) as joined:
        joined.link(ok=True)
        copter.stop()
        gone_us = time.time_ns() // 1000
        assert joined.link(ok=False).startswith(f"tcp:127.0.0.1:{copter.tcp} is not open: ")
        assert joined.reported_us - gone_us < WITHIN_US
