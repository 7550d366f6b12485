"""Orders to a real ArduCopter: what it acknowledges is done, what it refuses is a failure, whom it belongs to is kept.

One autopilot and one platform for all tests, in this order; they are skipped where no ArduCopter can be started.
"""

import socket
from collections.abc import Iterator
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.live.command_line.command import Dyknow, lines
from tests.live.vehicles.sitl import HOME, Sitl, absence, place

pytestmark = [pytest.mark.live, pytest.mark.skipif(bool(absence()), reason=absence())]
HEIGHT_M = 30.0


@pytest.fixture(scope="module")
def copter(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Sitl]:
    with Sitl(tmp_path_factory.mktemp("sitl"), free_port()) as flown:
        flown.take_off(HEIGHT_M)
        yield flown


@pytest.fixture(scope="module")
def dyknow(tmp_path_factory: pytest.TempPathFactory, copter: Sitl) -> Iterator[Dyknow]:
    """The command, and a platform 1 that flies the copter, however far a command centre sends it."""
    found = Dyknow(tmp_path_factory.mktemp("dyknow"))
    try:
        endpoint = f"udpin:127.0.0.1:{copter.peer}"
        joined = found.start("join", "--unit", "1", "--mavlink", endpoint, "--control", "--range", "1e8", "--json")
        assert next(line for line in lines(joined) if line.get("event") == "joined")
        found.until("query", "heli-home", "--unit", "1")
        yield found
    finally:
        found.close()


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def delegated(dyknow: Dyknow, *task: str, code: int = 0) -> list[dict[str, Any]]:
    """What came of an order: the answers' performatives and contents."""
    return dyknow.run("delegate", *task, "--to", "1", "--wait", code=code)


def goto(latitude_deg: float, longitude_deg: float, height_m: float = HEIGHT_M) -> tuple[str, ...]:
    where = f"latitude_deg={latitude_deg:.7f}", f"longitude_deg={longitude_deg:.7f}"
    return "goto", *where, f"altitude_m={HOME[2] + height_m:.1f}"


def test_a_goto_is_done_when_the_autopilot_has_it_as_its_target_and_it_is_flown(copter: Sitl, dyknow: Dyknow) -> None:
    there = place(25.0, 0.0)
    agreed, done = delegated(dyknow, *goto(*there))
    assert agreed["performative"] == "agree"
    assert done["performative"] == "inform"
    assert "seen in the vehicle's target" in done["content"]
    assert copter.target() == pytest.approx((*there, HOME[2] + HEIGHT_M), abs=0.2)
    copter.until(lambda at: abs(at.lat / 1e7 - there[0]) < 2e-5, within_s=30.0)


def test_a_goto_that_the_autopilot_denies_is_a_failure(copter: Sitl, dyknow: Dyknow) -> None:
    before = copter.target()
    agreed, failed = delegated(dyknow, *goto(0.0, 0.0), code=3)
    assert (agreed["performative"], failed["performative"]) == ("agree", "failure")
    assert "autopilot: denied" in failed["content"]
    assert copter.target() == before


def test_what_lies_outside_the_autopilots_fence_is_refused_and_named(copter: Sitl, dyknow: Dyknow) -> None:
    copter.parameter("FENCE_TYPE", 1)
    copter.parameter("FENCE_ALT_MAX", 40)
    copter.parameter("FENCE_ENABLE", 1)
    (refused,) = delegated(dyknow, *goto(*place(25.0, 0.0), 60.0), code=1)
    assert "the autopilot's fence of 40 m" in refused["content"]
    copter.parameter("FENCE_ENABLE", 0)
    assert delegated(dyknow, *goto(*place(25.0, 0.0), 33.0))[-1]["performative"] == "inform"


def test_a_copter_in_a_failsafe_flies_and_is_commanded(copter: Sitl, dyknow: Dyknow) -> None:
    copter.parameter("FS_OPTIONS", 4)
    copter.parameter("SIM_RC_FAIL", 1)
    copter.heard("HEARTBEAT", lambda beat: beat.system_status == mavlink.MAV_STATE_CRITICAL)
    assert delegated(dyknow, "hold")[-1]["performative"] == "inform"
    copter.parameter("SIM_RC_FAIL", 0)
    copter.heard("HEARTBEAT", lambda beat: beat.system_status == mavlink.MAV_STATE_ACTIVE)


def test_after_a_pilots_takeover_nothing_is_sent(copter: Sitl, dyknow: Dyknow) -> None:
    assert delegated(dyknow, *goto(*place(-60.0, 40.0)))[-1]["performative"] == "inform"
    copter.until(lambda at: abs(at.vx) > 200)
    copter.mode("LOITER")
    (refused,) = delegated(dyknow, *goto(*place(0.0, 0.0)), code=1)
    assert "mode LOITER" in refused["content"]
    assert "avoidance off: mode LOITER" in condition(dyknow)
    copter.until(lambda at: abs(at.vx) < 50)
    copter.mode("GUIDED")
    here = copter.until(lambda _at: True)
    for _ in range(30):
        at = copter.until(lambda _at: True)
        assert abs(at.lat - here.lat) < 150, "it flies where nobody has asked it to"
    assert delegated(dyknow, *goto(*place(0.0, 0.0)))[-1]["performative"] == "inform", "until asked"


def condition(dyknow: Dyknow) -> str:
    """What `ls` says is not as it should be."""
    (seen,) = dyknow.run("ls")
    return "; ".join(each["text"] for each in seen.get("conditions", ()))


def test_landing_is_done_when_the_mode_shows_it(copter: Sitl, dyknow: Dyknow) -> None:
    done = delegated(dyknow, "land")[-1]
    assert "seen in the vehicle's mode" in done["content"]
    copter.mode("GUIDED")
    assert delegated(dyknow, "return-home")[-1]["performative"] == "inform"
    copter.mode("GUIDED")


def test_over_a_dead_link_nothing_is_commanded(copter: Sitl, dyknow: Dyknow) -> None:
    copter.stop()
    until_silent(dyknow)
    (refused,) = delegated(dyknow, "hold", code=1)
    assert refused["performative"] == "refuse"
    assert "no heartbeat for " in refused["content"]


def until_silent(dyknow: Dyknow) -> None:
    """Until `ls` has noticed that nothing is heard; the command paces the asking."""
    for _ in range(40):
        if "is silent" in condition(dyknow):
            return
    raise AssertionError("ls never says that the vehicle is silent")
