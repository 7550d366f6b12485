"""What faults look like from the other end of the link, and what hostile bytes do to a vehicle: nothing."""

import os
import re
import struct
from itertools import pairwise
from math import isnan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from dyknow.navigation.geodesy import distance_m
from dyknow.proxies.mavlink.frames import Cutter
from dyknow.sim_uavs.autopilot.link import READ
from tests.sim_uavs.station import HOME, Station
from tests.strategies import examples

PEER = ("127.0.0.1", 9)
FULL = bool(os.environ.get("DYKNOW_FULL"))


def positions(station):
    return [(m.lat, m.lon, m.alt) for m in station.of_type("GLOBAL_POSITION_INT")]


def aloft(**config) -> Station:
    station = Station(airborne_m=30.0, **config)
    station.run(2)
    station.heard.clear()
    return station


def test_a_silent_vehicle_neither_speaks_nor_hears_and_returns() -> None:
    station = aloft()
    station.inject("silence", 3.0)
    station.run(2.5)
    assert not station.send(mavlink.MAVLink_command_long_message(1, 1, 21, 0, *[0.0] * 7))
    assert not station.heard
    station.run(3)
    assert len(positions(station)) in {25, 26}
    assert station.truth.mode.value == "GUIDED", "the order to land was not heard"


def test_a_frozen_position_repeats_while_time_goes_on() -> None:
    station = aloft()
    station.command_int(
        192, 6, (-1, 1, 0, 0), round((HOME.latitude_deg + 1e-3) * 1e7), round(HOME.longitude_deg * 1e7), 30.0
    )
    station.heard.clear()
    station.inject("frozen-position", 5.0)
    station.run(4.9)
    assert len(set(positions(station))) == 1
    stamps = [m.time_boot_ms for m in station.of_type("GLOBAL_POSITION_INT")]
    assert all(a < b for a, b in pairwise(stamps))
    station.run(2)
    assert len(set(positions(station))) > 10


def test_a_teleported_position_is_that_far_away_and_comes_back() -> None:
    station = aloft()
    station.inject("teleport=500", 2.0)
    station.run(1.9)
    for lat, lon, _ in positions(station):
        assert distance_m(lat / 1e7, lon / 1e7, *HOME[:2]) == pytest.approx(500.0, abs=3.0)
    station.heard.clear()
    station.run(1)
    lat, lon, _ = positions(station)[-1]
    assert distance_m(lat / 1e7, lon / 1e7, *HOME[:2]) < 3.0


def test_what_is_not_a_number_is_so_on_the_wire() -> None:
    station = aloft()
    station.inject("nan")
    station.run(1)
    assert isnan(station.last("LOCAL_POSITION_NED").x)
    assert station.last("GLOBAL_POSITION_INT").lat == -(2**31), "what a cast of NaN to an integer gives"
    assert station.last("HEARTBEAT")


def test_without_gps_there_is_no_position_no_fix_and_no_arming() -> None:
    station = Station()
    station.inject("gps-loss")
    station.run(2)
    assert not positions(station)[2:]
    assert station.last("GPS_RAW_INT").fix_type <= 1
    gps = mavlink.MAV_SYS_STATUS_SENSOR_GPS
    status = station.last("SYS_STATUS")
    assert status.onboard_control_sensors_present & gps
    assert not status.onboard_control_sensors_health & gps
    assert station.command(400, 1) == mavlink.MAV_RESULT_TEMPORARILY_REJECTED


def test_packets_are_lost_each_way_in_the_stated_proportion() -> None:
    station = aloft()
    station.inject("packet-loss=30")
    station.run(60)
    assert len(positions(station)) / 600 == pytest.approx(0.7, abs=0.06)
    answered = sum(bool(station.send(mavlink.MAVLink_timesync_message(0, 1))) for _ in range(1000))
    assert answered / 1000 == pytest.approx(0.49, abs=0.06)


def test_a_wrong_clock_moves_utc_and_a_drifting_one_both_times() -> None:
    station = aloft()
    station.inject("clock=+5s")
    station.run(1.1)
    told = station.last("SYSTEM_TIME")
    boot_us = station.now_us // 1_000_000 * 1_000_000 - told.time_boot_ms * 1000
    assert told.time_unix_usec - told.time_boot_ms * 1000 == boot_us + 5_000_000
    station.inject("clock=+5s", 0)
    station.inject("clock-drift=1000")
    station.run(10)
    assert station.last("SYSTEM_TIME").time_unix_usec % 1_000_000 == pytest.approx(10_000, abs=1000)


def test_a_battery_made_low_is_reported() -> None:
    station = aloft()
    station.inject("battery-low=20")
    station.run(2)
    assert station.last("SYS_STATUS").battery_remaining in {19, 20}
    assert station.last("BATTERY_STATUS").battery_remaining in {19, 20}
    assert any("Battery low" in m.text for m in station.of_type("STATUSTEXT"))


def test_noisy_gps_states_its_lower_accuracy() -> None:
    station = aloft()
    station.run(1)
    before = station.last("GPS_RAW_INT").h_acc
    station.inject("gps-noise=10")
    station.run(1)
    assert station.last("GPS_RAW_INT").h_acc == pytest.approx(10 * before, rel=0.02)


def sound_frame(kind, payload, system=255) -> bytes:
    """A frame of a type a vehicle reads with any payload at all, and a right checksum."""
    header = struct.pack("<BBBBBBBHB", 0xFD, len(payload), 0, 0, 0, system, 190, kind & 0xFFFF, kind >> 16)
    crc = mavlink.x25crc(bytearray(header[1:] + payload + bytes([mavlink.mavlink_map[kind].crc_extra])))
    return header + payload + struct.pack("<H", crc.crc)


def mutated(rng, data: bytes) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.integers(1, 4)):
        match rng.integers(4):
            case 0 if changed:
                changed[rng.integers(len(changed))] ^= 1 << rng.integers(8)
            case 1:
                del changed[rng.integers(len(changed) + 1) :]
            case 2:
                at = rng.integers(len(changed) + 1)
                changed[at:at] = rng.bytes(int(rng.integers(1, 30)))
            case _:
                changed += data
    return bytes(changed)


SPECIALS = [struct.pack("<f", x) for x in (float("nan"), float("inf"), -1e38, 1.0)]
SPECIALS += [b"\xff" * 4, b"\x01\x01\x00\x00", b"\x90\x01\x00\x00"]


def odd_payload(rng, kind) -> bytes:
    """Random bytes, or awkward numbers in every place; mostly meant for the vehicle, so that it is acted upon."""
    message = mavlink.mavlink_map[kind]
    size = message.unpacker.size
    awkward = b"".join(SPECIALS[i] for i in rng.integers(len(SPECIALS), size=size // 4 + 1))[:size]
    payload = bytearray(rng.bytes(size) if rng.integers(2) else awkward)
    fields = dict(zip(message.ordered_fieldnames, struct_offsets(message), strict=True))
    for name in {"target_system", "target_component"} & fields.keys():
        if rng.integers(4):
            payload[fields[name]] = 1
    return bytes(payload)


def struct_offsets(message) -> list[int]:
    """Where each field begins in the payload, in the order of the wire."""
    codes = re.findall(r"\d*[a-zA-Z]", message.unpacker.format)
    return [struct.calcsize("<" + "".join(codes[:index])) for index in range(len(codes))]


def test_no_payload_however_odd_crashes_the_vehicle_or_breaks_its_limits() -> None:
    station, rng = Station(airborne_m=30.0, seed=1), np.random.default_rng(1)
    kinds = sorted(READ)
    flight = station.vehicle.flight
    for turn in range(60_000 if FULL else 6000):
        kind = kinds[rng.integers(len(kinds))]
        sent = station.vehicle.on_bytes(sound_frame(kind, odd_payload(rng, kind)), PEER, station.now_us)
        assert len(sent) < 60
        if turn % 20 == 0:
            station.run(0.1)
            assert flight.body.velocity.horizontal <= flight.limits.speed_m_s + 1e-6
    assert station.vehicle.dropped == 0, "the frames were sound"
    assert station.run(1)


def test_damaged_datagrams_are_dropped_and_the_next_sound_one_is_heard() -> None:
    station, rng = Station(airborne_m=30.0), np.random.default_rng(2)
    requester = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    sound = mavlink.MAVLink_timesync_message(0, 77).pack(requester)
    for _ in range(60_000 if FULL else 6000):
        for damaged in (rng.bytes(int(rng.integers(0, 300))), mutated(rng, sound)):
            station.vehicle.on_bytes(damaged, PEER, station.now_us)
        assert station.send(mavlink.MAVLink_timesync_message(0, 77))
    assert station.vehicle.dropped > 100


def test_a_flood_of_strangers_does_not_grow_the_list_of_peers() -> None:
    station = Station()
    requester = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    hello = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3).pack(requester)
    for port in range(1, 5000):
        station.vehicle.on_bytes(hello, ("127.0.0.1", port), station.now_us)
    station.now_us += 100_000
    told = {peer for peer, _ in station.vehicle.on_time(station.now_us)}
    assert len(told) == 16
    assert station.peer in told


def test_several_frames_in_one_datagram_are_all_read_and_version_one_too() -> None:
    requester = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    one = mavlink.MAVLink_timesync_message(0, 1).pack(requester)
    old = mavlink.MAVLink_timesync_message(0, 2).pack(requester, force_mavlink1=True)
    station = Station()
    answers = station.vehicle.on_bytes(b"noise" + one + old + one[:9], PEER, station.now_us)
    assert len(answers) == 2
    assert [len(frame.data) for frame in Cutter().cut(one + b"\xfd\xff" + old)] == [len(one), len(old)]


COMMANDS = [16, 17, 20, 21, 22, 176, 178, 192, 224, 262, 300, 400, 410, 510, 511, 512, 520]
numbers = st.one_of(st.floats(width=32), st.sampled_from([0.0, 1.0, -1.0, 4.0, 33.0, 435.0, 21196.0]))


@settings(max_examples=examples(400), deadline=None)
@given(st.sampled_from(COMMANDS), st.lists(numbers, min_size=7, max_size=7), st.integers(0, 255))
def test_no_number_in_a_command_crashes_the_vehicle(command, params, frame) -> None:
    for persona in ("ardupilot", "px4"):
        station = Station(persona, airborne_m=30.0)
        station.command(command, *params)
        coordinates = [round(x * 1e7) if abs(x) < 180.0 else -(2**31) for x in params[4:6]]
        station.command_int(command, frame, params[:4], *coordinates, params[6])
        station.run(0.5)
        assert station.of_type("HEARTBEAT")
