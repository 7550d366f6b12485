"""How an order is expressed in MAVLink: the messages for each, the best way first. No socket and no clock."""

import math
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.model.errors import Refused
from dyknow.navigation import vehicle
from dyknow.navigation.geodesy import distance_m
from dyknow.proxies.mavlink.reports import PLANES, ROVERS, VehicleReports

_HERE_M, _SLOW_M_S = 3.0, 2.0
_M_PER_DEG = 111_194.9
_GUIDED = {"copter": 4, "plane": 15, "rover": 15}
_MISSION = {"copter": 3, "plane": 10, "rover": 10}
_PX4_AUTO, _PX4_LOITER, _PX4_MISSION = 4, 3, 4
_CUSTOM = float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)
_POSITION_ONLY = 0b110111111000
_GRIPPER = _WINCH = 1.0


class Target(NamedTuple):
    """MAVLink system and component: of the vehicle to command, or our own."""

    system: int
    component: int


OURSELVES = Target(254, 190)


class Way(NamedTuple):
    """One way of expressing an order.

    Attributes:
        messages: the first is acknowledged; the others go with it.
        acknowledged: the command, or the message, that its COMMAND_ACK names; None: nothing acknowledges it.
        changes_mode: whether it takes the vehicle out of the mode that it is in.
        again: the first message as it is repeated, where that differs: without leave to change the mode.
    """

    messages: list[Any]
    acknowledged: int | None
    changes_mode: bool = False
    again: Any | None = None

    @property
    def name(self) -> tuple[str, int | None]:
        """The key of the form that an autopilot does or does not understand."""
        return self.messages[0].get_type(), self.acknowledged


def long_command(target: Target, command: int, *parameters: float) -> Any:
    """A COMMAND_LONG; parameters not given are 0."""
    filled = (*parameters, *(0.0,) * (7 - len(parameters)))
    return mavlink.MAVLink_command_long_message(target.system, target.component, command, 0, *filled)


def ways_of(order: vehicle.Order, known: VehicleReports, target: Target) -> list[Way]:
    """The ways of expressing `order`, the best first.

    Raises:
        Refused: the vehicle is not known well enough to command it.
    """
    if known.autopilot is None:
        raise Refused("no vehicle heard", "no-vehicle")
    px4 = known.autopilot == mavlink.MAV_AUTOPILOT_PX4
    match order:
        case vehicle.Arm(armed):
            return [_said(long_command(target, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, float(armed)))]
        case vehicle.TakeOffOrder(height_m):
            return [_said(*_takeoff(height_m, known, target))]
        case vehicle.LandOrder():
            nan = math.nan if px4 else 0.0
            return [_said(long_command(target, mavlink.MAV_CMD_NAV_LAND, 0.0, 0.0, 0.0, nan), changes_mode=True)]
        case vehicle.ReturnHomeOrder():
            return [_said(long_command(target, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH), changes_mode=True)]
        case vehicle.SetGuided():
            return _mode((_PX4_AUTO, _PX4_LOITER) if px4 else (_GUIDED[_kind(known)],), target)
        case vehicle.ResumeMissionOrder():
            return _mode((_PX4_AUTO, _PX4_MISSION) if px4 else (_MISSION[_kind(known)],), target)
        case vehicle.MissionItemOrder(item):
            plain = mavlink.MAVLink_mission_set_current_message(target.system, target.component, item)
            return [
                _said(long_command(target, mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, float(item))),
                Way([plain], None),
            ]
        case vehicle.HoldOrder() if px4:
            return [_stopped(target, changes_mode=order.any_mode)]
        case vehicle.HoldOrder():
            at = known.position
            if at is None or at.altitude_m is None:
                raise Refused("the vehicle's position is unknown, it cannot hold it", "no-position")
            here = vehicle.GoToOrder(at.latitude_deg, at.longitude_deg, at.altitude_m, stops=True)
            return _point(here, known, target, takes_mode=order.any_mode)
        case vehicle.GoToOrder() | vehicle.InterruptOrder():
            return _point(order, known, target, takes_mode=px4 or isinstance(order, vehicle.InterruptOrder))
        case vehicle.PointMountOrder() | vehicle.LookAtOrder():
            return _mount(order, known, target)
        case vehicle.GripOrder(holds):
            return [_said(long_command(target, mavlink.MAV_CMD_DO_GRIPPER, _GRIPPER, float(holds)))]
        case vehicle.LineOrder(line_m):
            by_length = float(mavlink.WINCH_RELATIVE_LENGTH_CONTROL)
            more_m = let_out_m(line_m, known)
            return [_said(long_command(target, mavlink.MAV_CMD_DO_WINCH, _WINCH, by_length, more_m))]


def let_out_m(line_m: float, known: VehicleReports) -> float:
    """How much more of the line is to be out than is; raises Refused."""
    if not 0.0 <= line_m <= vehicle.LONGEST_LINE_M:
        raise Refused(f"a line of {line_m:g} m cannot be out; 0 to {vehicle.LONGEST_LINE_M:g} m can", "out-of-range")
    if known.winch is None or known.winch.line_m is None:
        raise Refused(
            "the vehicle does not say how much of a winch's line is out; has it a winch, and is it enabled?", "no-winch"
        )
    return line_m - known.winch.line_m


def _said(*messages: Any, changes_mode: bool = False) -> Way:
    return Way(list(messages), int(messages[0].command), changes_mode)


def _mode(numbers: tuple[int, ...], target: Target) -> list[Way]:
    """A custom mode, as a command and as the message that older autopilots know."""
    command = long_command(target, mavlink.MAV_CMD_DO_SET_MODE, _CUSTOM, *map(float, numbers))
    custom = numbers[0] if len(numbers) == 1 else numbers[0] << 16 | numbers[1] << 24
    message = mavlink.MAVLink_set_mode_message(target.system, int(_CUSTOM), custom)
    return [_said(command, changes_mode=True), Way([message], mavlink.MAVLINK_MSG_ID_SET_MODE, changes_mode=True)]


def _stopped(target: Target, *, changes_mode: bool) -> Way:
    """PX4 flies a goto in the mode in which it holds, so that this mode alone stops nothing: no place stops it where it can."""
    nan = math.nan
    change = float(mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE)
    flags = (change, 0.0)
    first, again = (
        long_command(target, mavlink.MAV_CMD_DO_REPOSITION, -1.0, each, 0.0, nan, nan, nan, nan) for each in flags
    )
    return Way([first], mavlink.MAV_CMD_DO_REPOSITION, changes_mode=changes_mode, again=None if changes_mode else again)


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


def _point(
    order: vehicle.GoToOrder | vehicle.InterruptOrder, known: VehicleReports, target: Target, *, takes_mode: bool
) -> list[Way]:
    """PX4 moves only with leave to change its mode; ArduPilot must not be taken out of a mode that its pilot chose.

    A vehicle in flight cannot stop where it is: ordered to, it flies on and comes back. So its target is put where it
    can stop, where the order is to stop.
    """
    speed_m_s = order.speed_m_s if isinstance(order, vehicle.GoToOrder) else None
    latitude_deg, longitude_deg = _stopping_place(order, known)
    place = round(latitude_deg * 1e7), round(longitude_deg * 1e7), order.altitude_m
    ask, change = 0.0, float(mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE)
    reposition = [
        mavlink.MAVLink_command_int_message(
            *target, mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_CMD_DO_REPOSITION, 0, 0,
            -1.0 if speed_m_s is None else speed_m_s, flags, 0.0, math.nan, *place,
        )
        for flags in (change if takes_mode else ask, ask)
    ]  # fmt: skip
    point = mavlink.MAVLink_set_position_target_global_int_message(
        0, *target, mavlink.MAV_FRAME_GLOBAL_INT, _POSITION_ONLY, *place, *(0.0,) * 8
    )
    px4 = known.autopilot == mavlink.MAV_AUTOPILOT_PX4
    faster = [] if speed_m_s is None or px4 else [_change_speed(target, speed_m_s)]
    if px4:
        return [Way([reposition[0]], mavlink.MAV_CMD_DO_REPOSITION, again=reposition[1])]
    if not takes_mode:
        return [Way([reposition[0], *faster], mavlink.MAV_CMD_DO_REPOSITION), Way([point, *faster], None)]
    first = mavlink.MAVLink_set_mode_message(target.system, int(_CUSTOM), _GUIDED[_kind(known)])
    return [
        Way([reposition[0]], mavlink.MAV_CMD_DO_REPOSITION, changes_mode=True),
        Way([first, point], mavlink.MAVLINK_MSG_ID_SET_MODE, changes_mode=True),
    ]


def _mount(order: vehicle.MountOrder, known: VehicleReports, target: Target) -> list[Way]:
    """The gimbal protocol, then what autopilots knew before it, which took heights above home."""
    if isinstance(order, vehicle.LookAtOrder):
        place = round(order.latitude_deg * 1e7), round(order.longitude_deg * 1e7), order.altitude_m
        by_int = mavlink.MAVLink_command_int_message(
            *target, mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_CMD_DO_SET_ROI_LOCATION, 0, 0, *(0.0,) * 4, *place
        )
        home_m = known.home_altitude_m
        if home_m is None:
            return [_said(by_int)]
        at = (order.latitude_deg, order.longitude_deg, order.altitude_m - home_m)
        roi = float(mavlink.MAV_ROI_LOCATION)
        return [_said(by_int), _said(long_command(target, mavlink.MAV_CMD_DO_SET_ROI, roi, 0.0, 0.0, 0.0, *at))]
    pitch_deg, yaw_deg, nan = -math.degrees(order.tilt_rad), math.degrees(order.pan_rad), math.nan
    level = float(mavlink.GIMBAL_MANAGER_FLAGS_ROLL_LOCK | mavlink.GIMBAL_MANAGER_FLAGS_PITCH_LOCK)
    targeting = float(mavlink.MAV_MOUNT_MODE_MAVLINK_TARGETING)
    return [
        _said(long_command(target, mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, pitch_deg, yaw_deg, nan, nan, level)),
        _said(
            long_command(target, mavlink.MAV_CMD_DO_MOUNT_CONTROL, pitch_deg, 0.0, yaw_deg, 0.0, 0.0, 0.0, targeting)
        ),
    ]


def _change_speed(target: Target, speed_m_s: float) -> Any:
    return long_command(target, mavlink.MAV_CMD_DO_CHANGE_SPEED, 1.0, speed_m_s, -1.0)


def _stopping_place(order: vehicle.GoToOrder | vehicle.InterruptOrder, known: VehicleReports) -> tuple[float, float]:
    """The order's place; if it is where the vehicle flies just now, the place where it can stop."""
    at, moves = known.position, known.velocity
    there = order.latitude_deg, order.longitude_deg
    if at is None or moves is None or not order.stops:
        return there
    speed_m_s = math.hypot(moves.north_m_s, moves.east_m_s)
    away_m = distance_m(at.latitude_deg, at.longitude_deg, *there)
    if speed_m_s < _SLOW_M_S or away_m > _HERE_M + 0.5 * speed_m_s:
        return there
    seconds = vehicle.stopping_distance_m(speed_m_s) / speed_m_s
    east_deg = seconds * moves.east_m_s / _M_PER_DEG / math.cos(math.radians(at.latitude_deg))
    return at.latitude_deg + seconds * moves.north_m_s / _M_PER_DEG, at.longitude_deg + east_deg
