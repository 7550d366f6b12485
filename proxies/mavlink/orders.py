"""Orders become MAVLink commands, and their acknowledgements become results. No socket and no clock.

Each order is one command per autopilot, sent until it is acknowledged: four times, half a second apart. A newer order
that needs the same MAVLink command takes the place of the older one.
"""

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.model.errors import Refused
from navigation import vehicle
from proxies.mavlink.reports import PLANES, ROVERS, VehicleReports

RETRY_US = 500_000
ATTEMPTS = 4
_PATIENCE_US = 10_000_000
_GUIDED = {"copter": 4, "plane": 15, "rover": 15}
_MISSION = {"copter": 3, "plane": 10, "rover": 10}
_PX4_AUTO, _PX4_LOITER, _PX4_MISSION = 4, 3, 4
_CUSTOM = float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)
_REFUSALS = {
    mavlink.MAV_RESULT_TEMPORARILY_REJECTED: "temporarily rejected",
    mavlink.MAV_RESULT_DENIED: "denied",
    mavlink.MAV_RESULT_UNSUPPORTED: "unsupported",
    mavlink.MAV_RESULT_FAILED: "failed",
}


class Target(NamedTuple):
    """Whom to command: MAVLink system and component."""

    system: int
    component: int


def long_command(target: Target, command: int, *parameters: float) -> Any:
    """A COMMAND_LONG; parameters not given are 0."""
    filled = (*parameters, *(0.0,) * (7 - len(parameters)))
    return mavlink.MAVLink_command_long_message(target.system, target.component, command, 0, *filled)


def messages_for(order: vehicle.Order, known: VehicleReports, target: Target) -> list[Any]:
    """The messages that carry out `order`: the first is acknowledged, the others go with it.

    Raises:
        Refused: the vehicle is not known well enough to command it.
    """
    px4 = known.autopilot == mavlink.MAV_AUTOPILOT_PX4
    if known.autopilot is None:
        raise Refused("no vehicle heard")
    match order:
        case vehicle.Arm(armed):
            return [long_command(target, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, float(armed))]
        case vehicle.SetGuided():
            return [_guided(known, target)]
        case vehicle.TakeOffOrder(height_m):
            return _takeoff(height_m, known, target)
        case vehicle.GoToOrder(latitude_deg, longitude_deg, altitude_m, speed_m_s):
            sent = [_reposition(target, latitude_deg, longitude_deg, altitude_m, speed_m_s, px4=px4)]
            if speed_m_s is not None and not px4:
                sent.append(long_command(target, mavlink.MAV_CMD_DO_CHANGE_SPEED, 1.0, speed_m_s, -1.0))
            return sent
        case vehicle.HoldOrder() if px4:
            return [_guided(known, target)]
        case vehicle.HoldOrder():
            at = known.position
            if at is None or at.altitude_m is None:
                raise Refused("the vehicle's position is unknown, it cannot hold it")
            return [_reposition(target, at.latitude_deg, at.longitude_deg, at.altitude_m, None, px4=False)]
        case vehicle.LandOrder():
            nan = math.nan
            return [long_command(target, mavlink.MAV_CMD_NAV_LAND, 0.0, 0.0, 0.0, nan if px4 else 0.0)]
        case vehicle.ReturnHomeOrder():
            return [long_command(target, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)]
        case vehicle.InterruptOrder(latitude_deg, longitude_deg, altitude_m):
            return [_reposition(target, latitude_deg, longitude_deg, altitude_m, None, px4=True)]
        case vehicle.ResumeMissionOrder():
            mode = (_PX4_AUTO, _PX4_MISSION) if px4 else (_MISSION[_kind(known)],)
            return [long_command(target, mavlink.MAV_CMD_DO_SET_MODE, _CUSTOM, *mode)]
        case vehicle.MissionItemOrder(item):
            return [long_command(target, mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, float(item))]


def _guided(known: VehicleReports, target: Target) -> Any:
    if known.autopilot == mavlink.MAV_AUTOPILOT_PX4:
        return long_command(target, mavlink.MAV_CMD_DO_SET_MODE, _CUSTOM, _PX4_AUTO, _PX4_LOITER)
    return long_command(target, mavlink.MAV_CMD_DO_SET_MODE, _CUSTOM, _GUIDED[_kind(known)])


def _kind(known: VehicleReports) -> str:
    return "plane" if known.vehicle_type in PLANES else "rover" if known.vehicle_type in ROVERS else "copter"


def _takeoff(height_m: float, known: VehicleReports, target: Target) -> list[Any]:
    """ArduPilot takes a height above home; PX4 an altitude above mean sea level, else its parameter."""
    if known.autopilot != mavlink.MAV_AUTOPILOT_PX4:
        return [long_command(target, mavlink.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, height_m)]
    altitude_m = math.nan if known.home is None else known.home.altitude_m + height_m
    nan = math.nan
    parameter = mavlink.MAVLink_param_set_message(
        target.system, target.component, b"MIS_TAKEOFF_ALT", height_m, mavlink.MAV_PARAM_TYPE_REAL32
    )
    return [long_command(target, mavlink.MAV_CMD_NAV_TAKEOFF, nan, 0.0, 0.0, nan, nan, nan, altitude_m), parameter]


def _reposition(
    target: Target, latitude_deg: float, longitude_deg: float, altitude_m: float, speed_m_s: float | None, *, px4: bool
) -> Any:
    """PX4 wants leave to change its mode; ArduPilot must not be taken out of a mode that its pilot chose."""
    flags = float(mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE) if px4 else 0.0
    return mavlink.MAVLink_command_int_message(
        target.system,
        target.component,
        mavlink.MAV_FRAME_GLOBAL,
        mavlink.MAV_CMD_DO_REPOSITION,
        0,
        0,
        -1.0 if speed_m_s is None else speed_m_s,
        flags,
        0.0,
        math.nan,
        round(latitude_deg * 1e7),
        round(longitude_deg * 1e7),
        altitude_m,
    )


@dataclass(slots=True)
class _Errand:
    number: int
    messages: list[Any]
    next_us: int
    give_up_us: int
    sent: int = field(default=1)


class OrderOutcome(NamedTuple):
    """What a step asks for: messages to send, results to tell."""

    send: list[Any]
    results: list[vehicle.CommandResult]


class Errands:
    """The orders under way to one vehicle. Time is that of the retries (wall time); results are stamped by the caller."""

    def __init__(self) -> None:
        self._open: dict[int, _Errand] = {}

    def on_command(self, command: vehicle.Command, known: VehicleReports, target: Target, now_us: int) -> OrderOutcome:
        try:
            messages = messages_for(command.order, known, target)
        except Refused as refused:
            return OrderOutcome([], [vehicle.CommandResult(0, command.number, False, refused.reason)])
        key = int(messages[0].command)
        replaced = self._open.pop(key, None)
        results = [] if replaced is None else [vehicle.CommandResult(0, replaced.number, False, vehicle.SUPERSEDED)]
        self._open[key] = _Errand(command.number, messages, now_us + RETRY_US, now_us + ATTEMPTS * RETRY_US)
        return OrderOutcome(_with_escort(messages), results)

    def on_ack(self, acknowledged: Any, now_us: int) -> OrderOutcome:
        """COMMAND_ACK; "in progress" buys time, anything else ends the errand."""
        errand = self._open.get(acknowledged.command)
        if errand is None:
            return OrderOutcome([], [])
        if acknowledged.result == mavlink.MAV_RESULT_IN_PROGRESS:
            errand.next_us = errand.give_up_us = now_us + _PATIENCE_US
            return OrderOutcome([], [])
        del self._open[acknowledged.command]
        accepted = acknowledged.result == mavlink.MAV_RESULT_ACCEPTED
        reason = "" if accepted else _REFUSALS.get(acknowledged.result, f"result {acknowledged.result}")
        return OrderOutcome([], [vehicle.CommandResult(0, errand.number, accepted, reason)])

    def on_time(self, now_us: int) -> OrderOutcome:
        outcome = OrderOutcome([], [])
        for key, errand in list(self._open.items()):
            if now_us >= errand.give_up_us:
                del self._open[key]
                outcome.results.append(vehicle.CommandResult(0, errand.number, False, vehicle.NO_ANSWER))
            elif now_us >= errand.next_us:
                errand.next_us = now_us + RETRY_US
                if hasattr(errand.messages[0], "confirmation"):
                    errand.messages[0].confirmation = errand.sent
                errand.sent += 1
                outcome.send.extend(_with_escort(errand.messages))
        return outcome


def _with_escort(messages: list[Any]) -> list[Any]:
    """A parameter must arrive before the command that reads it, a speed after the command it belongs to."""
    parameters = [each for each in messages if each.get_type() == "PARAM_SET"]
    return parameters + [each for each in messages if each.get_type() != "PARAM_SET"]
