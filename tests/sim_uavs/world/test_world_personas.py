"""Vehicles that meet, flown by personas of real autopilots with what goes wrong there: what holds whatever happens.

Four seeds, spread over the five hundred that `-m full` takes.
"""

from collections import Counter
from itertools import combinations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.navigation.vehicle import MISSION_MODES, InterruptOrder, MissionItemOrder, ResumeMissionOrder
from dyknow.reasoning import NEITHER_CAN_AVOID
from dyknow.sim_uavs.dynamics.flight import GUIDED_MODES, Mode
from tests.sim_uavs.wired import SentOrder
from tests.sim_uavs.world.meetings import Meeting, S, draw
from tests.sim_uavs.worlds import alarms, separations_m

LEAST_M = 5.0
TOLD_US = 3 * S
UNHEARD_US = 1_200_000
"""A vehicle tells its mode once a second; who is heard badly may be taken to be in the last one for three."""
FOR_MISSIONS = (InterruptOrder, ResumeMissionOrder, MissionItemOrder)
TOLD_GUIDED = {"GUIDED", "OFFBOARD", "AUTO.LOITER"}
OFTEN = 16
"""Four times a leg of the plan is ordered that is not answered, and each time it is sent four times."""
SEEDS = [pytest.param(seed, marks=() if seed % 250 == 2 else pytest.mark.full) for seed in range(500)]


@pytest.mark.parametrize("seed", SEEDS)
def test_whatever_autopilots_and_pilots_do_nobody_comes_near_untold_nor_is_commanded_out_of_turn(seed: int) -> None:
    meeting = Meeting(seed, draw(seed))
    meeting.run()
    told = f"seed {seed}: {'; '.join(map(str, meeting.flown))}"
    assert not near_and_untold(meeting), told
    assert not commanded_unguided(meeting), told
    assert not repeated(meeting), told


def near_and_untold(meeting: Meeting) -> list[str]:
    """Pairs in the air that were nearer than 5 m, without the alarm that neither can avoid 3 s before."""
    wrong = []
    for one, other in combinations(map(str, range(len(meeting.flown))), 2):
        ends_us = min(meeting.killed_us(int(unit)) for unit in (one, other))
        near = [(metres, at_us) for at_us, metres in separations_m(meeting.world, one, other) if at_us < ends_us]
        first_us = next((at_us for metres, at_us in near if metres < LEAST_M), None)
        if first_us is None:
            continue
        opened = [
            alarm.detected_us for alarm in alarms(meeting.task, NEITHER_CAN_AVOID) if set(alarm.units) == {one, other}
        ]
        if not opened or min(opened) > first_us - TOLD_US:
            least_m, at_us = min(near)
            wrong.append(f"{one} and {other}: {least_m:.1f} m at {meeting.seconds(at_us):.1f} s, told at {opened}")
    return wrong


def commanded_unguided(meeting: Meeting) -> list[str]:
    """Orders to vehicles that were for a while, or said that they were, in a mode that is not ours to command.

    In a mission that may be interrupted that is every order but those that leave it and continue it.
    """
    wrong = []
    for number, vehicle in enumerate(meeting.vehicles):
        flown = meeting.flown[number]
        lossy = any(trouble.fault.startswith("packet-loss") for trouble in flown.troubles)
        for order in vehicle.sent:
            may = flown.way == "mission, may be interrupted" and isinstance(order.order, FOR_MISSIONS)
            ours = {*GUIDED_MODES, *({Mode.AUTO} if may else ())}
            told = {*TOLD_GUIDED, *(MISSION_MODES if may else ())}
            since_us = meeting.mode_since_us(number, order.at_us, ours)
            late_us = 3 * UNHEARD_US if lossy else UNHEARD_US
            if order.told not in told or (order.mode not in ours and order.at_us - since_us > late_us):
                wrong.append(
                    f"{number} in {order.mode} at {meeting.seconds(order.at_us):.1f} s: {order.order}: {order.message}"
                )
    return wrong


def repeated(meeting: Meeting) -> list[str]:
    """Orders that were sent more often than an order is."""
    return [
        f"{number}: {count} times {order}"
        for number, vehicle in enumerate(meeting.vehicles)
        for order, count in Counter(said(order) for order in vehicle.sent if not is_speed(order)).items()
        if count > OFTEN
    ]


def is_speed(order: SentOrder) -> bool:
    """Whether it is the speed that goes with every leg of a plan."""
    return getattr(order.message, "command", None) == mavlink.MAV_CMD_DO_CHANGE_SPEED


def said(order: SentOrder) -> tuple[object, ...]:
    """What an order says, whichever repetition it is."""
    fields = order.message.to_dict()
    fields.pop("confirmation", None)
    return tuple(round(value, 5) if isinstance(value, float) else value for value in fields.values())
