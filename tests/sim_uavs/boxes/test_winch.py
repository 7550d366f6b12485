"""A winch and a magnet over MAVLink: what is answered, what hangs on the line, and what fails on demand."""

from math import hypot, nan

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.navigation.vehicle import GripOrder, LineOrder, WinchReport
from dyknow.sim_uavs.autopilot.commands import FlightOrder
from dyknow.sim_uavs.boxes.handled import BoxWorld, Handling
from dyknow.sim_uavs.dynamics.settings import PersonaName
from dyknow.sim_uavs.dynamics.slung import Thing
from tests.sim_uavs.boxes.flown import FlownBoxes


def attached(**settings: bool) -> FlownBoxes:
    """With the box on its line, just above the ground."""
    flown = FlownBoxes(**settings)
    assert flown.order(LineOrder(3.8), 6.0).accepted
    flown.fly(0.0, 0.0, 3.5, 4.0)
    assert flown.order(GripOrder(holds=True), 1.0).accepted
    assert flown.order(LineOrder(1.8), 4.0).accepted
    return flown


def test_what_the_magnet_takes_hangs_on_the_line_and_slows_the_climb() -> None:
    flown = attached()
    assert flown.winch.load_kg == pytest.approx(1.0)
    assert flown.placed("b1").holder == "0"
    assert flown.placed("b1").place[2] == pytest.approx(3.5 - 1.8 - 0.4, abs=0.1)
    laden, free = flown, FlownBoxes()
    for each in (laden, free):
        each.fly(0.0, 0.0, 3.5, 5.0)
        each.fly(0.0, 0.0, 30.0, 5.0)
    height_m = [each.vehicle.autopilot.flight.body.height_m for each in (laden, free)]
    assert height_m[0] < height_m[1] - 1.0


def test_a_load_that_stands_on_the_ground_weighs_nothing() -> None:
    flown = attached()
    flown.order(LineOrder(3.8), 5.0)
    assert flown.winch.load_kg == 0.0
    assert flown.placed("b1").holder == "0"


def test_what_is_released_falls_and_stays_near_and_an_empty_line_tells_of_it() -> None:
    flown = attached()
    flown.fly(0.0, 0.0, 7.0)
    assert flown.order(GripOrder(holds=False), 5.0).accepted
    assert flown.winch.load_kg == 0.0
    x, y, up = flown.placed("b1").place
    assert up == 0.0
    assert 0.0 < hypot(x, y) < 8.0


def test_a_carrier_holds_four_boxes_goes_with_them_and_sheds_a_fifth() -> None:
    boxes = [Thing(f"b{number}", "box", "red", 50.0, 50.0) for number in range(5)]
    world = BoxWorld([Thing("c1", "carrier", "grey", 0.0, 0.0), *boxes], 3)
    at_us = 0
    for box in boxes:
        at_us += 10_000_000
        assert world.on_handling(Handling(at_us, "take", box.name, "0", (0.0, 0.0, 1.0)))
        assert world.on_handling(Handling(at_us, "release", box.name, "0", (0.2, 0.1, 1.0)))
    at_us += 10_000_000
    placed = {each.thing.name: each for each in world.at(at_us)}
    assert [placed[each.name].on for each in boxes] == ["c1"] * 4 + [None]
    assert placed["b4"].place[2] == 0.0
    assert world.load_kg("c1") == pytest.approx(1.5 + 4.0)
    assert world.on_handling(Handling(at_us, "take", "c1", "0", (0.0, 0.0, 0.0)))
    assert world.on_handling(Handling(at_us, "carry", "c1", "0", (30.0, 20.0, 5.0)))
    assert {round(each.place[0]) for each in world.at(at_us) if each.on == "c1"} <= {29, 30, 31}


def test_without_a_winch_and_with_one_that_is_switched_off_orders_fail_as_those_of_arducopter_do() -> None:
    bare = FlownBoxes(equipped=False)
    assert bare.order(GripOrder(holds=True), 1.0).reason == "failed"
    assert not any(isinstance(each, WinchReport) for each in bare.reports)
    assert "does not say how much" in bare.order(LineOrder(2.0), 1.0).reason
    fitted = FlownBoxes()
    fitted.vehicle.autopilot.flight.settings.gripper_on = 0.0
    assert fitted.order(GripOrder(holds=True), 1.0).reason == "failed"
    fitted.vehicle.autopilot.flight.settings.winch_type = 0.0
    assert fitted.order(LineOrder(2.0), 1.0).reason == "failed"


@pytest.mark.parametrize("persona", ["px4", "ardupilot-3.3"])
def test_autopilots_that_were_not_met_with_a_gripper_do_not_understand_it(persona: PersonaName) -> None:
    flown = FlownBoxes(persona=persona)
    assert flown.order(GripOrder(holds=True), 1.0).reason == "unsupported"


@pytest.mark.parametrize("line_m", [-1.0, 51.0, nan])
def test_a_line_that_cannot_be_out_is_refused_before_it_is_sent(line_m: float) -> None:
    flown = FlownBoxes()
    assert "cannot be out" in flown.order(LineOrder(line_m), 0.5).reason
    assert not [sent for sent in flown.vehicle.sent if isinstance(sent.order, LineOrder)]


def test_a_repeated_order_lets_out_no_more_than_was_wanted() -> None:
    flown = FlownBoxes()
    flown.fail("ack-loss=100", 1.2)
    assert flown.order(LineOrder(4.0), 8.0).accepted
    assert len([sent for sent in flown.vehicle.sent if isinstance(sent.order, LineOrder)]) > 1
    assert flown.winch.line_m == pytest.approx(4.0, abs=0.3)


def test_a_winch_without_a_scale_does_not_say_what_hangs_on_it() -> None:
    flown = attached()
    flown.vehicle.autopilot.flight.settings.winch_type = 1.0
    flown.run(1.0)
    assert flown.winch.load_kg is None
    assert flown.winch.line_m == pytest.approx(1.8, abs=0.1)


def test_a_dropped_box_falls_although_the_magnet_is_on_and_a_failed_one_takes_nothing() -> None:
    flown = attached()
    flown.fly(0.0, 0.0, 7.0)
    flown.fail("dropped-box")
    flown.run(4.0)
    assert flown.winch.load_kg == 0.0
    assert flown.placed("b1").holder is None
    failed = FlownBoxes()
    failed.fail("failed-attach", 20.0)
    failed.order(LineOrder(3.8), 6.0)
    failed.fly(0.0, 0.0, 3.5, 4.0)
    failed.order(GripOrder(holds=True), 1.0)
    failed.order(LineOrder(1.8), 4.0)
    assert failed.winch.load_kg == 0.0
    failed.run(6.0)
    failed.order(LineOrder(3.8), 4.0)
    assert failed.placed("b1").holder == "0"


def test_a_misplaced_box_comes_down_beside() -> None:
    flown = attached()
    flown.fail("misplaced-box=6", 30.0)
    flown.order(LineOrder(2.6), 4.0)
    flown.order(GripOrder(holds=False), 4.0)
    x, y, _ = flown.placed("b1").place
    assert hypot(x, y) == pytest.approx(6.0, abs=1.5)


def test_a_late_vehicle_flies_more_slowly_and_a_stuck_one_does_not_rise() -> None:
    late, usual = FlownBoxes(), FlownBoxes()
    late.fail("late=4")
    for each in (late, usual):
        each.fly(100.0, 0.0, 7.0, 10.0)
    east_m = [each.vehicle.autopilot.flight.body.position.east for each in (late, usual)]
    assert east_m[0] < 0.4 * east_m[1]
    flight = FlownBoxes().vehicle.autopilot.flight
    flight.body = flight.body._replace(position=flight.body.position._replace(down=0.0))
    flight.is_stuck = True
    assert flight.take_off(7.0).value == "accepted"
    flight.on_time(flight.at_us + 3_000_000)
    assert flight.body.height_m == 0.0


def test_actions_of_a_winch_that_arducopter_does_not_have_fail_and_instances_are_ignored() -> None:
    commands = FlownBoxes().vehicle.autopilot._commands

    def obeyed(command: int, *params: float) -> int:
        filled = (*params, 0.0, 0.0, 0.0)
        return commands.obey(FlightOrder(command, (filled[0], filled[1], filled[2], filled[3]), 0.0, 0.0, 0.0, 0))

    wind, grip = mavlink.MAV_CMD_DO_WINCH, mavlink.MAV_CMD_DO_GRIPPER
    for instance in (0.0, 1.0, 7.0):
        taken = [obeyed(wind, instance, float(action), 1.0, 0.5) for action in range(10)]
        assert taken == [0, 0, 0] + [mavlink.MAV_RESULT_FAILED] * 7
        assert [obeyed(grip, instance, float(action)) for action in range(4)] == [0, 0, 4, 4]
    assert obeyed(wind, 0.0, 2.0, 0.0, nan) == mavlink.MAV_RESULT_FAILED
    assert obeyed(grip, 1.0, 1.5) == 0
