"""MAVLink messages become reports: units end here (degE7, mm, cm/s, milli-g go in; degrees, metres, seconds come out).

No socket and no clock: the time at which a message held is an argument.
"""

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.navigation import vehicle
from dyknow.navigation.fences import FenceArea
from dyknow.navigation.inertial import GRAVITY_M_S2
from dyknow.proxies.mavlink.parameters import CRUISE_PARAMETERS, FENCE_PARAMETERS, VehicleParameters

_UNKNOWN_16 = 65_535
_ASSUMED_ERROR_M = 2.0
"""A receiver's error at a dilution of precision of 1, where the message gives only the dilution."""
_NEAR_M = 30.0
_PX4_MAIN = {
    1: "MANUAL",
    2: "ALTCTL",
    3: "POSCTL",
    4: "AUTO",
    5: "ACRO",
    6: "OFFBOARD",
    7: "STABILIZED",
    8: "RATTITUDE",
}
_PX4_AUTO = {
    1: "READY",
    2: "TAKEOFF",
    3: "LOITER",
    4: "MISSION",
    5: "RTL",
    6: "LAND",
    8: "FOLLOW_TARGET",
    9: "PRECLAND",
}
PLANES = {mavlink.MAV_TYPE_FIXED_WING} | {
    number for number, entry in mavlink.enums["MAV_TYPE"].items() if entry.name.startswith("MAV_TYPE_VTOL")
}
ROVERS = {mavlink.MAV_TYPE_GROUND_ROVER, mavlink.MAV_TYPE_SURFACE_BOAT}
_IN_AIR = {
    mavlink.MAV_LANDED_STATE_ON_GROUND: False,
    mavlink.MAV_LANDED_STATE_IN_AIR: True,
    mavlink.MAV_LANDED_STATE_TAKEOFF: True,
    mavlink.MAV_LANDED_STATE_LANDING: True,
}
_FLYING = {mavlink.MAV_STATE_ACTIVE, mavlink.MAV_STATE_CRITICAL, mavlink.MAV_STATE_EMERGENCY}
"""An ArduPilot that flies in a failsafe says CRITICAL."""
_ABSOLUTE_FRAMES = {mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT}
_RELATIVE_FRAMES = {mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT}
_NO_POSITION_MASK = 0b111
LEAST_SEVERITY = mavlink.MAV_SEVERITY_WARNING
"""Severities count down: greater ones are notices and information."""


def device_us(message: Any) -> int | None:
    """When the message held by the vehicle's own clock, in microseconds since it booted or since 1970; None if unsaid.

    HOME_POSITION carries a time as well, that at which home was set: it holds now.
    """
    boot_ms = getattr(message, "time_boot_ms", None)
    if boot_ms is not None:
        return int(boot_ms) * 1000
    usec = getattr(message, "time_usec", None)
    return int(usec) if usec and message.get_type() != "HOME_POSITION" else None


def tells_time(message: Any) -> bool:
    """Whether the stamp is the moment of sending. That of GPS_RAW_INT is the last fix, which may be long ago."""
    return bool(message.get_type() != "GPS_RAW_INT")


def is_autopilot(heartbeat: Any) -> bool:
    """Whether a HEARTBEAT comes from a vehicle, not from a ground station, a radio, a gimbal or a companion computer."""
    return bool(heartbeat.autopilot != mavlink.MAV_AUTOPILOT_INVALID and heartbeat.type != mavlink.MAV_TYPE_GCS)


class VehicleReports:
    """The reports of one vehicle, with the little memory that its messages need to be understood.

    A GLOBAL_POSITION_INT of ArduPilot states its altitude above nothing until home is set: altitude and relative
    altitude are then equal. Such an altitude is used only if home or the satellite receiver confirm it.
    """

    def __init__(self) -> None:
        self.autopilot: int | None = None
        self.vehicle_type: int | None = None
        self.home: vehicle.HomeReport | None = None
        self.position: vehicle.PositionReport | None = None
        self.velocity: vehicle.VelocityReport | None = None
        self.winch: vehicle.WinchReport | None = None
        self.mode, self.guided, self.heartbeats = "", False, 0
        self._parameters = VehicleParameters()
        self._areas: tuple[FenceArea, ...] = ()
        self._airborne: bool | None = None
        self._satellite_altitude_m: float | None = None
        self._has_fix: bool | None = None
        self._heartbeat: Any = None
        self._yaw_rad: float | None = None

    def on_reboot(self) -> None:
        """Forget what the vehicle itself forgot."""
        self.home = self.winch = self._airborne = self._satellite_altitude_m = self._has_fix = None
        self._parameters.forget()

    def reports(self, message: Any, valid_us: int) -> tuple[vehicle.Report, ...]:
        """The reports in `message`; empty for types that do not describe the vehicle and for unknown fields."""
        handler = DESCRIBING.get(message.get_type())
        return handler(self, message, valid_us) if handler is not None else ()

    def on_heartbeat(self, message: Any, valid_us: int) -> tuple[vehicle.Report, ...]:
        if not is_autopilot(message):
            return ()
        self.autopilot, self.vehicle_type, self._heartbeat = message.autopilot, message.type, message
        self.heartbeats += 1
        return (self._status(message, valid_us),)

    def _status(self, heartbeat: Any, valid_us: int) -> vehicle.StatusReport:
        armed = bool(heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        airborne = self._airborne
        if airborne is None and self.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA:
            airborne = armed and heartbeat.system_status in _FLYING
        self.mode, self.guided = flight_mode(heartbeat.autopilot, heartbeat.type, heartbeat.custom_mode)
        return vehicle.StatusReport(valid_us, armed, self.guided, airborne, self.mode)

    def on_extended_state(self, message: Any, valid_us: int) -> tuple[vehicle.Report, ...]:
        airborne = _IN_AIR.get(message.landed_state)
        changed = airborne != self._airborne
        self._airborne = airborne
        return (self._status(self._heartbeat, valid_us),) if changed and self._heartbeat is not None else ()

    def on_global_position(self, message: Any, valid_us: int) -> tuple[vehicle.Report, ...]:
        if message.lat == 0 and message.lon == 0:
            return ()
        velocity = self.velocity = vehicle.VelocityReport(
            valid_us, "GLOBAL_POSITION_INT", message.vx / 100, message.vy / 100, message.vz / 100
        )
        altitude_m, height_m = message.alt / 1000, message.relative_alt / 1000
        above_nothing = message.alt == message.relative_alt and not self._confirmed(altitude_m, height_m)
        self.position = vehicle.PositionReport(
            valid_us,
            "GLOBAL_POSITION_INT",
            message.lat / 1e7,
            message.lon / 1e7,
            None if above_nothing else altitude_m,
            height_m=None if above_nothing else height_m,
        )
        return velocity, self.position

    def _confirmed(self, altitude_m: float, height_m: float) -> bool:
        if self._satellite_altitude_m is not None:
            return abs(self._satellite_altitude_m - altitude_m) <= _NEAR_M
        return self.home is not None and abs(self.home.altitude_m + height_m - altitude_m) <= _NEAR_M

    def on_gps(self, message: Any, valid_us: int) -> tuple[vehicle.Report, ...]:
        has_fix, before = message.fix_type >= mavlink.GPS_FIX_TYPE_3D_FIX, self._has_fix
        self._has_fix = has_fix
        news = () if has_fix == before else (vehicle.FixReport(valid_us, has_fix),)
        return *self._on_fix(message, valid_us), *news

    def _on_fix(self, message: Any, valid_us: int) -> tuple[vehicle.Report, ...]:
        if message.fix_type < mavlink.GPS_FIX_TYPE_2D_FIX or (message.lat == 0 and message.lon == 0):
            self._satellite_altitude_m = None
            return ()
        solid = message.fix_type >= mavlink.GPS_FIX_TYPE_3D_FIX
        altitude_m = message.alt / 1000 if solid else None
        self._satellite_altitude_m = altitude_m
        position = vehicle.PositionReport(
            valid_us,
            message.get_type(),
            message.lat / 1e7,
            message.lon / 1e7,
            altitude_m,
            _accuracy_m(getattr(message, "h_acc", 0), message.eph),
            _accuracy_m(getattr(message, "v_acc", 0), message.epv),
        )
        if _UNKNOWN_16 in {message.vel, message.cog}:
            return (position,)
        speed_m_s, course_rad = message.vel / 100, math.radians(message.cog / 100)
        stated_m_s = getattr(message, "vel_acc", 0) / 1000
        north, east = speed_m_s * math.cos(course_rad), speed_m_s * math.sin(course_rad)
        return vehicle.VelocityReport(valid_us, message.get_type(), north, east, None, stated_m_s or 0.5), position

    def on_local_position(self, message: Any, valid_us: int) -> tuple[vehicle.Report, ...]:
        at = (message.x, message.y, message.z, message.vx, message.vy, message.vz)
        return (vehicle.LocalPositionReport(valid_us, "LOCAL_POSITION_NED", *at),)

    def on_attitude(self, message: Any, valid_us: int) -> tuple[vehicle.Report, ...]:
        self._yaw_rad = message.yaw if math.isfinite(message.yaw) else None
        return (vehicle.AttitudeReport(valid_us, "ATTITUDE", message.roll, message.pitch, message.yaw),)

    def on_highres_imu(self, message: Any, valid_us: int) -> tuple[vehicle.Report, ...]:
        return (vehicle.AccelerationReport(valid_us, "HIGHRES_IMU", message.xacc, message.yacc, message.zacc),)

    def on_scaled_imu(self, message: Any, valid_us: int) -> tuple[vehicle.Report, ...]:
        force = (each / 1000 * GRAVITY_M_S2 for each in (message.xacc, message.yacc, message.zacc))
        return (vehicle.AccelerationReport(valid_us, message.get_type(), *force),)

    def on_raw_imu(self, message: Any, valid_us: int) -> tuple[vehicle.Report, ...]:
        """The unit is the sensor's own; ArduPilot's is milli-g, others' is not known."""
        return self.on_scaled_imu(message, valid_us) if self.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA else ()

    def on_battery(self, message: Any, valid_us: int) -> tuple[vehicle.Report, ...]:
        second = message.get_type() == "BATTERY_STATUS" and message.id != 0
        if message.battery_remaining < 0 or second:
            return ()
        current_a = message.current_battery / 100 if message.current_battery >= 0 else None
        return (vehicle.BatteryReport(valid_us, min(message.battery_remaining, 100) / 100, current_a),)

    def on_home(self, message: Any, valid_us: int) -> tuple[vehicle.Report, ...]:
        if message.latitude == 0 and message.longitude == 0:
            return ()
        self.home = vehicle.HomeReport(
            valid_us, message.latitude / 1e7, message.longitude / 1e7, message.altitude / 1000
        )
        return (self.home,)

    def on_target(self, message: Any, valid_us: int) -> tuple[vehicle.Report, ...]:
        altitude_m = message.alt
        if message.coordinate_frame in _RELATIVE_FRAMES:
            altitude_m = math.nan if self.home is None else altitude_m + self.home.altitude_m
        elif message.coordinate_frame not in _ABSOLUTE_FRAMES:
            return ()
        if message.type_mask & _NO_POSITION_MASK or not math.isfinite(altitude_m):
            return ()
        return (vehicle.TargetReport(valid_us, message.lat_int / 1e7, message.lon_int / 1e7, altitude_m),)

    def on_text(self, message: Any, valid_us: int) -> tuple[vehicle.Report, ...]:
        """STATUSTEXT: warnings and errors."""
        text = message.text if isinstance(message.text, str) else bytes(message.text).decode("utf-8", "replace")
        text = "".join(each for each in text.partition("\0")[0] if each.isprintable()).strip()
        if message.severity > LEAST_SEVERITY or not text:
            return ()
        return (vehicle.TextReport(valid_us, message.severity, text),)

    def on_mission_current(self, message: Any, valid_us: int) -> tuple[vehicle.Report, ...]:
        return (vehicle.MissionReport(valid_us, message.seq),)

    def on_gimbal(self, message: Any, valid_us: int) -> tuple[vehicle.Report, ...]:
        """GIMBAL_DEVICE_ATTITUDE_STATUS: a quaternion from the camera to the horizon, turned from north or from the heading."""
        w, x, y, z = message.q
        length = math.hypot(w, x, y, z)
        if not 0.5 < length < 2.0:
            return ()
        w, x, y, z = w / length, x / length, y / length, z / length
        # The camera's right stays level: its yaw is known also where the camera looks straight down, and turns over.
        yaw_rad = math.atan2(2.0 * (w * z - x * y), 1.0 - 2.0 * (x * x + z * z))
        north, east, down = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)
        pitch_rad = math.atan2(-down, north * math.cos(yaw_rad) + east * math.sin(yaw_rad))
        if _turned_from_north(message.flags):
            if self._yaw_rad is None:
                return ()
            yaw_rad -= self._yaw_rad
        return (vehicle.MountReport(valid_us, "GIMBAL_DEVICE_ATTITUDE_STATUS", _half_turn(yaw_rad), -pitch_rad),)

    def on_mount(self, message: Any, valid_us: int) -> tuple[vehicle.Report, ...]:
        """MOUNT_ORIENTATION, of older autopilots: degrees, pitch from the horizon, yaw from the heading."""
        if not (math.isfinite(message.yaw) and abs(message.pitch) <= 180.0):
            return ()
        pan_rad, tilt_rad = math.radians(message.yaw), -math.radians(message.pitch)
        return (vehicle.MountReport(valid_us, "MOUNT_ORIENTATION", _half_turn(pan_rad), tilt_rad),)

    def on_winch(self, message: Any, valid_us: int) -> tuple[vehicle.Report, ...]:
        """WINCH_STATUS: a value that is no number is unknown; winches without a scale send no tension."""
        status = message.status
        self.winch = vehicle.WinchReport(
            valid_us,
            _known(message.line_length),
            _known(message.speed),
            _known(message.tension),
            bool(status & mavlink.MAV_WINCH_STATUS_HEALTHY),
            bool(status & mavlink.MAV_WINCH_STATUS_MOVING),
        )
        return (self.winch,)

    def on_parameter(self, message: Any, valid_us: int) -> tuple[vehicle.Report, ...]:
        """PARAM_VALUE: parameters of the fence, of the reactions to a lost link, and of the cruise speed."""
        name = self._parameters.on_value(self.autopilot, message)
        if name is None:
            return ()
        if name in FENCE_PARAMETERS[self.autopilot or 0]:
            return (self.fence(self._areas, valid_us),)
        if name in CRUISE_PARAMETERS[self.autopilot or 0]:
            return (self._parameters.cruise(self.autopilot, valid_us),)
        return (self._parameters.failsafe(self.autopilot, valid_us),)

    def fence(self, areas: tuple[FenceArea, ...], valid_us: int) -> vehicle.FenceReport:
        """Its fence, with the polygons and circles that were read of it (`dyknow.proxies.mavlink.fence_list`)."""
        self._areas = areas
        return self._parameters.fence(self.autopilot, valid_us, areas)

    @property
    def home_altitude_m(self) -> float | None:
        """Of home, as it is reported, or as it follows from a position above it."""
        if self.home is not None:
            return self.home.altitude_m
        at = self.position
        return None if at is None or at.altitude_m is None or at.height_m is None else at.altitude_m - at.height_m

    @property
    def untold_parameters(self) -> tuple[str, ...]:
        """Those of the fence, of the failsafe and of its speeds that the vehicle has not reported."""
        return self._parameters.untold(self.autopilot)


DESCRIBING: dict[str, Callable[[VehicleReports, Any, int], tuple[vehicle.Report, ...]]] = {
    "HEARTBEAT": VehicleReports.on_heartbeat,
    "EXTENDED_SYS_STATE": VehicleReports.on_extended_state,
    "GLOBAL_POSITION_INT": VehicleReports.on_global_position,
    "GPS_RAW_INT": VehicleReports.on_gps,
    "LOCAL_POSITION_NED": VehicleReports.on_local_position,
    "ATTITUDE": VehicleReports.on_attitude,
    "HIGHRES_IMU": VehicleReports.on_highres_imu,
    "SCALED_IMU": VehicleReports.on_scaled_imu,
    "RAW_IMU": VehicleReports.on_raw_imu,
    "SYS_STATUS": VehicleReports.on_battery,
    "BATTERY_STATUS": VehicleReports.on_battery,
    "HOME_POSITION": VehicleReports.on_home,
    "POSITION_TARGET_GLOBAL_INT": VehicleReports.on_target,
    "STATUSTEXT": VehicleReports.on_text,
    "MISSION_CURRENT": VehicleReports.on_mission_current,
    "GIMBAL_DEVICE_ATTITUDE_STATUS": VehicleReports.on_gimbal,
    "MOUNT_ORIENTATION": VehicleReports.on_mount,
    "WINCH_STATUS": VehicleReports.on_winch,
    "PARAM_VALUE": VehicleReports.on_parameter,
}
"""The reports in each message that describes a vehicle."""


def _turned_from_north(flags: int) -> bool:
    """Whether the yaw of a gimbal is from north; gimbals that say neither are from north where their yaw is locked."""
    if flags & (mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_EARTH_FRAME | mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_VEHICLE_FRAME):
        return bool(flags & mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_EARTH_FRAME)
    return bool(flags & mavlink.GIMBAL_DEVICE_FLAGS_YAW_LOCK)


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _half_turn(angle_rad: float) -> float:
    """The same angle within half a turn."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


def _accuracy_m(stated_mm: int, dilution_100: int) -> float:
    """Standard deviation of a fix: the receiver's, else from its dilution of precision, else a cautious default."""
    if stated_mm > 0:
        return stated_mm / 1000
    return 5.0 if dilution_100 in (0, _UNKNOWN_16) else max(1.0, dilution_100 / 100 * _ASSUMED_ERROR_M)


def autopilot_name(autopilot: int | None, vehicle_type: int | None) -> str:
    """As its makers call it: ArduCopter, ArduPlane, PX4."""
    if autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA:
        kinds = {mavlink.MAV_TYPE_SUBMARINE: "ArduSub", mavlink.MAV_TYPE_ANTENNA_TRACKER: "AntennaTracker"}
        kinds |= dict.fromkeys(PLANES, "ArduPlane") | dict.fromkeys(ROVERS, "Rover")
        return kinds.get(vehicle_type, "ArduCopter")
    if autopilot == mavlink.MAV_AUTOPILOT_PX4:
        return "PX4"
    entry = mavlink.enums["MAV_AUTOPILOT"].get(autopilot)
    return "an autopilot" if entry is None else str(entry.name).removeprefix("MAV_AUTOPILOT_").lower()


def flight_mode(autopilot: int, vehicle_type: int, custom_mode: int) -> tuple[str, bool]:
    """The mode's name, and whether the vehicle takes positions in it."""
    if autopilot == mavlink.MAV_AUTOPILOT_PX4:
        main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
        name = _PX4_MAIN.get(main, str(main))
        if name == "AUTO":
            name = f"AUTO.{_PX4_AUTO.get(sub, sub)}"
        return name, name in {"AUTO.LOITER", "OFFBOARD"}
    if autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA:
        kind = "PLANE" if vehicle_type in PLANES else "ROVER" if vehicle_type in ROVERS else "COPTER"
        entry = mavlink.enums[f"{kind}_MODE"].get(custom_mode)
        name = str(custom_mode) if entry is None else str(entry.name).removeprefix(f"{kind}_MODE_")
        return name, name == "GUIDED"
    return str(custom_mode), False
