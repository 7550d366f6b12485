"""Parameters and missions on the wire."""

import struct

import pytest
from pymavlink.dialects.v20 import all as mavlink

from dyknow.sim_uavs.dynamics.flight import Mode
from tests.sim_uavs.station import HOME, NAN, Station

PERSONAS = pytest.mark.parametrize("persona", ["ardupilot", "px4"])
OK, UNSUPPORTED, NO_SPACE, INVALID_SEQUENCE, DENIED, CANCELLED = 0, 3, 4, 13, 14, 15


def item(seq, command=16, north=0.0, height_m=20.0, params=(0, 0, 0, 0), frame=6, current=0, kind=0):
    x, y = round((HOME.latitude_deg + north) * 1e7), round(HOME.longitude_deg * 1e7)
    return mavlink.MAVLink_mission_item_int_message(
        1, 1, seq, frame, command, current, 1, *params, x, y, height_m, kind
    )


def plan(persona):
    """Home first where the persona wants it; take off, fly 55 m north, land there."""
    home = [item(0)] if persona == "ardupilot" else []
    items = [*home, item(0, 22), item(0, north=5e-4, params=(1.0, 2.0, 0, 0)), item(0, 21, north=5e-4, height_m=0.0)]
    for seq, one in enumerate(items):
        one.seq = seq
    return items


def types(messages) -> list[str]:
    return [m.get_type() for m in messages if m.get_type().startswith(("MISSION_", "PARAM_")) and m.get_msgId() != 42]


def upload(station, items):
    """Answer each request; returns the result of the final acknowledgement."""
    told = station.send(mavlink.MAVLink_mission_count_message(1, 1, len(items), 0))
    for _ in range(2 * len(items)):
        final = [m for m in told if m.get_type() == "MISSION_ACK"]
        if final:
            return final[0].type
        (request,) = [m for m in told if m.get_type() == "MISSION_REQUEST_INT"]
        told = station.send(items[request.seq])
    return next(m for m in told if m.get_type() == "MISSION_ACK").type


@PERSONAS
def test_a_mission_is_uploaded_read_back_flown_and_cleared(persona) -> None:
    station = Station(persona)
    items = plan(persona)
    assert upload(station, items) == OK
    (count,) = station.send(mavlink.MAVLink_mission_request_list_message(1, 1, 0))
    assert count.count == len(items)
    for sent in items:
        (back,) = station.send(mavlink.MAVLink_mission_request_int_message(1, 1, sent.seq, 0))
        for field in ("seq", "frame", "command", "param1", "param2", "x", "y", "z"):
            assert getattr(back, field) == getattr(sent, field)
    if persona == "ardupilot":
        station.set_mode("GUIDED")
    assert station.command(400, 1) == 0
    assert station.set_mode("AUTO") == 0
    station.run_until(lambda: not station.truth.armed)
    assert [m.seq for m in station.of_type("MISSION_ITEM_REACHED")] == [
        m.seq for m in items if m.seq or persona == "px4"
    ]
    assert station.truth.place.latitude_deg == pytest.approx(HOME.latitude_deg + 5e-4, abs=3e-5)
    assert types(station.send(mavlink.MAVLink_mission_clear_all_message(1, 1, 0))) == ["MISSION_ACK"]
    (count,) = station.send(mavlink.MAVLink_mission_request_list_message(1, 1, 0))
    assert count.count == 0


def test_without_a_mission_auto_is_refused() -> None:
    assert Station().set_mode("AUTO") == 2


def test_the_rally_list_is_empty_and_cannot_be_written() -> None:
    station, kind = Station(), 2
    (count,) = station.send(mavlink.MAVLink_mission_request_list_message(1, 1, kind))
    assert (count.count, count.mission_type) == (0, kind)
    (ack,) = station.send(mavlink.MAVLink_mission_count_message(1, 1, 3, kind))
    assert (ack.type, ack.mission_type) == (UNSUPPORTED, kind)


def test_items_lost_on_the_way_are_asked_for_again() -> None:
    station = Station("px4")
    items = plan("px4")
    station.send(mavlink.MAVLink_mission_count_message(1, 1, len(items), 0))
    heard = station.run(2.2)
    assert [m.seq for m in heard if m.get_type() == "MISSION_REQUEST_INT"] == [0, 0, 0, 0]
    station.send(items[0])
    (again,) = [m for m in station.send(items[0]) if m.get_type() == "MISSION_REQUEST_INT"]
    assert again.seq == 1, "a repeated item is no second item"
    station.send(items[1])
    (ack,) = station.send(items[2])
    assert ack.type == OK
    (ack,) = station.send(items[2])
    assert ack.type == OK, "the acknowledgement was lost: it is repeated"
    (count,) = station.send(mavlink.MAVLink_mission_request_list_message(1, 1, 0))
    assert count.count == 3


def test_an_upload_that_stops_is_given_up_and_changes_nothing() -> None:
    station = Station("px4")
    upload(station, plan("px4"))
    station.send(mavlink.MAVLink_mission_count_message(1, 1, 9, 0))
    station.send(item(0))
    station.run(12)
    assert station.last("MISSION_ACK").type == CANCELLED
    (count,) = station.send(mavlink.MAVLink_mission_request_list_message(1, 1, 0))
    assert count.count == 3


def test_uploads_that_cannot_be_flown_are_refused_whole() -> None:
    station = Station("px4")
    assert upload(station, [item(0), item(1, command=2500)]) == UNSUPPORTED
    assert upload(station, [item(0, frame=1)]) == mavlink.MAV_MISSION_UNSUPPORTED_FRAME
    assert upload(station, [item(0, height_m=NAN)]) == mavlink.MAV_MISSION_INVALID
    (ack,) = station.send(mavlink.MAVLink_mission_count_message(1, 1, 60_000, 0))
    assert ack.type == NO_SPACE
    (ack,) = station.send(item(0))
    assert ack.type == INVALID_SEQUENCE
    (ack,) = station.send(mavlink.MAVLink_mission_request_int_message(1, 1, 5, 0))
    assert ack.type == INVALID_SEQUENCE
    assert station.set_mode("AUTO") == 2


def test_two_stations_do_not_upload_at_once() -> None:
    station = Station("px4")
    other = Station(vehicle=station.vehicle, peer=("127.0.0.1", 14551), system=254)
    station.send(mavlink.MAVLink_mission_count_message(1, 1, 2, 0))
    (ack,) = other.send(mavlink.MAVLink_mission_count_message(1, 1, 2, 0))
    assert ack.type == DENIED


def test_the_present_item_can_be_set_and_the_mission_begun_by_command() -> None:
    station = Station("px4")
    upload(station, plan("px4"))
    assert station.command(224, 1) == 0
    (told,) = station.send(mavlink.MAVLink_mission_set_current_message(1, 1, 2))
    assert (told.seq, told.total) == (2, 3)
    assert station.command(224, 99) == 2
    assert station.command(300) == 0
    assert station.truth.mode is Mode.AUTO


@PERSONAS
def test_parameters_are_listed_read_by_name_and_by_index(persona) -> None:
    station = Station(persona)
    told = station.send(mavlink.MAVLink_param_request_list_message(1, 1))
    assert [m.param_index for m in told] == list(range(told[0].param_count))
    for one in told:
        (by_index,) = station.send(mavlink.MAVLink_param_request_read_message(1, 1, b"", one.param_index))
        (by_name,) = station.send(mavlink.MAVLink_param_request_read_message(1, 1, one.param_id.encode(), -1))
        assert by_index.to_dict() == by_name.to_dict() == one.to_dict()
    assert not station.send(mavlink.MAVLink_param_request_read_message(1, 1, b"NO_SUCH", -1))
    assert not station.send(mavlink.MAVLink_param_request_read_message(1, 1, b"", 999))


def test_integers_travel_as_bits_in_one_persona_and_as_numbers_in_the_other() -> None:
    (told,) = Station("px4").send(mavlink.MAVLink_param_request_read_message(1, 1, b"MAV_SYS_ID", -1))
    assert struct.unpack("<i", struct.pack("<f", told.param_value)) == (1,)
    (told,) = Station().send(mavlink.MAVLink_param_request_read_message(1, 1, b"SYSID_THISMAV", -1))
    assert told.param_value == 1.0


@pytest.mark.parametrize(
    ("persona", "name", "value"), [("ardupilot", b"WPNAV_SPEED", 300.0), ("px4", b"MPC_XY_CRUISE", 3.0)]
)
def test_a_written_parameter_changes_how_it_flies(persona, name, value) -> None:
    station = Station(persona)
    (told,) = station.send(mavlink.MAVLink_param_set_message(1, 1, name, value, 9))
    assert told.param_value == value
    station.take_off()
    point = (round((HOME.latitude_deg + 1e-3) * 1e7), round(HOME.longitude_deg * 1e7))
    station.command_int(192, 6, (-1, 1, 0, NAN), *point, 20.0)
    station.run(8)
    assert station.truth.north_m_s == pytest.approx(3.0, abs=0.1)


@pytest.mark.parametrize(("name", "value"), [(b"WPNAV_SPEED", NAN), (b"WPNAV_SPEED", 1e9), (b"SYSID_THISMAV", 9.0)])
def test_a_refused_write_is_answered_with_the_old_value(name, value) -> None:
    station = Station()
    (before,) = station.send(mavlink.MAVLink_param_request_read_message(1, 1, name, -1))
    (told,) = station.send(mavlink.MAVLink_param_set_message(1, 1, name, value, 9))
    assert told.param_value == before.param_value


def test_vehicles_do_not_share_what_their_parameters_say() -> None:
    one, two = Station(), Station()
    one.send(mavlink.MAVLink_param_set_message(1, 1, b"WPNAV_SPEED", 300.0, 9))
    (told,) = two.send(mavlink.MAVLink_param_request_read_message(1, 1, b"WPNAV_SPEED", -1))
    assert told.param_value == 800.0
