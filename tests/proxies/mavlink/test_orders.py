import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.model.errors import Refused
from navigation.vehicle import Arm, Command, GoToOrder, HoldOrder, LandOrder, ReturnHomeOrder, SetGuided, TakeOffOrder
from proxies.mavlink.orders import ATTEMPTS, RETRY_US, Errands, Target, messages_for
from proxies.mavlink.reports import VehicleReports
from tests.proxies.vehicle import heartbeat, position

TARGET = Target(5, 1)
PX4 = mavlink.MAV_AUTOPILOT_PX4


def next_due_us(errands: Errands) -> int | None:
    return min((errand.next_us for errand in errands._open.values()), default=None)


def heard(*messages, autopilot: int = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA) -> VehicleReports:
    known = VehicleReports()
    for message in (heartbeat(autopilot=autopilot), *messages):
        known.reports(message, 1)
    return known


def ack(command: int, result: int):
    return mavlink.MAVLink_command_ack_message(command, result)


@pytest.mark.parametrize(
    ("order", "command", "parameters"),
    [
        (Arm(), 400, (1.0,)),
        (Arm(False), 400, (0.0,)),
        (SetGuided(), 176, (1.0, 4.0)),
        (TakeOffOrder(12.0), 22, (0, 0, 0, 0, 0, 0, 12.0)),
        (LandOrder(), 21, (0.0,)),
        (ReturnHomeOrder(), 20, ()),
    ],
)
def test_orders_to_an_ardupilot(order, command, parameters) -> None:
    (message,) = messages_for(order, heard(), TARGET)
    assert (message.target_system, message.target_component, message.command) == (5, 1, command)
    found = tuple(getattr(message, f"param{k}") for k in range(1, 8))
    assert found == (*parameters, *(0.0,) * (7 - len(parameters)))


def test_a_px4_takes_off_to_an_altitude_above_the_sea_and_knows_it_by_parameter_too() -> None:
    home = mavlink.MAVLink_home_position_message(470000000, 80000000, 500000, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0)
    command, parameter = messages_for(TakeOffOrder(12.0), heard(home, autopilot=PX4), TARGET)
    assert command.param7 == 512.0
    assert (parameter.param_id, parameter.param_value) == ("MIS_TAKEOFF_ALT", 12.0)
    assert math.isnan(messages_for(TakeOffOrder(12.0), heard(autopilot=PX4), TARGET)[0].param7)


def test_a_px4_is_guided_in_hold_and_may_be_moved_into_it() -> None:
    (mode,) = messages_for(SetGuided(), heard(autopilot=PX4), TARGET)
    assert (mode.param1, mode.param2, mode.param3) == (1.0, 4.0, 3.0)
    (point,) = messages_for(GoToOrder(47.0, 8.0, 500.0, 4.0), heard(autopilot=PX4), TARGET)
    assert (point.param1, point.param2) == (4.0, 1.0)
    assert messages_for(HoldOrder(), heard(autopilot=PX4), TARGET)[0].command == mode.command


def test_an_ardupilot_holds_where_it_is_and_only_where_that_is_known() -> None:
    with pytest.raises(Refused, match="position is unknown"):
        messages_for(HoldOrder(), heard(), TARGET)
    (message,) = messages_for(HoldOrder(), heard(position(1, lat=47.5, alt=520.0)), TARGET)
    assert (message.command, message.x, message.z) == (192, 475000000, 520.0)


def test_an_order_is_sent_four_times_and_then_given_up() -> None:
    errands = Errands()
    sent = len(errands.on_command(Command(3, Arm()), heard(), TARGET, 0).send)
    confirmations, results = [], []
    while (due_us := next_due_us(errands)) is not None:
        outcome = errands.on_time(due_us)
        confirmations += [message.confirmation for message in outcome.send]
        results += outcome.results
        sent += len(outcome.send)
    assert sent == ATTEMPTS
    assert confirmations == [1, 2, 3]
    assert [(r.number, r.accepted, r.reason) for r in results] == [(3, False, "no answer")]
    assert due_us is None


def test_in_progress_buys_time_and_the_final_word_counts() -> None:
    errands = Errands()
    errands.on_command(Command(3, TakeOffOrder(9.0)), heard(), TARGET, 0)
    assert errands.on_ack(ack(22, mavlink.MAV_RESULT_IN_PROGRESS), 100_000).results == []
    assert errands.on_time(RETRY_US * ATTEMPTS) == ([], [])
    assert errands.on_ack(ack(22, mavlink.MAV_RESULT_ACCEPTED), 4_000_000).results[0].accepted
    assert next_due_us(errands) is None


@pytest.mark.parametrize(
    ("result", "reason"),
    [(1, "temporarily rejected"), (2, "denied"), (3, "unsupported"), (4, "failed"), (77, "result 77")],
)
def test_a_refusal_keeps_its_reason(result, reason) -> None:
    errands = Errands()
    errands.on_command(Command(3, Arm()), heard(), TARGET, 0)
    assert errands.on_ack(ack(400, result), 1).results[0][2:] == (False, reason)
    assert errands.on_ack(ack(400, result), 2).results == [], "a second acknowledgement says nothing"
    assert errands.on_ack(ack(20, 0), 3).results == [], "nor does one that nobody waits for"


def test_a_newer_point_takes_the_place_of_the_older_and_other_orders_run_beside_it() -> None:
    errands, known = Errands(), heard()
    errands.on_command(Command(1, GoToOrder(47, 8, 500)), known, TARGET, 0)
    errands.on_command(Command(2, Arm()), known, TARGET, 0)
    outcome = errands.on_command(Command(3, GoToOrder(48, 8, 500)), known, TARGET, 1)
    assert [(r.number, r.reason) for r in outcome.results] == [(1, "superseded")]
    assert errands.on_ack(ack(192, 0), 2).results[0].number == 3
    assert errands.on_ack(ack(400, 0), 2).results[0].number == 2


def test_nothing_is_sent_to_a_vehicle_that_was_not_heard() -> None:
    outcome = Errands().on_command(Command(1, Arm()), VehicleReports(), TARGET, 0)
    assert outcome.send == []
    assert outcome.results[0].reason == "no vehicle heard"
