"""Telemetry of a vehicle: one builder per MAVLink message, from one snapshot. SI turns into wire units here."""

from collections.abc import Callable, Mapping
from math import cos, isfinite, nan, pi, sin
from typing import NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from dyknow.navigation.cameras.pinhole import PanTilt
from dyknow.navigation.geodesy import LocalFrame
from dyknow.sim_uavs.autopilot.link import Message
from dyknow.sim_uavs.autopilot.personas import Persona
from dyknow.sim_uavs.dynamics.flight import GUIDED_MODES, Drifting, Flight, GoingTo, Mode
from dyknow.sim_uavs.dynamics.quadcopter import GRAVITY_M_S2, Vector
from dyknow.sim_uavs.dynamics.sensors import GpsReading, ImuReading
from dyknow.sim_uavs.dynamics.slung import Hoist

_INT32_MIN, _INT32_MAX = -(2**31), 2**31 - 1
_CELLS, _FULL_CELL_MV, _EMPTY_CELL_MV = 6, 4200, 3300
_UNKNOWN_16 = 65535
WINCH_WITH_SCALE = 2.0
_LEVEL_GIMBAL = (
    mavlink.GIMBAL_DEVICE_FLAGS_ROLL_LOCK
    | mavlink.GIMBAL_DEVICE_FLAGS_PITCH_LOCK
    | mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_VEHICLE_FRAME
)
_SENSORS = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
    | mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | mavlink.MAV_SYS_STATUS_SENSOR_GPS
    | mavlink.MAV_SYS_STATUS_SENSOR_ANGULAR_RATE_CONTROL
    | mavlink.MAV_SYS_STATUS_SENSOR_ATTITUDE_STABILIZATION
    | mavlink.MAV_SYS_STATUS_SENSOR_Z_ALTITUDE_CONTROL
    | mavlink.MAV_SYS_STATUS_SENSOR_XY_POSITION_CONTROL
    | mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
    | mavlink.MAV_SYS_STATUS_AHRS
    | mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
    | mavlink.MAV_SYS_STATUS_PREARM_CHECK
)


class Snapshot(NamedTuple):
    """A vehicle at one instant: `boot_ms` and `utc_us` by its own clock, sensors as they read (`gps` None: no fix).

    `mount` None: it carries no camera; `winch` None: no winch, or none that is switched on.
    """

    boot_ms: int
    utc_us: int
    flight: Flight
    frame: LocalFrame
    persona: Persona
    gps: GpsReading | None
    imu: ImuReading
    has_mission: int
    mount: PanTilt | None = None
    winch: Hoist | None = None


def _int32(value: float) -> int:
    """The result of a C cast: out of range or not a number becomes the least integer."""
    return round(value) if isfinite(value) and _INT32_MIN <= value <= _INT32_MAX else _INT32_MIN


def _int16(value: float) -> int:
    return max(-32768, min(32767, round(value))) if isfinite(value) else -32768


def _heading_cdeg(yaw_rad: float) -> int:
    return round(yaw_rad % (2.0 * pi) * 18000.0 / pi) % 36000 if isfinite(yaw_rad) else _UNKNOWN_16


def geodetic(frame: LocalFrame, point: Vector) -> tuple[int, int, int]:
    """Degrees times 1e7 twice and millimetres above mean sea level, as most messages carry them."""
    if not all(map(isfinite, point)):
        return _INT32_MIN, _INT32_MIN, _INT32_MIN
    latitude, longitude, altitude = frame.from_ned(*point)
    return _int32(latitude * 1e7), _int32(longitude * 1e7), _int32(altitude * 1e3)


def heartbeat(s: Snapshot) -> Message:
    flight = s.flight
    flags = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
    if flight.armed:
        flags |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    if flight.mode in GUIDED_MODES:
        flags |= mavlink.MAV_MODE_FLAG_GUIDED_ENABLED
    if flight.mode in {Mode.AUTO, Mode.RTL, Mode.LAND}:
        flags |= mavlink.MAV_MODE_FLAG_AUTO_ENABLED
    state = mavlink.MAV_STATE_ACTIVE if flight.armed else mavlink.MAV_STATE_STANDBY
    if flight.body.charge <= flight.settings.battery_critical:
        state = mavlink.MAV_STATE_CRITICAL
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_QUADROTOR, s.persona.autopilot, flags, _custom_mode(s), state, 3
    )


def _custom_mode(s: Snapshot) -> int:
    return s.persona.custom_mode(s.flight.mode, taking_off=s.flight.taking_off)


def current_mode(s: Snapshot) -> Message:
    return mavlink.MAVLink_current_mode_message(s.persona.standard.get(s.flight.mode, 0), _custom_mode(s), 0)


def sys_status(s: Snapshot) -> Message:
    health = _SENSORS
    if s.gps is None:
        health &= ~(mavlink.MAV_SYS_STATUS_SENSOR_GPS | mavlink.MAV_SYS_STATUS_PREARM_CHECK)
    charge = s.flight.body.charge
    if charge <= s.flight.settings.battery_critical:
        health &= ~(mavlink.MAV_SYS_STATUS_SENSOR_BATTERY | mavlink.MAV_SYS_STATUS_PREARM_CHECK)
    millivolts, centiamperes = _battery(s)
    return mavlink.MAVLink_sys_status_message(
        _SENSORS, _SENSORS, health, 150, millivolts, centiamperes, round(charge * 100), 0, 0, 0, 0, 0, 0
    )


def _battery(s: Snapshot) -> tuple[int, int]:
    body = s.flight.body
    millivolts = round(_CELLS * (_EMPTY_CELL_MV + body.charge * (_FULL_CELL_MV - _EMPTY_CELL_MV)))
    return millivolts, round(body.power_w / millivolts * 1000.0 * 100.0)


def battery_status(s: Snapshot) -> Message:
    millivolts, centiamperes = _battery(s)
    cells = [millivolts // _CELLS] * _CELLS + [_UNKNOWN_16] * (10 - _CELLS)
    used = 1.0 - s.flight.body.charge
    capacity_mah = s.flight.limits.capacity_wh / (_CELLS * 3.7) * 1000.0
    left = round(s.flight.body.charge * 100)
    return mavlink.MAVLink_battery_status_message(
        0,
        1,
        1,
        2500,
        cells,
        centiamperes,
        round(used * capacity_mah),
        round(used * s.flight.limits.capacity_wh * 36.0),
        left,
    )


def system_time(s: Snapshot) -> Message:
    return mavlink.MAVLink_system_time_message(max(0, s.utc_us), s.boot_ms)


def global_position(s: Snapshot) -> Message | None:
    if s.gps is None:
        return None
    latitude, longitude, altitude_mm = geodetic(s.frame, s.gps.position)
    height_mm = _int32(altitude_mm - s.frame.altitude_m * 1e3)
    speeds = (_int16(component * 100.0) for component in s.gps.velocity)
    return mavlink.MAVLink_global_position_int_message(
        s.boot_ms, latitude, longitude, altitude_mm, height_mm, *speeds, _heading_cdeg(s.imu.yaw_rad)
    )


def gps_raw(s: Snapshot) -> Message:
    """Without a fix it still says so, as receivers do."""
    if s.gps is None:
        unknown = _UNKNOWN_16
        return mavlink.MAVLink_gps_raw_int_message(
            s.boot_ms * 1000, mavlink.GPS_FIX_TYPE_NO_FIX, 0, 0, 0, unknown, unknown, unknown, unknown, 0
        )
    latitude, longitude, altitude_mm = geodetic(s.frame, s.gps.position)
    speed = s.gps.velocity.horizontal
    return mavlink.MAVLink_gps_raw_int_message(
        s.boot_ms * 1000,
        mavlink.GPS_FIX_TYPE_3D_FIX,
        latitude,
        longitude,
        altitude_mm,
        80,
        120,
        min(_UNKNOWN_16 - 1, round(speed * 100)) if isfinite(speed) else _UNKNOWN_16,
        _UNKNOWN_16,
        s.gps.satellites,
        altitude_mm,
        round(s.gps.horizontal_sd_m * 1e3),
        round(s.gps.vertical_sd_m * 1e3),
        200,
        0,
        0,
    )


def local_position(s: Snapshot) -> Message | None:
    if s.gps is None:
        return None
    return mavlink.MAVLink_local_position_ned_message(s.boot_ms, *s.gps.position, *s.gps.velocity)


def attitude(s: Snapshot) -> Message:
    return mavlink.MAVLink_attitude_message(s.boot_ms, s.imu.roll_rad, s.imu.pitch_rad, s.imu.yaw_rad, *s.imu.rates)


def raw_imu(s: Snapshot) -> Message:
    """Acceleration in milli-g, rates in mrad/s, as ArduPilot scales them; no field strength."""
    force = (_int16(component / GRAVITY_M_S2 * 1000.0) for component in s.imu.force)
    rates = (_int16(component * 1000.0) for component in s.imu.rates)
    return mavlink.MAVLink_raw_imu_message(s.boot_ms * 1000, *force, *rates, 0, 0, 0)


def highres_imu(s: Snapshot) -> Message:
    """Acceleration and rates in SI; bits 0 to 5 of `fields_updated` say that only these are measured."""
    unmeasured = (0.0,) * 7
    return mavlink.MAVLink_highres_imu_message(s.boot_ms * 1000, *s.imu.force, *s.imu.rates, *unmeasured, 0x3F)


def vfr_hud(s: Snapshot) -> Message:
    velocity = s.gps.velocity if s.gps else Vector(nan, nan, nan)
    position = s.gps.position if s.gps else Vector(nan, nan, nan)
    heading = _heading_cdeg(s.imu.yaw_rad) // 100
    throttle = min(100, round(s.flight.body.power_w / s.flight.limits.hover_w * 50.0))
    altitude_m = s.frame.altitude_m - position.down
    return mavlink.MAVLink_vfr_hud_message(
        velocity.horizontal, velocity.horizontal, heading, throttle, altitude_m, -velocity.down
    )


def home_position(s: Snapshot) -> Message:
    latitude, longitude, altitude_mm = geodetic(s.frame, Vector(0.0, 0.0, 0.0))
    return mavlink.MAVLink_home_position_message(
        latitude, longitude, altitude_mm, 0.0, 0.0, 0.0, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0, s.boot_ms * 1000
    )


def global_origin(s: Snapshot) -> Message:
    return mavlink.MAVLink_gps_global_origin_message(
        *geodetic(s.frame, Vector(0.0, 0.0, 0.0)), time_usec=s.boot_ms * 1000
    )


def extended_sys_state(s: Snapshot) -> Message:
    flight = s.flight
    landed = mavlink.MAV_LANDED_STATE_IN_AIR if flight.airborne else mavlink.MAV_LANDED_STATE_ON_GROUND
    if flight.airborne and flight.taking_off:
        landed = mavlink.MAV_LANDED_STATE_TAKEOFF
    elif flight.landing:
        landed = mavlink.MAV_LANDED_STATE_LANDING
    return mavlink.MAVLink_extended_sys_state_message(mavlink.MAV_VTOL_STATE_UNDEFINED, landed)


def mission_current(s: Snapshot) -> Message:
    flight = s.flight
    state = mavlink.MISSION_STATE_NO_MISSION
    if s.has_mission:
        active = flight.mode is Mode.AUTO and flight.armed
        state = mavlink.MISSION_STATE_ACTIVE if active else mavlink.MISSION_STATE_NOT_STARTED
        if flight.progress.complete:
            state = mavlink.MISSION_STATE_COMPLETE
    return mavlink.MAVLink_mission_current_message(flight.progress.item, s.has_mission, state)


def position_target(s: Snapshot) -> Message | None:
    """Where a vehicle is going by an order or by its mission; None in other modes, or without a target."""
    target = s.flight.target
    if s.flight.mode not in {*GUIDED_MODES, Mode.AUTO} or target is None:
        return None
    ignored = mavlink.POSITION_TARGET_TYPEMASK_AX_IGNORE * 7 | mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
    velocity = target.velocity if isinstance(target, Drifting) else Vector(0.0, 0.0, 0.0)
    point = target.point if isinstance(target, GoingTo) else Vector(0.0, 0.0, 0.0)
    ignored |= 0b111 if isinstance(target, Drifting) else 0b111000
    yaw_rad = target.yaw_rad if isinstance(target, GoingTo) else None
    if yaw_rad is None:
        ignored |= mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE
    latitude, longitude, altitude_mm = geodetic(s.frame, point)
    return mavlink.MAVLink_position_target_global_int_message(
        s.boot_ms,
        mavlink.MAV_FRAME_GLOBAL_INT,
        ignored,
        latitude,
        longitude,
        altitude_mm / 1e3,
        *velocity,
        0.0,
        0.0,
        0.0,
        yaw_rad or 0.0,
        0.0,
    )


def gimbal_attitude(s: Snapshot) -> Message | None:
    """As ArduPilot reports a gimbal: level, its pitch from the horizon, its yaw from the vehicle's heading."""
    if s.mount is None:
        return None
    yaw, pitch = s.mount.pan_rad / 2.0, -s.mount.tilt_rad / 2.0
    quaternion = [cos(pitch) * cos(yaw), -sin(pitch) * sin(yaw), sin(pitch) * cos(yaw), cos(pitch) * sin(yaw)]
    return mavlink.MAVLink_gimbal_device_attitude_status_message(
        0, 0, s.boot_ms, _LEVEL_GIMBAL, quaternion, nan, nan, nan, 0, nan, nan, 1
    )


def winch_status(s: Snapshot) -> Message | None:
    """WINCH_TYPE 2 has a scale and says whether it moves, but not which way; type 1 knows only what it was ordered."""
    if s.winch is None:
        return None
    line_m, speed_m_s, flags = s.winch.line_m, s.winch.speed_m_s, int(mavlink.MAV_WINCH_STATUS_HEALTHY)
    load_kg = voltage_v = current_a = nan
    if s.flight.settings.winch_type == WINCH_WITH_SCALE:
        load_kg, speed_m_s = s.winch.load_kg, abs(speed_m_s)
        voltage_v, current_a = 24.0, 0.5 + 2.0 * speed_m_s
        flags |= mavlink.MAV_WINCH_STATUS_MOVING * (speed_m_s > 0.01)
        flags |= mavlink.MAV_WINCH_STATUS_FULLY_RETRACTED * (line_m < 0.01)
    return mavlink.MAVLink_winch_status_message(
        s.boot_ms * 1000, line_m, speed_m_s, load_kg, voltage_v, current_a, 32_767, flags
    )


Builder = Callable[[Snapshot], Message | None]

_STREAMS: Mapping[int, tuple[Builder, int]] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: (heartbeat, 10),
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: (system_time, 10),
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: (global_position, 1),
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: (local_position, 2),
    mavlink.MAVLINK_MSG_ID_ATTITUDE: (attitude, 1),
    mavlink.MAVLINK_MSG_ID_HIGHRES_IMU: (highres_imu, 1),
    mavlink.MAVLINK_MSG_ID_RAW_IMU: (raw_imu, 1),
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: (gps_raw, 5),
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: (sys_status, 5),
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: (battery_status, 10),
    mavlink.MAVLINK_MSG_ID_VFR_HUD: (vfr_hud, 2),
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: (home_position, 20),
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: (extended_sys_state, 5),
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: (mission_current, 10),
    mavlink.MAVLINK_MSG_ID_CURRENT_MODE: (current_mode, 20),
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: (position_target, 5),
    mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: (global_origin, 0),
    mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS: (gimbal_attitude, 1),
    mavlink.MAVLINK_MSG_ID_WINCH_STATUS: (winch_status, 2),
}
"""The builder of each message, and every how many ticks of 100 ms it is sent unasked (0: never)."""
BUILDERS: Mapping[int, Builder] = {kind: build for kind, (build, _) in _STREAMS.items()}


STREAM_GROUPS: Mapping[int, tuple[int, ...]] = {
    mavlink.MAV_DATA_STREAM_POSITION: (
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    ),
    mavlink.MAV_DATA_STREAM_EXTRA1: (mavlink.MAVLINK_MSG_ID_ATTITUDE,),
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: (
        mavlink.MAVLINK_MSG_ID_SYS_STATUS,
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
        mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
    ),
}
"""The messages of a stream that REQUEST_DATA_STREAM asks for, as ArduPilot groups them."""


def default_ticks(persona: Persona) -> dict[int, int]:
    """Which streams are sent unasked, and every how many ticks; each persona has an IMU message of its own."""
    if persona.on_request:
        return {mavlink.MAVLINK_MSG_ID_HEARTBEAT: 10, mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: 10}
    px4 = persona.autopilot == mavlink.MAV_AUTOPILOT_PX4
    other = mavlink.MAVLINK_MSG_ID_RAW_IMU if px4 else mavlink.MAVLINK_MSG_ID_HIGHRES_IMU
    return {kind: ticks for kind, (_, ticks) in _STREAMS.items() if ticks and kind != other}
