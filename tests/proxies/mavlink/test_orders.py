import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.model.errors import Refused
from dyknow.navigation.vehicle import (
    OVERTAKEN,
    UNCONFIRMED,
    Arm,
    Command,
    GoToOrder,
    HoldOrder,
    InterruptOrder,
    LandOrder,
    MissionItemOrder,
    ResumeMissionOrder,
    ReturnHomeOrder,
    SetGuided,
    TakeOffOrder,
    stopping_distance_m,
)
from dyknow.proxies.mavlink.orders import ATTEMPTS, RETRY_US, Errands
from dyknow.proxies.mavlink.reports import VehicleReports
from dyknow.proxies.mavlink.ways import OURSELVES, Target, ways_of
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


def messages_for(order, known, target):
    """What is sent in the best way of saying it."""
    return ways_of(order, known, target)[0].messages


def ack(command: int, result: int, to: Target = OURSELVES):
    return mavlink.MAVLink_command_ack_message(command, result, 0, 0, *to)


def test_the_second_acknowledgement_of_a_px4_does_not_answer_the_next_change_of_mode() -> None:
    """Two orders in one millisecond, the first accepted, the second denied, each acknowledged twice."""
    errands, known = Errands(), heard(autopilot=PX4)
    errands.on_command(Command(1, SetGuided()), known, TARGET, 0)
    errands.on_command(Command(2, ResumeMissionOrder()), known, TARGET, 0)
    results = []
    for result in (mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED):
        for _ in range(2):
            results += errands.on_ack(ack(176, result), 10_000).results
    assert [(each.number, each.accepted) for each in results] == [(2, False)], "the first was superseded"


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
    (message, *_) = messages_for(order, heard(), TARGET)
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
    (stop,) = messages_for(HoldOrder(), heard(autopilot=PX4), TARGET)
    assert (stop.command, stop.param1, stop.param2) == (mavlink.MAV_CMD_DO_REPOSITION, -1.0, 1.0)
    assert all(map(math.isnan, (stop.param4, stop.param5, stop.param6, stop.param7))), "it is to stop where it can"


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
    [(2, "denied"), (3, "unsupported"), (4, "failed"), (77, "result 77")],
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
    assert errands.on_ack(ack(192, 0), 2).results == [], "that is the older one's"
    assert errands.on_ack(ack(192, 0), 3).results[0].number == 3
    assert errands.on_ack(ack(400, 0), 2).results[0].number == 2


# -- an acknowledgement answers the oldest sending that is not answered --------------------------------------------


def sent(outcome) -> list[str]:
    return [message.get_type() for message in outcome.send]


def told(outcome) -> list[tuple]:
    return [(result.number, result.accepted, result.reason) for result in outcome.results]


def beat(known: VehicleReports, mode: int, autopilot: int = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA) -> None:
    known.reports(heartbeat(mode=mode, autopilot=autopilot), 1)


def test_a_late_answer_to_an_order_that_was_replaced_does_not_end_the_newer_one() -> None:
    errands, known = Errands(), heard()
    errands.on_command(Command(1, GoToOrder(47, 8, 500)), known, TARGET, 0)
    errands.on_command(Command(2, GoToOrder(47, 8, 525)), known, TARGET, 100_000)
    assert told(errands.on_ack(ack(192, 0), 200_000)) == [], "that was the first"
    again = errands.on_time(100_000 + RETRY_US)
    assert [message.z for message in again.send] == [525], "so the newer one is said again"
    assert told(errands.on_ack(ack(192, 0), 700_000)) == [(2, True, "")]


def test_a_refusal_of_an_order_that_was_replaced_does_not_refuse_the_newer_one() -> None:
    errands, known = Errands(), heard()
    errands.on_command(Command(1, GoToOrder(0, 0, 500)), known, TARGET, 0)
    errands.on_command(Command(2, GoToOrder(47, 8, 525)), known, TARGET, 100_000)
    assert told(errands.on_ack(ack(192, mavlink.MAV_RESULT_DENIED), 200_000)) == []
    assert told(errands.on_ack(ack(192, 0), 300_000)) == [(2, True, "")]


def test_an_answer_that_was_lost_costs_a_repetition_and_no_more() -> None:
    errands, known = Errands(), heard()
    errands.on_command(Command(1, GoToOrder(47, 8, 500)), known, TARGET, 0)
    errands.on_command(Command(2, GoToOrder(47, 8, 525)), known, TARGET, 100_000)
    assert told(errands.on_ack(ack(192, 0), 200_000)) == []
    errands.on_time(600_000)
    assert told(errands.on_ack(ack(192, 0), 700_000)) == [(2, True, "")]
    errands.on_command(Command(3, GoToOrder(47, 8, 530)), known, TARGET, 5_000_000)
    assert told(errands.on_ack(ack(192, 0), 5_100_000)) == [(3, True, "")], "what is old is not waited for"


@pytest.mark.parametrize("to", [Target(255, 190), Target(254, 1)])
def test_an_answer_to_another_ground_station_is_not_ours(to: Target) -> None:
    errands = Errands()
    errands.on_command(Command(7, GoToOrder(47, 8, 500)), heard(), TARGET, 0)
    assert told(errands.on_ack(ack(192, mavlink.MAV_RESULT_DENIED, to), 1)) == []
    assert told(errands.on_ack(ack(192, 0, Target(0, 0)), 2)) == [(7, True, "")], "an old autopilot names none"


# -- repetitions never take a vehicle from its pilot -----------------------------------------------------------------


def test_a_vehicle_that_left_its_guided_mode_is_told_nothing_more() -> None:
    errands, known = Errands(), heard()
    errands.on_command(Command(1, GoToOrder(47, 8, 500)), known, TARGET, 0)
    beat(known, mode=5)
    outcome = errands.on_time(RETRY_US)
    assert (sent(outcome), told(outcome)) == ([], [(1, False, OVERTAKEN)])
    assert errands.on_time(10 * RETRY_US) == ([], [])


@pytest.mark.parametrize("order", [LandOrder(), ReturnHomeOrder(), ResumeMissionOrder()])
def test_what_changes_the_mode_is_repeated_only_when_a_heartbeat_has_said_that_nothing_else_did(order) -> None:
    errands, known = Errands(), heard()
    errands.on_command(Command(1, order), known, TARGET, 0)
    assert sent(errands.on_time(RETRY_US)) == [], "the pilot may have taken over since the last heartbeat"
    beat(known, mode=4)
    assert sent(errands.on_time(2 * RETRY_US)) == ["COMMAND_LONG"]
    beat(known, mode=5)
    assert told(errands.on_time(4 * RETRY_US)) == [(1, False, OVERTAKEN)]


def test_an_order_whose_mode_is_seen_needs_no_acknowledgement() -> None:
    errands, known = Errands(), heard()
    errands.on_command(Command(1, LandOrder()), known, TARGET, 0)
    beat(known, mode=9)
    outcome = errands.on_time(RETRY_US)
    assert (sent(outcome), told(outcome)) == ([], [(1, True, "")])


PX4_HOLD, PX4_POSITION = 4 << 16 | 3 << 24, 3 << 16


def test_a_px4_gets_leave_to_change_its_mode_with_the_first_sending_only() -> None:
    errands, known = Errands(), heard(heartbeat(mode=PX4_HOLD, autopilot=PX4), autopilot=PX4)
    first = errands.on_command(Command(1, GoToOrder(47, 8, 500)), known, TARGET, 0)
    again = errands.on_time(RETRY_US)
    assert [message.param2 for message in first.send + again.send] == [1.0, 0.0]
    assert told(errands.on_ack(ack(192, mavlink.MAV_RESULT_UNSUPPORTED), 600_000)) == [], "it wants that leave"
    beat(known, PX4_POSITION, PX4)
    assert told(errands.on_time(3 * RETRY_US)) == [(1, False, OVERTAKEN)]


# -- each autopilot is told in the way it understands ----------------------------------------------------------------


def test_what_is_not_understood_is_said_in_another_way_and_from_then_on_in_that_one() -> None:
    errands, known = Errands(), heard()
    first = errands.on_command(Command(1, GoToOrder(47, 8, 500)), known, TARGET, 0)
    assert sent(first) == ["COMMAND_INT"]
    second = errands.on_ack(ack(192, mavlink.MAV_RESULT_UNSUPPORTED), 10_000)
    assert sent(second) == ["SET_POSITION_TARGET_GLOBAL_INT"]
    (point,) = second.send
    assert (point.lat_int, point.lon_int, point.alt, point.type_mask & 0b111) == (470000000, 80000000, 500, 0)
    assert told(second) == [(1, True, UNCONFIRMED)]
    assert sent(errands.on_command(Command(2, GoToOrder(47, 8, 600)), known, TARGET, 3_000_000)) == [point.get_type()]


def test_a_point_that_nothing_acknowledges_is_said_a_few_times_while_the_vehicle_is_guided() -> None:
    errands, known = Errands(), heard()
    errands.on_command(Command(1, GoToOrder(47, 8, 500)), known, TARGET, 0)
    errands.on_ack(ack(192, mavlink.MAV_RESULT_UNSUPPORTED), 0)
    times = [at_us for at_us in range(0, 5_000_000, 20_000) if errands.on_time(at_us).send]
    assert len(times) == ATTEMPTS - 1


def test_an_autopilot_without_the_command_is_told_its_mode_by_the_older_message() -> None:
    errands, known = Errands(), heard()
    errands.on_command(Command(1, SetGuided()), known, TARGET, 0)
    outcome = errands.on_ack(ack(176, mavlink.MAV_RESULT_UNSUPPORTED), 1)
    assert [(m.get_type(), m.custom_mode) for m in outcome.send] == [("SET_MODE", 4)]
    assert told(errands.on_ack(ack(mavlink.MAVLINK_MSG_ID_SET_MODE, 0), 2)) == [(1, True, "")]


def test_what_no_way_of_saying_is_understood_is_refused_for_good() -> None:
    errands, known = Errands(), heard()
    errands.on_command(Command(1, ReturnHomeOrder()), known, TARGET, 0)
    assert told(errands.on_ack(ack(20, mavlink.MAV_RESULT_UNSUPPORTED), 1)) == [(1, False, "unsupported")]
    assert errands.on_time(10 * RETRY_US) == ([], [])


def test_a_temporary_rejection_is_asked_again_and_is_the_last_word_if_it_stays() -> None:
    errands, known, outcomes = Errands(), heard(), []
    errands.on_command(Command(1, GoToOrder(47, 8, 500)), known, TARGET, 0)
    for at_us in range(0, 5_000_000, 20_000):
        outcomes += told(errands.on_ack(ack(192, mavlink.MAV_RESULT_TEMPORARILY_REJECTED), at_us))
        outcomes += told(errands.on_time(at_us))
    assert outcomes == [(1, False, "temporarily rejected")]


def test_a_mission_is_interrupted_by_one_command_and_resumed_by_its_mode() -> None:
    known = heard(heartbeat(mode=3))
    (point,) = messages_for(InterruptOrder(47.0, 8.0, 500.0), known, TARGET)
    assert (point.command, point.param2, point.z) == (192, 1.0, 500.0)
    (mode,) = messages_for(ResumeMissionOrder(), known, TARGET)
    assert (mode.command, mode.param2) == (176, 3.0)
    (item,) = messages_for(MissionItemOrder(4), known, TARGET)
    assert (item.command, item.param1) == (224, 4.0)


# -- a vehicle in flight is told to stop where it can ----------------------------------------------------------------


def test_a_vehicle_in_flight_stops_a_braking_distance_ahead() -> None:
    moving = position(1, lat=47.5, alt=520.0)
    moving.vx, moving.vy = 500, 0
    known = heard(moving)
    for order in (HoldOrder(), GoToOrder(47.5, 8.0, 545.0, stops=True)):
        (message, *_) = messages_for(order, known, TARGET)
        assert (message.x / 1e7 - 47.5) * 111_194.9 == pytest.approx(stopping_distance_m(5.0), rel=0.01)
        assert message.z == (545.0 if isinstance(order, GoToOrder) else 520.0)
    (there, *_) = messages_for(GoToOrder(47.6, 8.0, 545.0), known, TARGET)
    assert there.x == 476000000, "a point elsewhere stays where it is"
    (there, *_) = messages_for(GoToOrder(47.5, 8.0, 545.0), known, TARGET)
    assert there.x == 475000000, "so does one to fly to, which the vehicle passes just now"


def test_nothing_is_sent_to_a_vehicle_that_was_not_heard() -> None:
    outcome = Errands().on_command(Command(1, Arm()), VehicleReports(), TARGET, 0)
    assert outcome.send == []
    assert outcome.results[0].reason == "no vehicle heard"
