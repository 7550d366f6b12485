"""Remote ID: MAVLink decodes each message, and the pack unpacks to the same by the layout of ASTM F3411."""

import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.model.errors import WrongCall
from dyknow.proxies.outward.remote_id import RemoteIdMessages, RemoteIdState, check_serial

AT_US = 1_795_461_223_065_000
STATE = RemoteIdState(
    "7", 58.4, -15.6, AT_US, altitude_m=60.0, height_m=12.5, velocity_m_s=(3.0, -4.0, -1.0), horizontal_sd_m=0.7,
    vertical_sd_m=2.0, home=(58.3, -15.5), serial="1A2B5X7Y9Z",
)  # fmt: skip


def decoded(state: RemoteIdState, undulation_m: float | None = None) -> list[Any]:
    other_end = mavlink.MAVLink(None)
    datagrams = RemoteIdMessages(undulation_m).encode(state)
    found = [other_end.decode(bytearray(each)) for each in datagrams]
    assert [each.get_type().removeprefix("OPEN_DRONE_ID_") for each in found] == [
        "BASIC_ID", "LOCATION", "SYSTEM", "MESSAGE_PACK",
    ]  # fmt: skip
    return found


def test_each_message_has_what_the_platform_does_in_the_units_of_the_standard() -> None:
    basic, location, system, _ = decoded(STATE, 28.0)
    assert (basic.id_type, bytes(basic.uas_id).rstrip(b"\0"), basic.ua_type) == (1, b"1A2B5X7Y9Z", 2)
    assert (location.latitude, location.longitude) == (584_000_000, -156_000_000)
    assert (location.direction, location.speed_horizontal, location.speed_vertical) == (30_687, 500, 100)
    assert (location.altitude_geodetic, location.altitude_barometric, location.height) == (88.0, -1000.0, 12.5)
    assert (location.status, location.horizontal_accuracy, location.vertical_accuracy) == (2, 11, 4)
    assert location.timestamp == pytest.approx(AT_US % 3_600_000_000 / 1e6, abs=0.001)
    assert (system.operator_latitude, system.operator_location_type) == (583_000_000, 0)
    assert system.timestamp + 1_546_300_800 == AT_US // 1_000_000


def test_what_is_not_known_has_the_values_for_that() -> None:
    basic, location, system, _ = decoded(RemoteIdState("7", 58.4, 15.6, AT_US, altitude_m=60.0))
    assert (basic.id_type, bytes(basic.uas_id).rstrip(b"\0")) == (0, b"7")
    assert (location.direction, location.speed_horizontal, location.speed_vertical) == (36_100, 25_500, 6_300)
    assert (location.altitude_geodetic, location.height, location.status) == (-1000.0, -1000.0, 0)
    assert (location.horizontal_accuracy, location.vertical_accuracy) == (0, 0)
    assert (system.operator_latitude, system.operator_longitude, system.operator_altitude_geo) == (0, 0, -1000.0)


def check_pack(state: RemoteIdState, undulation_m: float | None) -> None:
    basic, location, system, pack = decoded(state, undulation_m)
    assert (pack.single_message_size, pack.msg_pack_size) == (25, 3)
    data = bytes(pack.messages)
    assert [data[at] >> 4 for at in (0, 25, 50)] == [0, 1, 4]
    assert {data[at] & 15 for at in (0, 25, 50)} == {2}
    assert (data[1] >> 4, data[1] & 15, data[2:22]) == (basic.id_type, basic.ua_type, bytes(basic.uas_id))
    flags, east, speed, climb, latitude, longitude, _, geodetic, height = struct.unpack_from("<BBBbiiHHH", data, 26)
    assert flags >> 4 == location.status
    course = east + (180 if flags & 2 else 0)
    assert course == location.direction // 100
    speed_m_s = speed * 0.75 + 63.75 if flags & 1 else speed * 0.25
    assert speed_m_s == pytest.approx(location.speed_horizontal / 100, abs=0.38)
    assert climb / 2 == pytest.approx(location.speed_vertical / 100, abs=0.26)
    assert (latitude, longitude) == (location.latitude, location.longitude)
    assert geodetic / 2 - 1000 == pytest.approx(location.altitude_geodetic, abs=0.26)
    assert height / 2 - 1000 == pytest.approx(location.height, abs=0.26)
    kind, operator_latitude = struct.unpack_from("<Bi", data, 51)
    assert (kind & 3, operator_latitude) == (system.operator_location_type, system.operator_latitude)
    assert struct.unpack_from("<I", data, 70)[0] == system.timestamp


def test_the_pack_says_the_same() -> None:
    check_pack(STATE, 28.0)
    check_pack(RemoteIdState("7", 58.4, 15.6, AT_US), None)


NUMBERS = st.floats(-1e6, 1e6)


@given(
    st.builds(
        RemoteIdState, st.text(), st.floats(-90, 90), st.floats(-180, 180), st.integers(0, 2**51), NUMBERS, NUMBERS,
        st.tuples(NUMBERS, NUMBERS, NUMBERS), st.floats(0, 1e9), st.floats(0, 1e9),
    ),
    NUMBERS,
)  # fmt: skip
def test_whatever_a_member_says_of_itself_becomes_messages_of_the_standard(
    state: RemoteIdState, undulation_m: float
) -> None:
    check_pack(state, undulation_m)


@pytest.mark.parametrize("text", ["", "7", "1A2B5X7Y9", "1A2B5X7Y9ZZ", "1A2O5X7Y9Z", "1A2B5x7y9z"])
def test_a_serial_number_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(WrongCall, match="CTA-2063-A"):
        check_serial(text)
