"""`dyknow cot` and `dyknow remote-id` as others receive them: platforms at the truth, alarms, no more often than they should."""

import math
import socket
from collections.abc import Iterator
from datetime import datetime
from typing import Any
from xml.dom.minidom import parseString

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.console.command import Call
from dyknow.console.commands.outward.cot import cot
from dyknow.console.commands.outward.remote_id import remote_id
from dyknow.console.errors import DONE
from dyknow.console.picture.picture import MOST
from dyknow.console.picture.things import ThingState, ThingStates
from dyknow.model.errors import WrongCall
from dyknow.runtime.recordings.recording_file import ALARM, SAMPLE
from tests.box import EPOCH, METRE_DEG, Box
from tests.console.commands.recordings.encounter import encounter, in_world
from tests.console.conftest import Lines


@pytest.fixture
def meeting(monkeypatch: pytest.MonkeyPatch) -> Box:
    world = encounter()
    in_world(monkeypatch, world)
    return world


@pytest.fixture
def receiver() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end:
        end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        end.bind(("127.0.0.1", 0))
        end.setblocking(False)
        yield end


def received(end: socket.socket) -> Iterator[bytes]:
    while True:
        try:
            yield end.recv(65_535)
        except BlockingIOError:
            return


def at_the_truth(latitude_deg: float, unit: str, at_us: float) -> bool:
    start_m, speed_m_s = {"0": (0.0, 4.0), "1": (100.0, -4.0)}[unit]
    true_deg = 58.0 + (start_m + speed_m_s * (at_us - EPOCH) / 1e6) * METRE_DEG
    return abs(latitude_deg - true_deg) < 0.5 * METRE_DEG


def test_each_platform_is_an_event_a_second_at_the_truth_and_an_alarm_one_that_ends(
    meeting: Box, receiver: socket.socket, call: Call, lines: Lines
) -> None:
    meeting.vehicle("0").altitude_m = 60.0
    to = f"udp://127.0.0.1:{receiver.getsockname()[1]}"
    assert cot(call, to=to, alarms=True, undulation=28.0, duration="14s") == DONE
    events = [parseString(each.decode()).documentElement for each in received(receiver)]
    for unit in ("0", "1"):
        of_unit = [each for each in events if each.getAttribute("uid") == f"dyknow.test.{unit}"]
        assert 11 <= len(of_unit) <= 15
        for event in of_unit:
            at_us = datetime.fromisoformat(event.getAttribute("start")).timestamp() * 1e6
            point = event.getElementsByTagName("point")[0]
            assert at_the_truth(float(point.getAttribute("lat")), unit, at_us)
            assert float(point.getAttribute("ce")) < 10
        track = of_unit[-1].getElementsByTagName("track")[0]
        assert float(track.getAttribute("speed")) == pytest.approx(4.0, abs=0.5)
        course_deg = float(track.getAttribute("course"))
        assert min(abs(course_deg - {"0": 0, "1": 180}[unit]), abs(course_deg - 360)) < 10
        if unit == "0":
            assert float(point.getAttribute("hae")) == pytest.approx(88.0, abs=1)
    alarms = [each for each in events if each.getAttribute("type") == "b-a-o"]
    ended = {each.getAttribute("uid") for each in alarms if each.getAttribute("stale") == each.getAttribute("time")}
    assert ended
    assert ended <= {
        each.getAttribute("uid") for each in alarms if each.getAttribute("stale") > each.getAttribute("time")
    }
    assert any("proximity" in each.getElementsByTagName("remarks")[0].firstChild.data for each in alarms)
    begun, told = lines()
    assert (begun["to"], told["sent"], told["lost"], told["refused"]) == (to, len(events), {}, 0)


def test_remote_id_of_each_platform_is_four_messages_a_second(
    meeting: Box, receiver: socket.socket, call: Call, lines: Lines
) -> None:
    to = f"udp://127.0.0.1:{receiver.getsockname()[1]}"
    assert remote_id(call, to=to, serial=["0=1A2B5X7Y9Z"], duration="5s") == DONE
    other_end = mavlink.MAVLink(None)
    messages: list[Any] = [other_end.decode(bytearray(each)) for each in received(receiver)]
    kinds = [each.get_type() for each in messages]
    assert len({kinds.count(each) for each in kinds}) == 1
    assert len(set(kinds)) == 4
    assert 8 <= kinds.count("OPEN_DRONE_ID_LOCATION") <= 12
    for each in messages:
        if each.get_type() == "OPEN_DRONE_ID_LOCATION":
            at_us = EPOCH // 3_600_000_000 * 3_600_000_000 + each.timestamp * 1e6
            assert at_the_truth(each.latitude / 1e7, bytes(each.id_or_mac).rstrip(b"\0").decode(), at_us)
        if each.get_type() == "OPEN_DRONE_ID_BASIC_ID":
            is_zero = bytes(each.id_or_mac).startswith(b"0\0")
            assert bytes(each.uas_id).rstrip(b"\0") == (b"1A2B5X7Y9Z" if is_zero else b"1")
    assert lines()[-1]["sent"] == len(messages)


def test_other_machines_and_what_cannot_be_told_are_refused(call: Call) -> None:
    with pytest.raises(WrongCall, match="--beyond-this-machine"):
        cot(call, to="udp://239.2.3.1:6969")
    with pytest.raises(WrongCall, match="--origin"):
        cot(call, to="udp://127.0.0.1:6969", objects="object-tracks")
    with pytest.raises(WrongCall, match="--origin"):
        cot(call, to="udp://127.0.0.1:6969", objects="object-tracks", origin="north")
    with pytest.raises(WrongCall, match="U=SERIAL"):
        remote_id(call, to="udp://127.0.0.1:6969", serial=["=1"])


def tracks(given: list[ThingState], now_us: int = 10_000_000) -> ThingStates:
    return ThingStates(1_000_000, lambda: now_us, given.append, origin=(58.0, 15.0))


def sample(label: str, value: dict[str, Any], valid_us: int = 9_900_000, unit: str = "1") -> dict[str, Any]:
    return {"unit": unit, "label": label, "valid_us": valid_us, "value": value}


def test_objects_are_where_the_origin_puts_them_until_they_end() -> None:
    given: list[ThingState] = []
    taken = tracks(given)
    car = {"symbol": "car<1>", "x_m": 0.0, "y_m": 111.32, "xx_m2": 4.0, "yy_m2": 1.0}
    taken.add("", SAMPLE, sample("object-tracks", car), 0)
    taken.on_time()
    assert [(each.symbol, each.horizontal_sd_m) for each in given] == [("car<1>", 2.0)]
    assert given[0].latitude_deg == pytest.approx(58.001, abs=1e-5)
    taken.add("", SAMPLE, sample("object-tracks", {"symbol": "car<1>", "end": True}), 0)
    assert not taken._picture.section("objects")


def test_an_aircraft_that_is_no_member_is_one_thing_whatever_platforms_hear_it() -> None:
    given: list[ThingState] = []
    taken = tracks(given)
    heard = {"symbol": "adsb-4ca123", "latitude_deg": 58.2, "longitude_deg": 15.1, "altitude_m": 130.0, "sd_m": 66.0}
    heard |= {"vx_m_s": -60.0, "vy_m_s": 10.0, "vz_m_s": None}
    taken.add("", SAMPLE, sample("traffic", heard, 9_900_000, "0"), 0)
    taken.add("", SAMPLE, sample("traffic", {**heard, "vz_m_s": 1.0}, 9_950_000, "1"), 0)
    taken.on_time()
    (one,) = given
    assert (one.latitude_deg, one.longitude_deg, one.horizontal_sd_m) == (58.2, 15.1, 33.0)
    assert (one.altitude_m, one.speed_m_s) == (130.0, pytest.approx(math.hypot(10.0, 60.0)))
    assert one.course_deg % 360 == pytest.approx(279.46, abs=0.01)
    taken.add("", SAMPLE, sample("traffic", {**heard, "latitude_deg": 91.0}, 9_960_000), 0)
    assert taken.refused == 1


def test_an_altitude_that_is_not_of_the_time_of_the_position_is_left_out() -> None:
    given: list[ThingState] = []
    taken = tracks(given)
    taken.add("", SAMPLE, {**sample("heli-altitude", {"altitude_m": 60.0}, 5_000_000), "covariance": [[4.0]]}, 0)
    for valid_us in (8_000_000, 8_000_001):
        at = {"latitude_deg": 58.0, "longitude_deg": 15.0}
        taken.add("", SAMPLE, {**sample("heli-position", at, valid_us), "covariance": [[1e-10, 0.0], [0.0, 1e-10]]}, 0)
        taken._given.clear()
        taken.on_time()
    assert [(each.altitude_m, each.altitude_sd_m) for each in given] == [(60.0, 2.0), (None, None)]
    assert given[0].horizontal_sd_m == pytest.approx(1.11, abs=0.01)


@pytest.mark.parametrize(
    ("label", "value", "valid_us"),
    [
        ("heli-position", {"latitude_deg": 91.0, "longitude_deg": 0.0}, 9_900_000),
        ("heli-position", {"latitude_deg": float("nan"), "longitude_deg": 0.0}, 9_900_000),
        ("heli-position", {"latitude_deg": "58", "longitude_deg": 0.0}, 9_900_000),
        ("heli-position", {"latitude_deg": 58.0, "longitude_deg": 0.0}, 2**62),
        ("heli-position", {"latitude_deg": 58.0, "longitude_deg": 0.0, "other": 1.0}, 9_900_000),
        ("heli-altitude", {"altitude_ft": 58.0}, 9_900_000),
        ("object-tracks", {"symbol": "a", "x_m": 1e300, "y_m": 0.0}, 9_900_000),
        ("object-tracks", {"symbol": 7}, 9_900_000),
    ],
)
def test_values_that_lie_outside_the_earth_or_are_of_another_form_are_left_out_and_counted(
    label: str, value: dict[str, Any], valid_us: int
) -> None:
    given: list[ThingState] = []
    taken = tracks(given)
    taken.add("", SAMPLE, sample(label, value, valid_us), 0)
    taken.add("", ALARM, {"id": "a", "by": "1", "event": "opened", "monitor": "m", "units": [{}, 1]}, 0)
    taken.on_time()
    assert not given
    assert taken.refused == 1


def test_one_that_tells_of_many_things_has_no_more_than_there_is_room_for() -> None:
    taken = tracks([])
    for at in range(MOST["objects"] + 50):
        taken.add("", SAMPLE, sample("object-tracks", {"symbol": str(at), "x_m": 0.0, "y_m": 0.0}, 9_000_000 + at), 0)
    assert len(taken._picture.section("objects")) == MOST["objects"]
