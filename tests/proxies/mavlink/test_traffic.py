"""Other aircraft on a vehicle's link: bytes in, reports out; valid fields alone, and floods bounded."""

import math
import random
import time
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.navigation.heard_aircraft import HeardAircraft
from dyknow.navigation.traffic import MOST_AIRCRAFT
from dyknow.navigation.vehicle import PositionReport, Report, TrafficReport
from dyknow.proxies.mavlink.feed import MavlinkFeed
from dyknow.proxies.mavlink.traffic import TrafficHearing
from dyknow.proxies.outward.remote_id import RemoteIdMessages, RemoteIdState
from tests.proxies.vehicle import Wire, heartbeat, position

ALL = 1 | 2 | 4 | 8 | 16 | 128


def adsb(**given: Any) -> Any:
    fields = {
        "ICAO_address": 0x4CA123, "lat": 580_000_000, "lon": 150_000_000, "altitude_type": 0, "altitude": 120_000,
        "heading": 9_000, "hor_velocity": 6_000, "ver_velocity": 150, "callsign": b"LN-OKA", "emitter_type": 7, "tslc": 2,
        "flags": ALL, "squawk": 0,
    }  # fmt: skip
    return arrived(mavlink.MAVLink_adsb_vehicle_message(**{**fields, **given}), 156)


def arrived(message: Any, component: int) -> Any:
    """As it is after it has crossed the link."""
    sender, receiver = mavlink.MAVLink(None, srcSystem=1, srcComponent=component), mavlink.MAVLink(None)
    return receiver.parse_buffer(bytearray(message.pack(sender)))[0]


def heard(*messages: Any, at_us: int = 10_000_000) -> list[HeardAircraft]:
    hearing = TrafficHearing()
    for each in messages:
        hearing.on_message(each, at_us)
    report = hearing.report(at_us, at_us, None)
    return [] if report is None else list(report.aircraft)


def test_an_adsb_message_is_an_aircraft_in_si_units_at_the_time_it_was_heard():
    (one,) = heard(adsb())
    assert one.identity == "adsb-4ca123"
    assert (one.valid_us, one.latitude_deg, one.longitude_deg, one.altitude_m) == (8_000_000, 58.0, 15.0, 120.0)
    assert one.north_m_s == pytest.approx(0.0, abs=1e-9)
    assert one.east_m_s == pytest.approx(60.0)
    assert one.down_m_s == pytest.approx(-1.5)
    assert (one.kind, one.callsign, one.altitude_reference) == ("rotocraft", "LN-OKA", "barometric")


@pytest.mark.parametrize(
    ("flag", "names"),
    [(2, ("altitude_m",)), (4, ("north_m_s", "east_m_s")), (8, ("north_m_s", "east_m_s")), (128, ("down_m_s",))],
)
def test_a_field_that_is_not_valid_is_not_known(flag: int, names: tuple[str, ...]):
    (one,) = heard(adsb(flags=ALL & ~flag))
    assert [getattr(one, name) for name in names] == [None] * len(names)
    (both,) = heard(adsb())
    assert None not in [getattr(both, name) for name in names]


def test_without_coordinates_there_is_no_aircraft():
    assert heard(adsb(flags=ALL & ~1)) == []
    assert heard(adsb(flags=ALL & ~16))[0].callsign == ""


def test_a_geometric_altitude_is_above_the_sea_once_the_receiver_says_how_far_that_is():
    hearing = TrafficHearing()
    fix = mavlink.MAVLink_gps_raw_int_message(0, 3, 0, 0, 100_000, 0, 0, 0, 0, 9, alt_ellipsoid=135_000)
    for before in (True, False):
        hearing.on_message(adsb(altitude_type=1), 0)
        report = hearing.report(0, 0 if before else 1_000_000, None)
        assert report is not None
        (one,) = report.aircraft
        assert one.altitude_reference == "geometric"
        assert (one.altitude_m, one.altitude_error_m) == ((120.0, 110.0) if before else (85.0, 20.0))
        hearing.on_fix(fix)


def test_what_remote_id_sends_out_is_read_alone_and_in_a_pack():
    state = RemoteIdState(
        "uav-7", 58.01, 15.02, 1_700_000_000_000_000, 140.0, 40.0, (3.0, 4.0, -1.0), 1.0, 2.0, (58.0, 15.0)
    )
    receiver = mavlink.MAVLink(None)
    messages = [
        receiver.parse_buffer(bytearray(data))[0] for data in RemoteIdMessages(35.0, source=(1, 236)).encode(state)
    ]
    for chosen in (messages[:3], messages[3:]):
        (one,) = heard(*chosen)
        assert one.identity == "rid-uav-7"
        assert one.kind == "helicopter-or-multirotor"
        assert one.latitude_deg == pytest.approx(58.01, abs=1e-6)
        assert math.hypot(one.north_m_s, one.east_m_s) == pytest.approx(5.0, abs=0.2)
        assert one.down_m_s == pytest.approx(-1.0, abs=0.3)
        assert one.altitude_m == pytest.approx(175.0, abs=0.5)
        assert one.altitude_reference == "geometric"


def test_what_the_autopilot_sends_of_itself_is_no_other_aircraft():
    location = mavlink.MAVLink_open_drone_id_location_message(
        0, 0, [0] * 20, 2, 0, 0, 0, 580_000_000, 150_000_000, -1000.0, 100.0, 0, 40.0, 10, 4, 0, 0, 0.0, 0
    )
    assert heard(arrived(location, 1)) == []
    assert len(heard(arrived(location, 236))) == 1


@pytest.mark.parametrize("seed", range(20))
def test_whatever_the_fields_are_nothing_raises_and_a_flood_keeps_the_nearest(seed: int):
    draw = random.Random(seed)
    hearing = TrafficHearing()
    near = [adsb(ICAO_address=number, lat=580_000_000 + number) for number in range(1, 6)]
    floats = (float("nan"), float("inf"), -1000.0, 1e30, 120.0)
    for each in near:
        hearing.on_message(each, 0)
    for _ in range(400):
        place = draw.randrange(-(2**31), 2**31), draw.randrange(-(2**31), 2**31)
        if draw.random() < 0.5:
            hearing.on_message(
                adsb(
                    ICAO_address=draw.randrange(2**32), lat=place[0], lon=place[1], altitude=draw.randrange(-(2**31), 2**31),
                    heading=draw.randrange(2**16), hor_velocity=draw.randrange(2**16), ver_velocity=draw.randrange(-(2**15), 2**15),
                    emitter_type=draw.randrange(256), tslc=draw.randrange(256), flags=draw.randrange(2**16),
                    altitude_type=draw.randrange(256),
                ),
                0,
            )  # fmt: skip
        else:
            pack = mavlink.MAVLink_open_drone_id_message_pack_message(
                0, 0, [draw.randrange(256) for _ in range(20)], draw.choice((0, 25, 25, 25, 255)), draw.randrange(256),
                [draw.choice((0, 16, 17, draw.randrange(256))) for _ in range(225)],
            )  # fmt: skip
            hearing.on_message(arrived(pack, 236), 0)
            location = mavlink.MAVLink_open_drone_id_location_message(
                0, 0, [draw.randrange(256) for _ in range(20)], draw.randrange(256), draw.randrange(2**16),
                draw.randrange(2**16), draw.randrange(-(2**15), 2**15), *place, draw.choice(floats), draw.choice(floats),
                draw.randrange(256), draw.choice(floats), draw.randrange(256), 0, 0, 0, draw.choice(floats), 0,
            )  # fmt: skip
            hearing.on_message(arrived(location, 236), 0)
    report = hearing.report(0, 0, PositionReport(0, "GPS", 58.0, 15.0, 100.0))
    assert report is not None
    assert len(report.aircraft) <= MOST_AIRCRAFT
    assert {one.identity for one in report.aircraft[:5]} == {f"adsb-{number:06x}" for number in range(1, 6)}
    assert all(abs(one.latitude_deg) <= 90.0 and abs(one.longitude_deg) <= 180.0 for one in report.aircraft)
    assert sum(times for _, times in report.left_out) > 0


def test_a_flood_on_the_link_is_bounded_and_the_vehicle_is_still_heard():
    posted: list[Report] = []
    feed = MavlinkFeed("udpin:127.0.0.1:0", 1, posted.append, lambda: time.time_ns() // 1000)
    feed.start()
    wire = Wire(feed.port.address)
    try:
        wire.send(heartbeat(), position(1000))
        draw, sent, begun_s = random.Random(3), 0, time.monotonic()
        frames = [wire.bytes_of(mavlink.MAVLink_adsb_vehicle_message(*fields(draw))) for _ in range(1000)]

        def has_come() -> bool:
            """Whether reports of both kinds have come through, however busy the machine is."""
            heard = [each for each in posted if isinstance(each, TrafficReport)]
            places = [each for each in posted if isinstance(each, PositionReport)]
            left_out = sum(dict(each.left_out).get("too many", 0) for each in heard)
            return sent > 10_000 and len(heard) >= 2 and left_out > 500 and len(places) >= 4

        while not has_come() and time.monotonic() < begun_s + 60.0:
            for at in range(0, len(frames), 20):
                wire.send_bytes(b"".join(frames[at : at + 20]))
            sent += len(frames)
            wire.send(heartbeat(), position(1000 + round((time.monotonic() - begun_s) * 1000)))
    finally:
        wire.close()
        feed.stop()
    reports = [each for each in posted if isinstance(each, TrafficReport)]
    assert sent > 10_000
    assert 2 <= len(reports) <= 15 + 6 * (time.monotonic() - begun_s)
    assert max(len(each.aircraft) for each in reports) <= MOST_AIRCRAFT
    assert sum(dict(each.left_out).get("too many", 0) for each in reports) > 500
    assert len([each for each in posted if isinstance(each, PositionReport)]) >= 4


def fields(draw: random.Random) -> tuple[Any, ...]:
    place = round(draw.uniform(46.9, 47.1) * 1e7), round(draw.uniform(7.9, 8.1) * 1e7)
    return draw.getrandbits(24), *place, 0, 120_000, 9_000, 6_000, 0, b"FLOOD", 7, 0, ALL, 0
