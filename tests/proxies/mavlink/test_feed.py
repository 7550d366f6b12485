"""Real datagrams on loopback, honest and hostile."""

import queue
import random
import time
from collections.abc import Iterator

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.model.errors import EndpointFailed, TextError
from dyknow.navigation.vehicle import (
    Arm,
    BatteryReport,
    Command,
    CommandResult,
    GoToOrder,
    HomeReport,
    PositionReport,
    Report,
    SetGuided,
    StatusReport,
    TakeOffOrder,
    VelocityReport,
)
from dyknow.proxies.mavlink.endpoints import parse_endpoint
from dyknow.proxies.mavlink.feed import MavlinkFeed
from dyknow.proxies.mavlink.port import MavlinkPort
from tests.proxies.vehicle import Wire, heartbeat, position, unknown_frame

KEY = bytes(range(32))


def now_us() -> int:
    return time.time_ns() // 1000


class Posted:
    """What a feed posted, to be waited for."""

    def __init__(self) -> None:
        self.queue: queue.Queue[Report] = queue.Queue()

    def next(self, kind: type, timeout: float = 5.0) -> Report:
        while True:
            found = self.queue.get(timeout=timeout)
            if isinstance(found, kind):
                return found

    def all(self) -> list[Report]:
        found = []
        while not self.queue.empty():
            found.append(self.queue.get_nowait())
        return found


@pytest.fixture
def posted() -> Posted:
    return Posted()


@pytest.fixture
def feed(posted: Posted) -> Iterator[MavlinkFeed]:
    feed = MavlinkFeed("udpin:127.0.0.1:0", 1, posted.queue.put, now_us)
    feed.start()
    yield feed
    feed.stop()


@pytest.fixture
def wire(feed: MavlinkFeed) -> Iterator[Wire]:
    wire = Wire(feed.port.address)
    yield wire
    wire.close()


def test_units_are_converted_once_and_valid_time_is_close_to_arrival(wire: Wire, posted: Posted) -> None:
    before = now_us()
    wire.send(position(5000))
    velocity, found = posted.next(VelocityReport), posted.next(PositionReport)
    assert (found.latitude_deg, found.longitude_deg, found.altitude_m, found.height_m) == (47.0, 8.0, 510.0, 10.0)
    assert (velocity.north_m_s, velocity.east_m_s, velocity.down_m_s) == (1.2, -0.3, 0.05)
    assert found.horizontal_sd_m is None, "the message states no accuracy"
    assert before <= found.valid_us <= now_us()


def test_status_battery_and_home_are_reported(wire: Wire, posted: Posted) -> None:
    wire.send(heartbeat())
    assert posted.next(StatusReport)[1:] == (True, True, True, "GUIDED")
    wire.send(mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 12_000, 1_250, 63, 0, 0, 0, 0, 0, 0))
    assert posted.next(BatteryReport)[1:] == (0.63, 12.5)
    wire.send(mavlink.MAVLink_home_position_message(470000000, 80000000, 500000, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0))
    assert posted.next(HomeReport)[1:] == (47.0, 8.0, 500.0)


def test_the_vehicle_is_asked_for_its_messages_and_hears_a_ground_station(wire: Wire) -> None:
    wire.send(heartbeat())
    asked = wire.receive("COMMAND_LONG")
    assert asked.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
    assert asked.get_srcSystem() == 254
    while (asked := wire.receive("COMMAND_LONG")).command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
        assert asked.target_system == 1
    assert asked.param1 == mavlink.MAVLINK_MSG_ID_HOME_POSITION
    assert wire.receive("HEARTBEAT").type == mavlink.MAV_TYPE_GCS


def test_an_order_is_repeated_until_it_is_acknowledged(wire: Wire, feed: MavlinkFeed, posted: Posted) -> None:
    wire.send(heartbeat())
    posted.next(StatusReport)
    feed.command(Command(7, Arm()))
    while (first := wire.receive("COMMAND_LONG")).command != mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
        pass
    while (second := wire.receive("COMMAND_LONG")).command != mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
        pass
    assert (first.confirmation, second.confirmation) == (0, 1)
    wire.send(mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_RESULT_ACCEPTED))
    assert posted.next(CommandResult)[1:] == (7, True, "")


def test_a_refusal_and_silence_are_told_with_their_reason(wire: Wire, feed: MavlinkFeed, posted: Posted) -> None:
    feed.command(Command(1, Arm()))
    assert posted.next(CommandResult)[1:] == (1, False, "no vehicle heard")
    wire.send(heartbeat())
    posted.next(StatusReport)
    feed.command(Command(2, TakeOffOrder(12.0)))
    while (taken := wire.receive("COMMAND_LONG")).command != mavlink.MAV_CMD_NAV_TAKEOFF:
        pass
    assert taken.param7 == 12.0
    wire.send(mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_RESULT_DENIED))
    assert posted.next(CommandResult)[1:] == (2, False, "denied")
    feed.command(Command(3, SetGuided()))
    assert posted.next(CommandResult)[1:] == (3, False, "no answer")


def test_a_point_is_sent_as_integers_and_never_takes_the_mode_from_an_ardupilot(
    wire: Wire, feed: MavlinkFeed, posted: Posted
) -> None:
    wire.send(heartbeat())
    posted.next(StatusReport)
    feed.command(Command(4, GoToOrder(47.0000001, -8.5, 520.0, 6.0)))
    sent = wire.receive("COMMAND_INT")
    assert (sent.x, sent.y, sent.z, sent.frame) == (470000001, -85000000, 520.0, mavlink.MAV_FRAME_GLOBAL)
    assert (sent.param1, sent.param2) == (6.0, 0.0)


def test_several_vehicles_on_one_port_are_told_apart() -> None:
    port = MavlinkPort("udpin:127.0.0.1:0")
    boxes = {system: Posted() for system in (1, 2, 3)}
    feeds = [MavlinkFeed(port, system, box.queue.put, now_us) for system, box in boxes.items()]
    for feed in feeds:
        feed.start()
    wires = [Wire(port.address, system=system) for system in boxes]
    for k, wire in enumerate(wires, 1):
        wire.send(heartbeat(), position(1000, lat=40.0 + k))
    for system, box in boxes.items():
        assert box.next(PositionReport).latitude_deg == 40.0 + system
    for feed in feeds:
        feed.stop()
    for wire in wires:
        wire.close()
    assert not any(isinstance(each, PositionReport) for box in boxes.values() for each in box.all())


def test_without_a_system_id_the_first_autopilot_is_taken_and_kept() -> None:
    posted = Posted()
    feed = MavlinkFeed("udpin:127.0.0.1:0", None, posted.queue.put, now_us)
    feed.start()
    station, nine, ten = (Wire(feed.port.address, system=system) for system in (255, 9, 10))
    station.send(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 0, 3))
    nine.send(heartbeat(), position(1000, lat=9.0))
    assert posted.next(PositionReport).latitude_deg == 9.0
    ten.send(heartbeat(), position(1000, lat=10.0))
    nine.send(position(1100, lat=9.1))
    assert posted.next(PositionReport).latitude_deg == 9.1
    assert feed.system == 9
    feed.stop()
    for wire in (station, nine, ten):
        wire.close()


def test_what_is_forged_or_damaged_is_counted_and_never_posted(wire: Wire, feed: MavlinkFeed, posted: Posted) -> None:
    wire.send(heartbeat())
    posted.next(StatusReport)
    honest = wire.bytes_of(position(1000))
    rng = random.Random(5)
    sent = 0
    for _ in range(2000):
        mutant = bytearray(honest)
        for _ in range(rng.randint(1, 4)):
            mutant[rng.randrange(len(mutant))] ^= 1 << rng.randrange(8)
        if bytes(mutant) != honest:
            wire.send_bytes(bytes(mutant))
            sent += 1
        if sent % 100 == 0:
            wire.send(heartbeat())
            posted.next(StatusReport)  # let the receiver keep up: a full socket buffer would hide mutants
    wire.send_bytes(unknown_frame(1))
    wire.send(mavlink.MAVLink_ping_message(1, 1, 0, 0))
    wire.send_bytes(honest[:-3])
    wire.send_bytes(b"")
    wire.send_bytes(bytes(rng.randrange(256) for _ in range(3000)))
    thief = Wire(feed.port.address, system=1)
    thief.send(position(1100, lat=10.0))
    foreign = Wire(feed.port.address, system=77)
    foreign.send(heartbeat(), position(1100, lat=11.0))
    camera = Wire(feed.port.address, system=1, component=100)
    camera.send(position(1100, lat=12.0))
    wire.send(position(1200, lat=48.0))
    assert posted.next(PositionReport).latitude_deg == 48.0, "the first position that passes is the honest one"
    counts = feed.port.counts
    assert counts["foreign address"] >= 1
    assert counts["other system"] >= 2
    assert counts["other component"] >= 1
    assert counts["not wanted"] >= 1
    assert counts["damaged"] > 500
    for each in (thief, foreign, camera):
        each.close()


def test_with_a_key_only_signed_frames_pass_and_each_only_once() -> None:
    posted = Posted()
    feed = MavlinkFeed("udpin:127.0.0.1:0", 1, posted.queue.put, now_us, key=KEY)
    feed.start()
    signed = Wire(feed.port.address, key=KEY)
    signed.codec.signing.timestamp = int((time.time() - 1_420_070_400) * 1e5)
    frame = signed.bytes_of(position(1000, lat=1.0))
    signed.send_bytes(frame)
    assert posted.next(PositionReport).latitude_deg == 1.0
    signed.send_bytes(frame)
    unsigned = Wire(feed.port.address)
    unsigned.send(position(1100, lat=2.0))
    other = Wire(feed.port.address, key=bytes(32))
    other.send(position(1200, lat=3.0))
    signed.send(position(1300, lat=4.0))
    assert posted.next(PositionReport).latitude_deg == 4.0
    assert feed.port.counts["unsigned or unreadable"] == 3
    feed.stop()
    for each in (signed, unsigned, other):
        each.close()


def test_an_endpoint_that_is_none_says_what_one_looks_like() -> None:
    for right in ("udpout:10.0.0.1:14550", "udpin:[::1]:1", "tcp:sitl.local:5760", "serial:/dev/ttyACM0:921600"):
        assert str(parse_endpoint(right)) == right
    assert parse_endpoint("serial:/dev/ttyACM0") == ("serial", "/dev/ttyACM0", 57_600)
    for wrong in ("udpin:14550", "udpin::1", "udpin:h:70000", "udpin:h:x", "serial:", "tcp:5760", ""):
        with pytest.raises(TextError, match=r"udpin:127\.0\.0\.1:14550"):
            parse_endpoint(wrong)
    for open_to_both in ("udp:127.0.0.1:14550", "127.0.0.1:14550"):
        with pytest.raises(TextError, match=r"udpin:127\.0\.0\.1:14550 if vehicles send there, udpout:"):
            parse_endpoint(open_to_both)


def test_only_a_cable_or_loopback_is_local() -> None:
    local = ("udpin:127.0.0.1:1", "udpout:[::1]:1", "tcp:localhost:1", "tcp:127.9.9.9:1", "serial:/dev/ttyUSB0:57600")
    assert all(parse_endpoint(text).is_local for text in local)
    beyond = ("udpin:0.0.0.0:1", "tcp:127.0.0.1.nip.io:1", "udpout:10.0.0.1:1", "udpin:[::]:1")
    assert not any(parse_endpoint(text).is_local for text in beyond)


def test_a_port_in_use_is_named_with_its_remedy() -> None:
    held = MavlinkPort("udpin:127.0.0.1:0")
    with pytest.raises(EndpointFailed, match="another ground station"):
        MavlinkPort(f"udpin:127.0.0.1:{held.address[1]}")
    with pytest.raises(EndpointFailed, match="name an address of this machine"):
        MavlinkPort("udpin:192.0.2.1:0")


def test_a_vehicle_that_waits_to_be_spoken_to_is_called_and_heard() -> None:
    """`udpout`: ours is the first word, a heartbeat."""
    listening = Wire(("127.0.0.1", 1))
    posted = Posted()
    host, port = listening.socket.getsockname()
    feed = MavlinkFeed(f"udpout:{host}:{port}", 1, posted.queue.put, now_us)
    feed.start()
    _, sender = listening.socket.recvfrom(1000)
    listening.to = ("127.0.0.1", sender[1])
    listening.send(heartbeat(), position(1000, lat=3.0))
    assert posted.next(PositionReport).latitude_deg == 3.0
    feed.stop()
    listening.close()


def test_a_handler_that_raises_does_not_end_the_hearing(wire: Wire, feed: MavlinkFeed, posted: Posted) -> None:
    honest, feed._post = feed._post, lambda _report: 1 / 0
    wire.send(heartbeat())
    deadline = time.monotonic() + 5
    while not feed.port.counts["failed: ZeroDivisionError"] and time.monotonic() < deadline:
        wire.send(heartbeat())
        wire.receive("HEARTBEAT", "COMMAND_LONG")
    feed._post = honest
    wire.send(position(1000, lat=4.0))
    assert posted.next(PositionReport).latitude_deg == 4.0


def test_after_a_reboot_the_vehicle_is_asked_again(wire: Wire, feed: MavlinkFeed, posted: Posted) -> None:
    home = mavlink.MAVLink_home_position_message(470000000, 80000000, 500000, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0)
    wire.send(heartbeat(), position(600_000), home)
    posted.next(HomeReport)
    assert feed.known.home is not None
    wire.send(*(position(1000 + k, lat=5.0) for k in range(3)), heartbeat())
    assert posted.next(PositionReport).latitude_deg in {47.0, 5.0}
    posted.next(StatusReport)
    assert feed.clock.reboots == 1
    assert feed.known.home is None
    while wire.receive("COMMAND_LONG").command != mavlink.MAV_CMD_REQUEST_MESSAGE:
        pass


def test_a_home_that_was_set_long_ago_holds_now(wire: Wire, posted: Posted) -> None:
    """PX4 stamps HOME_POSITION with the time at which home was set."""
    wire.send(heartbeat(autopilot=mavlink.MAV_AUTOPILOT_PX4), position(600_000))
    posted.next(PositionReport)
    before = now_us()
    wire.send(
        mavlink.MAVLink_home_position_message(470000000, 80000000, 500000, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0, 3_000_000)
    )
    assert before <= posted.next(HomeReport).valid_us <= now_us()
