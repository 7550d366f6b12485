"""Each vehicle is joined, whatever it speaks and over whatever it is reached, or why not is reported within 5 s."""

import os
import queue
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.navigation.vehicle import LinkReport, PositionReport, Report
from dyknow.proxies.mavlink.feed import MavlinkFeed
from dyknow.proxies.mavlink.port import MavlinkPort
from tests.proxies.vehicle import Wire, heartbeat, position

KEY = bytes(range(32))
WITHIN_US = 5_000_000
PATIENCE_S = 30.0
"""A loaded machine may take long to show a report; when it was made is in the report."""


def now_us() -> int:
    return time.time_ns() // 1000


def fix(kind: int) -> Any:
    return mavlink.MAVLink_gps_raw_int_message(0, kind, 0, 0, 0, 65_535, 65_535, 65_535, 65_535, 0)


class Joined:
    """A feed and what it posts."""

    def __init__(self, endpoint: str | MavlinkPort, sysid: int | None = None, **more: Any) -> None:
        self.reports: queue.Queue[Report] = queue.Queue()
        self.feed = MavlinkFeed(endpoint, sysid, self.reports.put, now_us, **more)
        self.started_us = now_us()
        self.feed.start()

    def close(self) -> None:
        self.feed.stop()

    def next(self, kind: type, while_: Callable[[], None] = lambda: None) -> Any:
        """The next report of that kind; `while_` is called until it comes."""
        ends_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < ends_s:
            while_()
            try:
                found = self.reports.get(timeout=0.1)
            except queue.Empty:
                continue
            if isinstance(found, kind):
                return found
        raise TimeoutError(f"no {kind.__name__} in {PATIENCE_S} s")

    def link(self, while_: Callable[[], None] = lambda: None, *, ok: bool = True) -> str:
        """The text of the next report of the link that is, or is not, well."""
        while True:
            found: LinkReport = self.next(LinkReport, while_)
            if found.ok == ok:
                self.reported_us = found.valid_us
                return found.text


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


class Autopilot(Wire):
    """Sends its position once it was asked for it in a version that it understands; a system of its own."""

    def __init__(self, to: tuple[str, int], understands: tuple[int, ...], **more: Any) -> None:
        super().__init__(to, **more)
        self.understands, self.heard, self.is_asked = understands, set[int](), False
        self.socket.setblocking(False)

    def turn(self) -> None:
        """One heartbeat, and what follows from what was heard."""
        self.send(heartbeat())
        while True:
            try:
                data = self.socket.recv(65_535)
            except BlockingIOError:
                break
            version = 1 if data[0] == 0xFE else 2
            self.heard.add(version)
            for message in self.reader.parse_buffer(data) or []:
                here = version in self.understands and message.get_type() == "COMMAND_LONG"
                if here and message.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
                    self.is_asked = self.is_asked or message.target_component == self.codec.srcComponent
        if self.is_asked:
            self.send(position(round(time.monotonic() * 1000)))


@pytest.mark.parametrize(("version", "component"), [(1, 1), (2, 1), (1, 0), (2, 0), (2, 7)])
def test_a_vehicle_is_answered_in_the_version_and_as_the_component_that_it_speaks_as(stack, version, component) -> None:
    joined = stack.enter_context(closing(Joined("udpin:127.0.0.1:0")))
    wire = Autopilot(joined.feed.port.address, (version,), component=component, version=version)
    stack.enter_context(closing(wire))
    assert joined.link(wire.turn) == f"hears system 1, ArduCopter, MAVLink {version}"
    joined.next(PositionReport, wire.turn)
    assert wire.heard == {version}


def test_from_the_first_frame_of_version_2_on_a_vehicle_is_answered_in_2(stack) -> None:
    joined = stack.enter_context(closing(Joined("udpin:127.0.0.1:0")))
    wire = Autopilot(joined.feed.port.address, (1, 2), version=1)
    stack.enter_context(closing(wire))
    joined.next(PositionReport, wire.turn)
    assert wire.heard == {1}
    wire.version, wire.heard = 2, set()
    assert joined.link(wire.turn) == "hears system 1, ArduCopter, MAVLink 2"
    wire.turn()
    wire.heard.clear()
    joined.feed.port.send(1, heartbeat())
    joined.next(PositionReport, wire.turn)
    assert wire.heard == {2}


def test_two_vehicles_on_a_port_are_two_and_a_third_is_named(stack) -> None:
    port = MavlinkPort("udpin:127.0.0.1:0")
    feeds = {system: stack.enter_context(closing(Joined(port, system))) for system in (1, 2)}
    wires = [Autopilot(port.address, (1, 2), system=system, version=1 + system % 2) for system in (1, 2, 3)]
    for wire in wires:
        stack.enter_context(closing(wire))

    def turn() -> None:
        for wire in reversed(wires):
            wire.turn()

    texts = [feeds[system].link(turn) for system in (1, 2)]
    assert texts == [
        "hears system 1, ArduCopter, MAVLink 2; system 3 there too (--sysid)",
        "hears system 2, ArduCopter, MAVLink 1; system 3 there too (--sysid)",
    ]


def test_a_tcp_server_that_ends_and_comes_again_is_heard_again(stack) -> None:
    server = stack.enter_context(closing(socket.create_server(("127.0.0.1", 0))))
    host, number = server.getsockname()
    joined = stack.enter_context(closing(Joined(f"tcp:{host}:{number}", 1)))
    wire = stack.enter_context(closing(Wire((host, number))))
    for _ in range(2):
        connection, _ = server.accept()
        server.close()
        data = wire.bytes_of(heartbeat()) + wire.bytes_of(position(round(time.monotonic() * 1000)))
        for at in range(0, len(data), 7):
            connection.sendall(data[at : at + 7])
        joined.next(PositionReport)
        connection.close()
        text = joined.link(ok=False)
        assert text.startswith(f"tcp:{host}:{number} is not open: ")
        server = stack.enter_context(closing(socket.create_server((host, number))))


def test_a_serial_line_is_heard_and_opened_again_when_it_was_pulled(stack, tmp_path: Path) -> None:
    line = tmp_path / "ttyACM0"
    joined = stack.enter_context(closing(Joined(f"serial:{line}:921600", 1)))
    assert "No such file or directory: is it plugged in?" in joined.link(ok=False)
    wire = stack.enter_context(closing(Wire(("127.0.0.1", 1))))
    wire.reader.robust_parsing = True  # what was sent before the line was opened came back as an echo
    for turn in range(2):
        ours, theirs = os.openpty()
        line.unlink(missing_ok=True)
        line.symlink_to(os.ttyname(theirs))

        def speak(ours: int = ours) -> None:
            os.write(ours, wire.bytes_of(heartbeat()) + wire.bytes_of(position(round(time.monotonic() * 1000))))

        joined.next(PositionReport, speak)
        if turn == 0:
            while not any(
                each.get_type() == "COMMAND_LONG" for each in wire.reader.parse_buffer(os.read(ours, 4096)) or []
            ):
                speak()
        os.close(theirs)
        os.close(ours)


def _closed_port() -> int:
    with closing(socket.create_server(("127.0.0.1", 0))) as server:
        return int(server.getsockname()[1])


def test_why_no_vehicle_is_heard_is_reported_in_time(stack) -> None:
    """All cases at once: each takes as long as something must be wrong before it is reported."""
    cases: list[tuple[Joined, str, Callable[[], None]]] = []

    def case(
        expected: str,
        *messages: Any,
        first: tuple[Any, ...] = (),
        sysid: int | None = None,
        wire: dict[str, Any] | None = None,
        **more: Any,
    ) -> None:
        joined = stack.enter_context(closing(Joined("udpin:127.0.0.1:0", sysid, **more)))
        speaker = stack.enter_context(closing(Wire(joined.feed.port.address, **wire or {})))
        speaker.send(*first)
        cases.append((joined, expected, lambda: speaker.send(*messages)))

    case("waiting for a HEARTBEAT at udpin:127.0.0.1:0")
    case("heard system 1; not 77 (--sysid)", heartbeat(), sysid=77)
    case("heard HEARTBEAT from 42/0; only component 1 is taken (--compid)", heartbeat(), compid=1,
         wire={"system": 42, "component": 0})  # fmt: skip
    station = mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 0, 3)
    case("heard a ground station, 255/190, and no vehicle", station, wire={"system": 255, "component": 190})
    case("heard 1/1, but no HEARTBEAT of an autopilot", position(1000))
    case("heard MAVLink 1, which cannot be signed: set the vehicle to MAVLink 2, or leave out --signing-key",
         heartbeat(), key=KEY, wire={"version": 1})  # fmt: skip
    case("heard frames without a signature: set up the same key in the vehicle (--signing-key)", heartbeat(), key=KEY)
    case("heard frames that are signed with another key (--signing-key)", heartbeat(), key=KEY, wire={"key": bytes(32)})
    case("hears system 1, ArduCopter, no GPS fix", heartbeat(), fix(1))
    case(
        "hears system 1, ArduCopter: no position, no answer to requests in MAVLink 1", heartbeat(), wire={"version": 1}
    )
    case("hears system 1, ArduCopter: no answer to requests; its frames are signed, give its key (--signing-key)",
         heartbeat(), wire={"key": KEY})  # fmt: skip
    acknowledged = mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0)
    case("hears system 1, ArduCopter: no position yet", heartbeat(), acknowledged)
    case("system 1, ArduCopter: position without GPS", heartbeat(), position(1000), fix(1),
         first=(heartbeat(), fix(3)))  # fmt: skip
    number = _closed_port()
    refused = stack.enter_context(closing(Joined(f"tcp:127.0.0.1:{number}")))
    why = "Connection refused: no server listens there yet; it is tried again every second"
    cases.append((refused, f"tcp:127.0.0.1:{number} is not open: {why}", lambda: None))
    noise = stack.enter_context(closing(Joined("udpin:127.0.0.1:0")))
    speaker = stack.enter_context(closing(Wire(noise.feed.port.address)))
    cases.append((noise, "hears bytes at udpin:127.0.0.1:0, but no MAVLink", lambda: speaker.send_bytes(b"hello " * 9)))

    def turn() -> None:
        for _, _, speak in cases:
            speak()

    found = [joined.link(turn, ok=False) for joined, _, _ in cases]
    assert found == [expected for _, expected, _ in cases]
    assert all(joined.reported_us - joined.started_us < WITHIN_US for joined, _, _ in cases)


def test_a_vehicle_that_comes_and_goes_is_reported_a_few_times_only(stack) -> None:
    """Monotonic time is an argument of the condition: a minute of a bad link is played at once."""
    from dyknow.proxies.mavlink.condition import VehicleCondition
    from dyknow.proxies.mavlink.reports import VehicleReports
    from dyknow.proxies.mavlink.requests import Requests

    port = stack.enter_context(closing(Joined("udpin:127.0.0.1:0", 1))).feed.port
    condition, known, requests = VehicleCondition(port.hearing, 1, 1), VehicleReports(), Requests()
    found = []
    for second in range(600):
        at_us = second * 1_000_000
        if second % 10 < 3:
            condition.on_heartbeat(at_us)
            condition.on_position(at_us)
        found.append(condition.on_time(1, port, known, requests, at_us))
    reported = [each for each in found if each is not None]
    assert {each.ok for each in reported} == {True, False}
    assert len(reported) <= 4 + 60
    assert len(reported) > 20
