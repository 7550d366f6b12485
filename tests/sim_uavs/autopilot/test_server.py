"""The thread and the socket around an autopilot, over real UDP on this machine."""

import socket
import threading
import time

import pytest
from pymavlink.dialects.v20 import all as mavlink

from dyknow.federation.members.clock import FederationClock
from dyknow.sim_uavs.autopilot.server import AutopilotServer, together
from dyknow.sim_uavs.dynamics.faults import SimulatedFault
from dyknow.sim_uavs.dynamics.settings import VehicleConfig
from tests.sim_uavs.station import HOME
from tests.sim_uavs.truth import true_motion_of

pytestmark = pytest.mark.live


@pytest.fixture
def ear():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listening:
        listening.bind(("127.0.0.1", 0))
        listening.settimeout(5.0)
        yield listening


def heard(ear, name):
    """The next message of a type, or a TimeoutError."""
    while True:
        for message in mavlink.MAVLink(None).parse_buffer(ear.recvfrom(2000)[0]) or ():
            if message.get_type() == name:
                return message


def test_what_leaves_in_one_go_is_few_datagrams_in_order() -> None:
    one, other = ("127.0.0.1", 1), ("127.0.0.1", 2)
    sent = [(one, b"a" * 300), (other, b"x"), (one, b"b" * 300), (one, b"c" * 900), (other, b"y")]
    assert list(together(sent)) == [(one, b"a" * 300 + b"b" * 300), (one, b"c" * 900), (other, b"xy")]
    assert list(together([])) == []


def test_it_tells_its_given_peers_and_obeys_who_speaks_to_its_port(ear) -> None:
    config = VehicleConfig(7, HOME, peers=(ear.getsockname(),))
    with AutopilotServer(config) as server:
        assert heard(ear, "HEARTBEAT").get_srcSystem() == 7
        requester = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
        order = mavlink.MAVLink_command_long_message(7, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0).pack(requester)
        ear.sendto(order, ("127.0.0.1", server.port))
        assert heard(ear, "COMMAND_ACK").result == 0
        assert true_motion_of(server).armed


def test_its_time_runs_at_the_speed_of_its_federation(ear) -> None:
    config = VehicleConfig(1, HOME, peers=(ear.getsockname(),))
    clock = FederationClock(epoch_us=time.time_ns() // 1000, speed=20.0)
    with AutopilotServer(config, clock=clock):
        started, first = time.monotonic(), heard(ear, "GLOBAL_POSITION_INT").time_boot_ms
        while (last := heard(ear, "GLOBAL_POSITION_INT").time_boot_ms) < first + 10_000:
            pass
        took_s = time.monotonic() - started
    assert (last - first) / 1000 / took_s == pytest.approx(20.0, rel=0.5)


def test_faults_are_injected_while_it_runs_and_end_on_their_own(ear) -> None:
    config = VehicleConfig(1, HOME, peers=(ear.getsockname(),))
    clock = FederationClock(epoch_us=time.time_ns() // 1000, speed=10.0)
    with AutopilotServer(config, clock=clock) as server:
        heard(ear, "GLOBAL_POSITION_INT")
        until_us = server.inject(SimulatedFault("silence"), 5_000_000)
        ear.settimeout(0.2)
        with pytest.raises(TimeoutError):
            while True:
                ear.recvfrom(2000)
        ear.settimeout(5.0)
        heard(ear, "GLOBAL_POSITION_INT")
        assert server.now_us() >= until_us
        assert server.inject(SimulatedFault("gps-loss")) is None
        while heard(ear, "GPS_RAW_INT").fix_type > 1:
            pass
        server.inject(SimulatedFault("gps-loss"), 0)
        while heard(ear, "GPS_RAW_INT").fix_type < 3:
            pass


def test_a_peer_that_closed_its_port_stops_nobody(ear) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as gone:
        gone.bind(("127.0.0.1", 0))
        closed = gone.getsockname()
    config = VehicleConfig(1, HOME, peers=(closed, ear.getsockname()))
    with AutopilotServer(config):
        stamps = [heard(ear, "GLOBAL_POSITION_INT").time_boot_ms for _ in range(10)]
    assert stamps[-1] - stamps[0] == 900


def test_stopping_frees_the_port_whether_it_ever_started_or_stopped_before() -> None:
    idle = AutopilotServer(VehicleConfig(1, HOME))
    ports = [idle.port]
    idle.stop()
    with AutopilotServer(VehicleConfig(1, HOME)) as running:
        ports.append(running.port)
        running.stop()
    for port in ports:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as next_user:
            next_user.bind(("127.0.0.1", port))
    assert "autopilot-1" not in {thread.name for thread in threading.enumerate()}


def test_given_peers_may_have_names_and_are_told_once(ear) -> None:
    config = VehicleConfig(1, HOME, peers=(("localhost", ear.getsockname()[1]),))
    with AutopilotServer(config) as server:
        assert server.config.peers == (ear.getsockname(),)
        hello = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3)
        ear.sendto(hello.pack(mavlink.MAVLink(None, srcSystem=255)), ("127.0.0.1", server.port))
        stamps = [heard(ear, "GLOBAL_POSITION_INT").time_boot_ms for _ in range(8)]
    assert len(set(stamps)) == 8


def test_it_is_on_loopback_only_unless_a_peer_is_elsewhere() -> None:
    here = AutopilotServer(VehicleConfig(1, HOME))
    there = AutopilotServer(VehicleConfig(1, HOME, peers=(("192.0.2.7", 14550),)))  # never started: nothing is sent
    try:
        assert here._socket.getsockname()[0] == "127.0.0.1"
        assert there._socket.getsockname()[0] == "0.0.0.0"
        assert there._elsewhere == {"192.0.2.7"}
    finally:
        here.stop()
        there.stop()
