"""A ground station hears a joined vehicle as if it were connected itself, and never commands it unnoticed."""

import queue
import random
import socket
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.navigation.vehicle import Report, StationReport
from dyknow.proxies.mavlink.feed import MavlinkFeed
from dyknow.proxies.mavlink.frames import Cutter
from dyknow.proxies.mavlink.port import MavlinkPort
from dyknow.proxies.outward.forwarding import MOST_BACK_PER_S, Forwarder, command_in
from dyknow.proxies.outward.outlets import Destination
from tests.proxies.vehicle import Wire, heartbeat, position

PATIENCE_S = 10.0


class Joined:
    """A vehicle, its port and feed, and a ground station that pymavlink is."""

    def __init__(self, *, commands: bool) -> None:
        self.posted: queue.Queue[Report] = queue.Queue()
        self.port = MavlinkPort("udpin:127.0.0.1:0")
        self.feed = MavlinkFeed(self.port, None, self.posted.put, lambda: time.time_ns() // 1000, requests=False)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
            taken.bind(("127.0.0.1", 0))
            number = taken.getsockname()[1]
        self.forwarder = Forwarder(
            Destination("udp", "127.0.0.1", number),
            lambda: self.feed.system,
            self.port,
            self.posted.put,
            lambda: time.time_ns() // 1000,
            commands=commands,
            takes_positions=self.feed.takes_positions,
        )
        self.port.forwards += (self.forwarder.on_frame,)
        self.forwarder.start()
        self.feed.start()
        self.station: Any = mavutil.mavlink_connection(f"udpin:127.0.0.1:{number}", source_system=255)
        self.vehicle = Wire(self.port.address, system=1)
        self.at_ms = 0

    def close(self) -> None:
        self.feed.stop()
        self.forwarder.stop()
        self.station.close()
        self.vehicle.close()

    def fly(self) -> None:
        self.at_ms += 100
        self.vehicle.send(heartbeat(), position(self.at_ms))

    def until(self, condition: Callable[[], Any]) -> Any:
        """Fly until it holds."""
        end_s = time.monotonic() + PATIENCE_S
        while not (found := condition()):
            assert time.monotonic() < end_s
            self.fly()
            time.sleep(0.02)
        return found

    def news(self) -> list[StationReport]:
        return [each for each in list(self.posted.queue) if isinstance(each, StationReport)]


@pytest.fixture(params=[True])
def joined(request: pytest.FixtureRequest) -> Iterator[Joined]:
    found = Joined(commands=request.param)
    yield found
    found.close()


def test_frames_reach_the_station_unchanged_and_those_of_other_systems_do_not(joined: Joined) -> None:
    joined.until(joined.station.recv_msg)
    other, seen = Wire(joined.port.address, system=2), set()

    def is_heard() -> bool:
        other.send(heartbeat())
        message = joined.station.recv_msg()
        if message is not None and message.get_type() != "BAD_DATA":
            seen.add(message.get_srcSystem())
        return message is not None and message.get_type() == "GLOBAL_POSITION_INT"

    joined.until(is_heard)
    sent = joined.vehicle.bytes_of(position(77_000))
    joined.vehicle.send_bytes(sent)
    found = joined.until(
        lambda: next(
            (each for each in iter(joined.station.recv_msg, None) if getattr(each, "time_boot_ms", 0) == 77_000), None
        )
    )
    assert bytes(found.get_msgbuf()) == sent
    assert seen == {1}
    other.close()


def test_a_command_reaches_the_vehicle_unchanged_and_is_told_before(joined: Joined) -> None:
    joined.until(joined.station.recv_msg)
    joined.station.mav.request_data_stream_send(1, 1, 0, 4, 1)
    assert joined.vehicle.receive("REQUEST_DATA_STREAM").req_message_rate == 4
    assert not [each for each in joined.news() if each.commands]
    joined.station.mav.command_long_send(1, 1, mavlink.MAV_CMD_NAV_LAND, 0, 0, 0, 0, 0, 0, 0, 0)
    command = joined.vehicle.receive("COMMAND_LONG")
    assert (command.command, command.get_srcSystem()) == (mavlink.MAV_CMD_NAV_LAND, 255)
    told = [each.text for each in joined.news() if each.commands]
    assert told == ["ground station 255/0 has commanded the vehicle (MAV_CMD_NAV_LAND)"]
    joined.vehicle.send(mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_NAV_LAND, 0, 0, 0, 255, 0))
    joined.until(lambda: (got := joined.station.recv_msg()) is not None and got.get_type() == "COMMAND_ACK")


@pytest.mark.parametrize("joined", [False], indirect=True)
def test_without_that_option_nothing_of_the_station_reaches_the_vehicle(joined: Joined) -> None:
    joined.until(joined.station.recv_msg)
    joined.station.mav.command_long_send(1, 1, mavlink.MAV_CMD_NAV_LAND, 0, 0, 0, 0, 0, 0, 0, 0)
    joined.until(lambda: joined.forwarder.counts["commands are not forwarded"])
    assert not joined.forwarder.counts["passed back"]
    assert not [each for each in joined.news() if each.commands]


def test_hostile_datagrams_neither_reach_the_vehicle_nor_end_the_forwarding(joined: Joined) -> None:
    joined.until(joined.station.recv_msg)
    chance, here = random.Random(7), joined.station.port
    at = joined.forwarder._socket.getsockname()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        land = mavlink.MAVLink_command_long_message(1, 1, mavlink.MAV_CMD_NAV_LAND, 0, 0, 0, 0, 0, 0, 0, 0)
        codec = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
        stranger.sendto(bytes(land.pack(codec)), at)
        for _ in range(50):
            here.sendto(chance.randbytes(chance.randrange(1, 1500)), at)
        vehicle_like = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        here.sendto(bytes(land.pack(vehicle_like)), at)
        joined.until(lambda: joined.forwarder.counts["speaks as the vehicle"] == 1)
        assert not joined.forwarder.counts["passed back"]
        assert not [each for each in joined.news() if each.commands]
        for _ in range(3 * MOST_BACK_PER_S):
            here.sendto(bytes(land.pack(codec)), at)
        joined.until(lambda: joined.forwarder.counts["too many"])
    assert joined.forwarder.counts["passed back"] <= 2 * MOST_BACK_PER_S
    assert [each.commands for each in joined.news()].count(True) <= 3
    joined.until(joined.station.recv_msg)


def test_that_no_station_is_there_is_told_once() -> None:
    joined = Joined(commands=False)
    joined.station.close()
    joined.until(lambda: joined.forwarder.counts["not forwarded"] > 3)
    assert [each.text for each in joined.news()] == [
        f"nothing at {joined.forwarder.to} takes what is forwarded: Connection refused"
    ]
    joined.close()


def test_a_target_of_the_station_is_no_hands_and_a_change_of_its_mode_is(joined: Joined) -> None:
    """The vehicle is an ArduCopter: 4 is GUIDED, 5 LOITER."""
    joined.until(joined.station.recv_msg)
    mav = joined.station.mav

    def hands(send: Callable[[], None]) -> bool:
        def orders() -> list[StationReport]:
            return [each for each in joined.news() if "has commanded" in each.text]

        passed, before = joined.forwarder.counts["passed back"], len(orders())
        joined.forwarder._told_s = 0.0
        send()
        joined.until(lambda: joined.forwarder.counts["passed back"] > passed)
        (told,) = orders()[before:]
        return told.commands

    def long(number: int, *params: float) -> Callable[[], None]:
        return lambda: mav.command_long_send(1, 1, number, 0, *params, *(0.0,) * (7 - len(params)))

    place = (580000000, 150000000)
    assert not hands(long(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0))
    assert not hands(
        lambda: mav.command_int_send(1, 1, 0, mavlink.MAV_CMD_DO_REPOSITION, 0, 0, -1, 0, 0, 0, *place, 90.0)
    )
    assert not hands(
        lambda: mav.set_position_target_global_int_send(0, 1, 1, 6, 0b110111111000, *place, 50.0, *(0.0,) * 8)
    )
    assert not hands(long(mavlink.MAV_CMD_DO_SET_MODE, 1.0, 4.0))
    assert not hands(lambda: mav.set_mode_send(1, 1, 4))
    assert hands(long(mavlink.MAV_CMD_DO_SET_MODE, 1.0, 5.0))
    assert hands(long(mavlink.MAV_CMD_DO_SET_MODE, 1.0, float("nan")))
    assert hands(lambda: mav.set_mode_send(1, 1, 5))
    assert hands(long(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH))
    assert hands(lambda: mav.rc_channels_override_send(1, 1, *(1500,) * 8))


def frame(message: Any, version: int = 2) -> Any:
    codec = mavlink.MAVLink(None, srcSystem=255)
    (found,) = Cutter().cut(bytes(message.pack(codec, force_mavlink1=version == 1)))
    return found


@pytest.mark.parametrize("version", [1, 2])
def test_what_asks_is_no_command_and_everything_else_is(version: int) -> None:
    def long(number: int) -> Any:
        return mavlink.MAVLink_command_long_message(1, 1, number, 0, 0, 0, 0, 0, 0, 0, 0)

    assert command_in(frame(long(mavlink.MAV_CMD_REQUEST_MESSAGE), version)) == ""
    assert command_in(frame(long(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL), version)) == ""
    assert command_in(frame(long(mavlink.MAV_CMD_DO_SET_MODE), version)) == "MAV_CMD_DO_SET_MODE"
    assert command_in(frame(long(0), version)) == "command 0"
    assert command_in(frame(mavlink.MAVLink_param_request_list_message(1, 1), version)) == ""
    assert command_in(frame(mavlink.MAVLink_set_mode_message(1, 1, 4), version)) == "SET_MODE"
    assert command_in(frame(mavlink.MAVLink_param_set_message(1, 1, b"X", 1, 9), version)) == "PARAM_SET"
