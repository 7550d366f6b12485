"""COMMAND_LONG, COMMAND_INT and their older and faster cousins: wire order to flight order, flight answer to MAV_RESULT."""

from collections.abc import Callable
from math import isfinite, nan, pi, radians
from typing import NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from dyknow.navigation.geodesy import LocalFrame
from dyknow.navigation.vehicle import LookAtOrder, MountOrder, PointMountOrder
from dyknow.sim_uavs.autopilot.link import Message
from dyknow.sim_uavs.autopilot.personas import Persona
from dyknow.sim_uavs.autopilot.points import local_point
from dyknow.sim_uavs.dynamics.flight import Flight, FlightAnswer, Mode, StatusText
from dyknow.sim_uavs.dynamics.quadcopter import Vector
from dyknow.sim_uavs.dynamics.slung import Hoist

LOOKING_DOWN = PointMountOrder(0.0, pi / 2.0)
_FROM_HOME = frozenset({mavlink.MAV_CMD_DO_SET_ROI, mavlink.MAV_CMD_DO_SET_ROI_LOCATION})
"""Commands whose COMMAND_LONG gives a height above home, as ArduPilot reads it."""
_FORCE = 21196.0  # the number that overrides the checks of arming
_IGNORE_POSITION, _IGNORE_VELOCITY, _IGNORE_YAW = 0b111, 0b111000, mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE

_RESULTS: dict[FlightAnswer, int] = {
    FlightAnswer.ACCEPTED: mavlink.MAV_RESULT_ACCEPTED,
    FlightAnswer.OUT_OF_RANGE: mavlink.MAV_RESULT_DENIED,
    FlightAnswer.NO_MISSION: mavlink.MAV_RESULT_DENIED,
    FlightAnswer.OUTSIDE_FENCE: mavlink.MAV_RESULT_FAILED,
    FlightAnswer.DENIED: mavlink.MAV_RESULT_DENIED,
    FlightAnswer.UNSUPPORTED: mavlink.MAV_RESULT_UNSUPPORTED,
    FlightAnswer.FAILED: mavlink.MAV_RESULT_FAILED,
}


class FlightOrder(NamedTuple):
    """A command whichever message carried it: degrees, and altitude in the sense of `frame` (MAV_FRAME)."""

    command: int
    params: tuple[float, float, float, float]
    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    frame: int


def read_order(message: Message) -> FlightOrder:
    """COMMAND_LONG carries degrees as floats, COMMAND_INT degrees times 1e7."""
    params = (message.param1, message.param2, message.param3, message.param4)
    if message.get_msgId() == mavlink.MAVLINK_MSG_ID_COMMAND_INT:
        return FlightOrder(message.command, params, message.x / 1e7, message.y / 1e7, message.z, message.frame)
    at = (message.param5, message.param6, message.param7)
    frame = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT if message.command in _FROM_HOME else mavlink.MAV_FRAME_GLOBAL
    return FlightOrder(message.command, params, *at, frame)


class Commands:
    """Orders to one flight. Every answer that is not an acceptance is also sent as a text."""

    def __init__(
        self,
        flight: Flight,
        frame: LocalFrame,
        persona: Persona,
        disobeys: Callable[[], FlightAnswer | None],
        aim: Callable[[MountOrder], FlightAnswer],
        hoist: Callable[[], Hoist | None],
    ) -> None:
        self._flight, self._frame, self._persona, self._disobeys = flight, frame, persona, disobeys
        self._aim, self._hoist = aim, hoist
        self._known: dict[int, Callable[[FlightOrder], FlightAnswer]] = {
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm,
            mavlink.MAV_CMD_DO_SET_MODE: self._set_mode,
            mavlink.MAV_CMD_DO_SET_STANDARD_MODE: self._set_standard_mode,
            mavlink.MAV_CMD_NAV_TAKEOFF: self._take_off,
            mavlink.MAV_CMD_NAV_LAND: lambda _: flight.set_mode(Mode.LAND),
            mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda _: flight.set_mode(Mode.RTL),
            mavlink.MAV_CMD_NAV_LOITER_UNLIM: lambda _: flight.set_mode(self._holding),
            mavlink.MAV_CMD_MISSION_START: lambda _: flight.set_mode(Mode.AUTO),
            mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: self._set_item,
            mavlink.MAV_CMD_DO_REPOSITION: self._reposition,
            mavlink.MAV_CMD_DO_CHANGE_SPEED: self._change_speed,
            mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW: self._turn_gimbal,
            mavlink.MAV_CMD_DO_MOUNT_CONTROL: self._turn_mount,
            mavlink.MAV_CMD_DO_SET_ROI_LOCATION: self._look_at,
            mavlink.MAV_CMD_DO_SET_ROI: self._look_at,
            mavlink.MAV_CMD_DO_SET_ROI_NONE: lambda _: aim(LOOKING_DOWN),
            mavlink.MAV_CMD_DO_GRIPPER: self._grip,
            mavlink.MAV_CMD_DO_WINCH: self._wind,
        }

    def obey(self, order: FlightOrder) -> int:
        """The MAV_RESULT of a command; UNSUPPORTED for those no flight knows."""
        perform = self._known.get(order.command)
        if perform is None or order.command in self._persona.not_understood:
            return int(mavlink.MAV_RESULT_UNSUPPORTED)
        return self._result(self._disobeys() or perform(order))

    def set_custom_mode(self, custom_mode: int) -> int:
        mode = self._persona.mode(custom_mode)
        if mode is None:
            return int(mavlink.MAV_RESULT_DENIED)
        return self._result(self._disobeys() or self._flight.set_mode(mode))

    def go_to_item(self, message: Message) -> int:
        """A mission item that is not for the mission (current = 2): fly there now. MAV_MISSION_RESULT."""
        point = local_point(self._frame, message.frame, message.x / 1e7, message.y / 1e7, message.z)
        answer = FlightAnswer.OUT_OF_RANGE if point is None else self._flight.go_to(point)
        self._result(answer)
        return int(mavlink.MAV_MISSION_ACCEPTED if answer is FlightAnswer.ACCEPTED else mavlink.MAV_MISSION_DENIED)

    def set_global_target(self, message: Message) -> None:
        point = local_point(
            self._frame, message.coordinate_frame, message.lat_int / 1e7, message.lon_int / 1e7, message.alt
        )
        self._set_target(message, point)

    def set_local_target(self, message: Message) -> None:
        """From home, or as an offset from where the vehicle is."""
        point: Vector | None = Vector(message.x, message.y, message.z)
        if point and message.coordinate_frame == mavlink.MAV_FRAME_LOCAL_OFFSET_NED:
            point = self._flight.body.position.plus(point)
        elif message.coordinate_frame != mavlink.MAV_FRAME_LOCAL_NED:
            point = None
        self._set_target(message, point)

    def _set_target(self, message: Message, point: Vector | None) -> None:
        mask = message.type_mask
        if point is None or self._disobeys() not in {None, FlightAnswer.UNSUPPORTED}:
            return
        if mask & _IGNORE_POSITION != _IGNORE_POSITION:
            self._flight.go_to(point, None if mask & _IGNORE_YAW else message.yaw)
        elif mask & _IGNORE_VELOCITY != _IGNORE_VELOCITY:
            self._flight.drift(Vector(message.vx, message.vy, message.vz))

    def _result(self, answer: FlightAnswer) -> int:
        if answer is not FlightAnswer.ACCEPTED:
            self._flight.events.append(StatusText(mavlink.MAV_SEVERITY_WARNING, f"Refused: {answer.value}"))
        return _RESULTS.get(answer, int(mavlink.MAV_RESULT_TEMPORARILY_REJECTED))

    @property
    def _holding(self) -> Mode:
        """PX4 holds in the mode that takes positions, ArduPilot in one of its own."""
        return Mode.GUIDED if self._persona.names_take_off else Mode.LOITER

    def _arm(self, order: FlightOrder) -> FlightAnswer:
        wanted, force = order.params[0], order.params[1] == _FORCE
        if wanted not in {0.0, 1.0}:
            return FlightAnswer.OUT_OF_RANGE
        return self._flight.arm(force=force) if wanted == 1.0 else self._flight.disarm(force=force)

    def _set_mode(self, order: FlightOrder) -> FlightAnswer:
        flags, first, second, _ = order.params
        if not all(map(isfinite, (flags, first, second))) or not int(flags) & 1:
            return FlightAnswer.OUT_OF_RANGE
        number = int(first) << 16 | int(second) << 24 if self._persona.names_take_off else int(first)
        mode = self._persona.mode(number)
        return FlightAnswer.OUT_OF_RANGE if mode is None else self._flight.set_mode(mode)

    def _set_standard_mode(self, order: FlightOrder) -> FlightAnswer:
        mode = next((m for m, number in self._persona.standard.items() if number == order.params[0]), None)
        return FlightAnswer.OUT_OF_RANGE if mode is None else self._flight.set_mode(mode)

    def _take_off(self, order: FlightOrder) -> FlightAnswer:
        """ArduPilot: above home, in GUIDED only. PX4: above sea or, when not a number, as its parameter says."""
        height_m = order.altitude_m
        if self._persona.names_take_off:
            height_m = height_m - self._frame.altitude_m if isfinite(height_m) else self._flight.settings.take_off_m
            if self._flight.armed and not self._flight.airborne:
                self._flight.set_mode(Mode.GUIDED)
        return self._flight.take_off(height_m)

    def _reposition(self, order: FlightOrder) -> FlightAnswer:
        """Speed below 0 keeps the present one; coordinates that are not numbers mean the present ones."""
        speed_m_s, flags, _, yaw_rad = order.params
        is_changed = isfinite(flags) and int(flags) & mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE
        if self._persona.stops_nowhere and not any(map(isfinite, order[2:5])):
            if is_changed and self._flight.airborne:
                self._flight.set_mode(Mode.GUIDED)
            return self._flight.hold()
        here = self._frame.from_ned(*self._flight.body.position)
        latitude_deg = order.latitude_deg if isfinite(order.latitude_deg) else here[0]
        longitude_deg = order.longitude_deg if isfinite(order.longitude_deg) else here[1]
        point = local_point(self._frame, order.frame, latitude_deg, longitude_deg, order.altitude_m)
        if point is None:
            return FlightAnswer.OUT_OF_RANGE
        if is_changed and self._flight.airborne:
            self._flight.set_mode(Mode.GUIDED)
        answer = self._flight.go_to(point, yaw_rad if isfinite(yaw_rad) else nan)
        if answer is FlightAnswer.NOT_GUIDED and self._persona.denies_unguided:
            return FlightAnswer.DENIED
        if answer is FlightAnswer.OUTSIDE_FENCE and self._persona.accepts_outside:
            self._flight.events.append(StatusText(mavlink.MAV_SEVERITY_CRITICAL, "Reposition is outside geofence"))
            return FlightAnswer.ACCEPTED
        if answer is FlightAnswer.ACCEPTED and isfinite(speed_m_s) and speed_m_s > 0.0:
            self._flight.change_speed(speed_m_s)
        return answer

    def _change_speed(self, order: FlightOrder) -> FlightAnswer:
        kind, speed_m_s, _, _ = order.params
        if kind not in {mavlink.SPEED_TYPE_AIRSPEED, mavlink.SPEED_TYPE_GROUNDSPEED}:
            return FlightAnswer.OUT_OF_RANGE
        return self._flight.change_speed(speed_m_s)

    def _set_item(self, order: FlightOrder) -> FlightAnswer:
        index = order.params[0]
        return self._flight.set_item(int(index)) if isfinite(index) else FlightAnswer.OUT_OF_RANGE

    def _turn_gimbal(self, order: FlightOrder) -> FlightAnswer:
        """From the heading and the horizon; a yaw that is locked to north, and rates, are not taken."""
        pitch_deg, yaw_deg, *_ = order.params
        flags = order.latitude_deg
        if not isfinite(flags) or int(flags) & mavlink.GIMBAL_MANAGER_FLAGS_YAW_LOCK:
            return FlightAnswer.OUT_OF_RANGE
        return self._aim(PointMountOrder(radians(yaw_deg), -radians(pitch_deg)))

    def _turn_mount(self, order: FlightOrder) -> FlightAnswer:
        """DO_MOUNT_CONTROL, before the gimbal protocol: pitch, roll, yaw in degrees; the mode in the last parameter."""
        pitch_deg, _, yaw_deg, _ = order.params
        if order.altitude_m != mavlink.MAV_MOUNT_MODE_MAVLINK_TARGETING:
            return FlightAnswer.OUT_OF_RANGE
        return self._aim(PointMountOrder(radians(yaw_deg), -radians(pitch_deg)))

    def _grip(self, order: FlightOrder) -> FlightAnswer:
        """Accepted whatever is below the magnet, and whichever gripper is named."""
        hoist, action = self._hoist(), order.params[1]
        if hoist is None or not self._flight.settings.gripper_on or not isfinite(action):
            return FlightAnswer.FAILED
        if int(action) == mavlink.GRIPPER_ACTION_GRAB:
            hoist.grip()
            self._say("Gripper load grabbing")
        elif int(action) == mavlink.GRIPPER_ACTION_RELEASE:
            hoist.release(self._flight.at_us)
            self._say("Gripper load releasing")
        else:
            return FlightAnswer.FAILED
        return FlightAnswer.ACCEPTED

    def _wind(self, order: FlightOrder) -> FlightAnswer:
        """By length as fast as the winch is set to, whatever speed is asked for; three of its actions are known.

        A value that is no number fails; ArduCopter falls over.
        """
        hoist, (_, action, length_m, speed_m_s) = self._hoist(), order.params
        if hoist is None or not self._flight.settings.winch_type or not all(map(isfinite, order.params)):
            return FlightAnswer.FAILED
        if int(action) == mavlink.WINCH_RELAXED:
            hoist.relax()
        elif int(action) == mavlink.WINCH_RELATIVE_LENGTH_CONTROL:
            wanted_m = hoist.let_out(length_m)
            verb = "lowering" if length_m >= 0.0 else "raising"
            self._say(f"Winch: {verb} {abs(length_m):4.1f}m to {wanted_m:4.1f}m")
        elif int(action) == mavlink.WINCH_RATE_CONTROL:
            hoist.let_out_at(speed_m_s)
        else:
            return FlightAnswer.FAILED
        return FlightAnswer.ACCEPTED

    def _say(self, text: str) -> None:
        self._flight.events.append(StatusText(mavlink.MAV_SEVERITY_INFO, text))

    def _look_at(self, order: FlightOrder) -> FlightAnswer:
        """A place; without one ArduPilot stops looking at any."""
        place = order.latitude_deg, order.longitude_deg, order.altitude_m
        if place == (0.0, 0.0, 0.0):
            return self._aim(LOOKING_DOWN)
        point = local_point(self._frame, order.frame, *place)
        if point is None:
            return FlightAnswer.OUT_OF_RANGE
        return self._aim(LookAtOrder(*self._frame.from_ned(*point)))
