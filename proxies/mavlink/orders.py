"""Orders become MAVLink commands, and their acknowledgements become results. No socket and no clock.

An order can be expressed in several ways; an autopilot that does not understand one (UNSUPPORTED) gets the next, and from
then on that one only. A way is sent until it is acknowledged, at most `ATTEMPTS` times; DENIED and FAILED are final. Each
repetition looks at the vehicle's mode first: a vehicle that is no longer guided was taken over, and is left alone. What
changes the mode is repeated only after a heartbeat has shown that nothing has changed it meanwhile.

COMMAND_ACK names a command and not an order, so each sending is remembered, and an acknowledgement answers the oldest
that is not answered: one of an order that a newer one replaced does not end the newer one.
"""

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.model.errors import Refused
from navigation import vehicle
from navigation.geodesy import distance_m
from proxies.mavlink.reports import PLANES, ROVERS, VehicleReports

RETRY_US = 500_000
ATTEMPTS = 4
ANSWERS_WITHIN_US = 3_000_000
"""An acknowledgement that takes longer than this is lost."""
_PATIENCE_US = 10_000_000
_MODE_PATIENCE_US = 4_500_000
_HERE_M, _SLOW_M_S = 3.0, 2.0
_M_PER_DEG = 111_194.9
_GUIDED = {"copter": 4, "plane": 15, "rover": 15}
_MISSION = {"copter": 3, "plane": 10, "rover": 10}
_PX4_AUTO, _PX4_LOITER, _PX4_MISSION = 4, 3, 4
_CUSTOM = float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)
_POSITION_ONLY = 0b110111111000
_GRIPPER = _WINCH = 1.0
_PURPOSES = {
    vehicle.Arm: "arming",
    vehicle.PointMountOrder: "mount",
    vehicle.LookAtOrder: "mount",
    vehicle.GripOrder: "gripper",
    vehicle.LineOrder: "winch",
}
"""What an order moves: a newer one for the same takes the place of an older one."""
_REFUSALS = {
    mavlink.MAV_RESULT_TEMPORARILY_REJECTED: "temporarily rejected",
    mavlink.MAV_RESULT_DENIED: "denied",
    mavlink.MAV_RESULT_UNSUPPORTED: "unsupported",
    mavlink.MAV_RESULT_FAILED: "failed",
}


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
        """What an autopilot does or does not understand."""
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
            return _mode((_PX4_AUTO, _PX4_LOITER), target)
        case vehicle.HoldOrder():
            at = known.position
            if at is None or at.altitude_m is None:
                raise Refused("the vehicle's position is unknown, it cannot hold it", "no-position")
            here = vehicle.GoToOrder(at.latitude_deg, at.longitude_deg, at.altitude_m)
            return _point(here, known, target, takes_mode=False)
        case vehicle.GoToOrder() | vehicle.InterruptOrder():
            return _point(order, known, target, takes_mode=px4 or isinstance(order, vehicle.InterruptOrder))
        case vehicle.PointMountOrder() | vehicle.LookAtOrder():
            return _mount(order, known, target)
        case vehicle.GripOrder(holds):
            return [_said(long_command(target, mavlink.MAV_CMD_DO_GRIPPER, _GRIPPER, float(holds)))]
        case vehicle.LineOrder(line_m):
            by_length = float(mavlink.WINCH_RELATIVE_LENGTH_CONTROL)
            more_m = _let_out_m(line_m, known)
            return [_said(long_command(target, mavlink.MAV_CMD_DO_WINCH, _WINCH, by_length, more_m))]


def _let_out_m(line_m: float, known: VehicleReports) -> float:
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
    can stop.
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
    if at is None or moves is None:
        return there
    speed_m_s = math.hypot(moves.north_m_s, moves.east_m_s)
    away_m = distance_m(at.latitude_deg, at.longitude_deg, *there)
    if speed_m_s < _SLOW_M_S or away_m > _HERE_M + 0.5 * speed_m_s:
        return there
    seconds = vehicle.stopping_distance_m(speed_m_s) / speed_m_s
    east_deg = seconds * moves.east_m_s / _M_PER_DEG / math.cos(math.radians(at.latitude_deg))
    return at.latitude_deg + seconds * moves.north_m_s / _M_PER_DEG, at.longitude_deg + east_deg


@dataclass(slots=True)
class _Sending:
    """An order that is being sent: in which of its ways, how often so far, and in which mode the vehicle was."""

    command: vehicle.Command
    ways: list[Way]
    target: Target
    known: VehicleReports
    next_us: int
    give_up_us: int
    mode: str
    sent: int = 0
    heartbeats: int = 0
    word: str = vehicle.NO_ANSWER
    way: Way = field(init=False)

    def __post_init__(self) -> None:
        self.way = self.ways[0]

    @property
    def is_shown(self) -> bool:
        """Whether the vehicle is in the mode that was ordered, whatever became of the acknowledgement."""
        wanted = self.known.mode in vehicle.MODES_OF.get(type(self.command.order), ())
        return wanted and self.known.mode != self.mode

    @property
    def is_taken_over(self) -> bool:
        """Whether the vehicle has left the mode in which the order was given, for one that takes no positions."""
        return self.known.mode != self.mode and not self.known.guided


class OrderOutcome(NamedTuple):
    """What a step asks for: messages to send, results to tell."""

    send: list[Any]
    results: list[vehicle.CommandResult]

    def tell(self, sending: _Sending, accepted: bool, reason: str) -> None:
        self.results.append(vehicle.CommandResult(0, sending.command.number, accepted, reason))


class Errands:
    """The orders under way to one vehicle. Time is that of the retries (wall time); results are stamped by the caller."""

    def __init__(self, ourselves: Target = OURSELVES) -> None:
        self._ourselves = ourselves
        self._open: dict[str, _Sending] = {}
        self._unanswered: dict[int, deque[tuple[int, int]]] = {}
        self._foreign: set[tuple[str, int | None]] = set()

    def on_command(self, command: vehicle.Command, known: VehicleReports, target: Target, now_us: int) -> OrderOutcome:
        """Send an order; it takes the place of an older one that is still being sent."""
        outcome = OrderOutcome([], [])
        try:
            ways = ways_of(command.order, known, target)
        except Refused as refused:
            return OrderOutcome([], [vehicle.CommandResult(0, command.number, False, refused.reason)])
        purpose = _PURPOSES.get(type(command.order), "flight")
        replaced = self._open.pop(purpose, None)
        if replaced is not None:
            outcome.tell(replaced, accepted=False, reason=vehicle.SUPERSEDED)
        understood = [way for way in ways if way.name not in self._foreign]
        sending = _Sending(command, understood or ways[-1:], target, known, now_us, now_us, known.mode)
        self._open[purpose] = sending
        self._begin(purpose, sending, outcome, now_us)
        return outcome

    def _begin(self, purpose: str, sending: _Sending, outcome: OrderOutcome, now_us: int) -> None:
        """Send it in its present way for the first time."""
        sending.sent, way = 0, sending.way
        patience_us = _MODE_PATIENCE_US if way.changes_mode else ATTEMPTS * RETRY_US
        sending.give_up_us = now_us + patience_us
        if way.acknowledged is None:
            outcome.tell(sending, accepted=True, reason=vehicle.UNCONFIRMED)
        self._send(sending, outcome, now_us)
        self._open[purpose] = sending

    def _send(self, sending: _Sending, outcome: OrderOutcome, now_us: int) -> None:
        way = sending.way
        messages = list(way.messages)
        if sending.sent and way.again is not None:
            messages[0] = way.again
        if isinstance(sending.command.order, vehicle.LineOrder) and sending.known.winch is not None:
            messages[0].param3 = _let_out_m(sending.command.order.line_m, sending.known)
        if sending.sent and hasattr(messages[0], "confirmation"):
            messages[0].confirmation = sending.sent
        outcome.send.extend(_with_escort(messages))
        if way.acknowledged is not None:
            self._unanswered.setdefault(way.acknowledged, deque()).append((sending.command.number, now_us))
        sending.sent += 1
        sending.next_us, sending.heartbeats = now_us + RETRY_US, sending.known.heartbeats

    def on_ack(self, acknowledged: Any, now_us: int) -> OrderOutcome:
        """COMMAND_ACK; "in progress" buys time, "temporarily rejected" may change, anything else is the answer."""
        outcome = OrderOutcome([], [])
        to = getattr(acknowledged, "target_system", 0), getattr(acknowledged, "target_component", 0)
        if any(given not in {0, own} for given, own in zip(to, self._ourselves, strict=True)):
            return outcome
        waiting = self._unanswered.get(acknowledged.command, deque())
        while waiting and now_us - waiting[0][1] > ANSWERS_WITHIN_US:
            waiting.popleft()
        if not waiting:
            return outcome
        number, _ = waiting.popleft()
        if acknowledged.result == mavlink.MAV_RESULT_IN_PROGRESS:
            waiting.appendleft((number, now_us + _PATIENCE_US - ANSWERS_WITHIN_US))
        for purpose, sending in list(self._open.items()):
            if sending.command.number == number and sending.way.acknowledged == acknowledged.command:
                self._answered(purpose, sending, acknowledged.result, outcome, now_us)
        return outcome

    def _answered(self, purpose: str, sending: _Sending, result: int, outcome: OrderOutcome, now_us: int) -> None:
        way = sending.way
        if result == mavlink.MAV_RESULT_IN_PROGRESS:
            sending.next_us = sending.give_up_us = now_us + _PATIENCE_US
        elif result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED:
            sending.word = _REFUSALS[result]
        elif result == mavlink.MAV_RESULT_UNSUPPORTED and way.again is not None and sending.sent > 1:
            pass  # the repetition lacks the leave that this autopilot wants
        elif result == mavlink.MAV_RESULT_UNSUPPORTED and way is not sending.ways[-1]:
            self._foreign.add(way.name)
            sending.way = sending.ways[sending.ways.index(way) + 1]
            if sending.is_taken_over:
                self._close(purpose, outcome, accepted=False, reason=vehicle.OVERTAKEN)
            else:
                self._begin(purpose, sending, outcome, now_us)
        else:
            accepted = result == mavlink.MAV_RESULT_ACCEPTED
            reason = "" if accepted else _REFUSALS.get(result, f"result {result}")
            self._close(purpose, outcome, accepted=accepted, reason=reason)

    def on_time(self, now_us: int) -> OrderOutcome:
        outcome = OrderOutcome([], [])
        for purpose, sending in list(self._open.items()):
            if now_us < min(sending.next_us, sending.give_up_us):
                continue
            way = sending.way
            if sending.is_shown:
                self._close(purpose, outcome, accepted=True, reason="")
            elif way.acknowledged is None and sending.sent >= ATTEMPTS:
                del self._open[purpose]
            elif sending.is_taken_over and (purpose == "flight" or way.changes_mode):
                self._close(purpose, outcome, accepted=False, reason=vehicle.OVERTAKEN)
            elif now_us >= sending.give_up_us:
                self._close(purpose, outcome, accepted=False, reason=sending.word)
            elif sending.sent < ATTEMPTS and (not way.changes_mode or sending.known.heartbeats > sending.heartbeats):
                self._send(sending, outcome, now_us)
        return outcome

    def _close(self, purpose: str, outcome: OrderOutcome, *, accepted: bool, reason: str) -> None:
        outcome.tell(self._open.pop(purpose), accepted, reason)


def _with_escort(messages: list[Any]) -> list[Any]:
    """A parameter must arrive before the command that reads it, a speed after the command it belongs to."""
    parameters = [each for each in messages if each.get_type() == "PARAM_SET"]
    return parameters + [each for each in messages if each.get_type() != "PARAM_SET"]
