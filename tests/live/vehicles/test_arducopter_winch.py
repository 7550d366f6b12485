"""What ArduCopter answers to commands for a winch and a gripper; the simulated autopilot answers alike."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.sim_uavs.autopilot.commands import FlightOrder
from tests.live.vehicles.sitl import Sitl, absence
from tests.sim_uavs.boxes.flown import FlownBoxes

pytestmark = [pytest.mark.live, pytest.mark.skipif(bool(absence()), reason=absence())]

FITTED = {
    "GRIP_ENABLE": 1.0, "GRIP_TYPE": 2.0, "WINCH_TYPE": 1.0, "WINCH_RATE_MAX": 2.0, "SERVO9_FUNCTION": 28.0,
    "SERVO10_FUNCTION": 88.0,
}  # fmt: skip
ASKED = [
    (mavlink.MAV_CMD_DO_GRIPPER, instance, action) for instance in (0, 1, 7) for action in (0.0, 1.0, 1.5, 2.0, 3.0)
]
ASKED += [
    (mavlink.MAV_CMD_DO_WINCH, instance, action) for instance in (0, 1) for action in (0.0, 1.0, 1.5, 2.0, 3.0, 6.0)
]


def answers(command: Callable[..., int]) -> Iterator[int]:
    return (command(kind, float(instance), action, 1.0, 0.5) for kind, instance, action in ASKED)


def simulated(flown: FlownBoxes) -> Callable[..., int]:
    obey = flown.vehicle.autopilot._commands.obey
    return lambda kind, one, two, three, four: obey(FlightOrder(kind, (one, two, three, four), 0.0, 0.0, 0.0, 0))


@pytest.mark.parametrize("is_fitted", [False, True])
def test_the_simulated_autopilot_answers_as_arducopter_does(tmp_path: Path, is_fitted: bool) -> None:
    with Sitl(tmp_path, 17_790, parameters=FITTED if is_fitted else {}) as real:
        found = list(answers(real.command))
        if is_fitted:
            real.parameter("SIM_SPEEDUP", 1)
            real.every(mavlink.MAVLINK_MSG_ID_WINCH_STATUS, 5.0)
            real.command(mavlink.MAV_CMD_DO_WINCH, 0.0, 2.0, 0.0, 0.0)
            out_m = real.heard("WINCH_STATUS").line_length
            real.command(mavlink.MAV_CMD_DO_WINCH, 0.0, 1.0, 3.0, 0.5)
            real.heard("WINCH_STATUS", lambda told: abs(told.line_length - out_m - 3.0) < 0.15)
    assert found == list(answers(simulated(FlownBoxes(equipped=is_fitted))))
    assert (mavlink.MAV_RESULT_ACCEPTED in found) is is_fitted
