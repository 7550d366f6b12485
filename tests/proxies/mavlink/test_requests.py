"""What a vehicle is asked for, by how it took what it was asked before."""

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.proxies.mavlink.requests import Requests
from dyknow.proxies.mavlink.ways import Target

TARGET = Target(1, 1)
INTERVAL, HOME, OLD_HOME = (
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
    mavlink.MAV_CMD_REQUEST_MESSAGE,
    mavlink.MAV_CMD_GET_HOME_POSITION,
)


def ack(command: int, result: int) -> Any:
    return mavlink.MAVLink_command_ack_message(command, result)


def asked(requests: Requests, *, positioned: bool = False, homed: bool = False) -> set[Any]:
    """The commands that are sent, and the names of other messages."""
    messages = requests.messages(TARGET, is_positioned=positioned, is_homed=homed)
    return {getattr(each, "command", each.get_type()) for each in messages}


def test_messages_are_asked_for_by_name_and_never_by_group_where_that_is_understood() -> None:
    requests = Requests()
    assert asked(requests) == {INTERVAL, HOME}
    assert not requests.on_ack(ack(INTERVAL, mavlink.MAV_RESULT_ACCEPTED))
    assert asked(requests) == {INTERVAL, HOME}
    assert asked(requests, positioned=True) == {HOME}
    assert asked(requests, positioned=True, homed=True) == set()
    assert requests.is_answered


def test_an_autopilot_that_knows_groups_only_is_asked_for_them_at_once() -> None:
    requests = Requests()
    asked(requests)
    assert requests.on_ack(ack(INTERVAL, mavlink.MAV_RESULT_UNSUPPORTED))
    assert asked(requests, positioned=True) == {"REQUEST_DATA_STREAM", HOME}
    assert not requests.on_ack(ack(INTERVAL, mavlink.MAV_RESULT_UNSUPPORTED)), "each message is refused; once is enough"
    assert asked(requests, positioned=True, homed=True) == set()
    assert asked(requests, homed=True) == {"REQUEST_DATA_STREAM"}


def test_one_message_that_the_autopilot_lacks_does_not_bring_groups() -> None:
    requests = Requests()
    asked(requests)
    requests.on_ack(ack(INTERVAL, mavlink.MAV_RESULT_UNSUPPORTED))
    requests.on_ack(ack(INTERVAL, mavlink.MAV_RESULT_ACCEPTED))
    assert not requests.on_ack(ack(INTERVAL, mavlink.MAV_RESULT_UNSUPPORTED))
    assert asked(requests) == {INTERVAL, HOME}


def test_an_autopilot_that_does_not_answer_is_asked_in_both_ways_until_its_position_comes() -> None:
    requests = Requests()
    asked(requests)
    assert asked(requests) == {INTERVAL, "REQUEST_DATA_STREAM", HOME}
    assert asked(requests) == {INTERVAL, "REQUEST_DATA_STREAM", HOME}
    assert asked(requests, positioned=True) == {HOME}
    assert not requests.is_answered


def test_home_is_asked_for_in_the_older_way_and_then_no_more() -> None:
    requests = Requests()
    asked(requests, positioned=True)
    assert requests.on_ack(ack(HOME, mavlink.MAV_RESULT_UNSUPPORTED))
    assert asked(requests, positioned=True) == {OLD_HOME}
    assert not requests.on_ack(ack(OLD_HOME, mavlink.MAV_RESULT_DENIED)), "home is not set yet: it is asked for again"
    assert asked(requests, positioned=True) == {OLD_HOME}
    assert requests.on_ack(ack(OLD_HOME, mavlink.MAV_RESULT_UNSUPPORTED))
    assert asked(requests, positioned=True) == set()
    requests.restart()
    assert HOME in asked(requests)


def test_the_parameters_of_the_fence_are_asked_for_until_they_are_told_and_not_for_ever() -> None:
    asking, rounds = Requests(), []
    for _ in range(100):
        sent = asking.messages(TARGET, is_positioned=True, is_homed=True, untold=("FENCE_ENABLE",))
        rounds.append([message.param_id for message in sent if message.get_type() == "PARAM_REQUEST_READ"])
    assert rounds[0] == ["FENCE_ENABLE"]
    assert 1 < sum(map(len, rounds)) < 20
    assert asking.messages(TARGET, is_positioned=True, is_homed=True) == []
