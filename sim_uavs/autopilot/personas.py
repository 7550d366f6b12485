"""Differences between ArduCopter 4.7, ArduCopter 3.3 and a PX4 multicopter on the wire."""

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from dyknow.sim_uavs.dynamics.flight import Mode
from dyknow.sim_uavs.dynamics.settings import PersonaName


class ParameterKind(NamedTuple):
    """A parameter and the field of `Settings` it shows, in `scale` parameter units per unit of the field.

    `field` empty: the system id, which is read only.
    """

    name: str
    field: str
    scale: float
    kind: int
    least: float
    most: float


@dataclass(frozen=True, slots=True)
class Persona:
    """`modes` maps each mode to its custom_mode; `standard` to MAVLink's standard modes where there is one.

    Attributes:
        version: firmware, one byte each: major, minor, patch, type (255: release).
        bytewise: parameters carry integers as bits rather than as a rounded float.
        names_take_off: rising is a mode of its own, and the height of it is a parameter, not an argument.
        home_is_item_0: the first mission item is home and is not flown.
        not_understood: commands that are answered by UNSUPPORTED.
        takes_command_int: whether COMMAND_INT is understood at all.
        never_sent: messages that this firmware does not have.
        on_request: whether streams are sent only when REQUEST_DATA_STREAM asks for them.
        is_mavlink_1: it neither sends nor understands MAVLink 2.
        stops_nowhere: a reposition without a place stops it where it can.
        accepts_outside: a place outside of its fence is acknowledged, not flown to, and refused in words.
        acknowledges_modes_twice: DO_SET_MODE has two acknowledgements.
        unscheduled: messages that it sends at a rate of its own; to ask for another one fails.
        denies_unguided: a point in a mode that takes none is denied, not temporarily rejected.
    """

    autopilot: int
    version: tuple[int, int, int, int]
    modes: Mapping[Mode, int]
    standard: Mapping[Mode, int]
    parameters: tuple[ParameterKind, ...]
    bytewise: bool
    names_take_off: bool
    home_is_item_0: bool
    take_off_mode: int = 0
    names: Mapping[Mode, str] = field(default_factory=dict)
    not_understood: frozenset[int] = frozenset()
    takes_command_int: bool = True
    never_sent: frozenset[int] = frozenset()
    on_request: bool = False
    is_mavlink_1: bool = False
    denies_unguided: bool = False
    stops_nowhere: bool = False
    accepts_outside: bool = False
    acknowledges_modes_twice: bool = False
    unscheduled: frozenset[int] = frozenset()

    def name(self, mode: Mode) -> str:
        """The maker's name of the mode."""
        return self.names.get(mode, mode.value)

    def custom_mode(self, mode: Mode, *, taking_off: bool) -> int:
        return self.take_off_mode if taking_off and self.names_take_off and mode is Mode.GUIDED else self.modes[mode]

    def mode(self, custom_mode: int) -> Mode | None:
        """The mode with this number, or None when there is none."""
        return next((mode for mode, number in self.modes.items() if number == custom_mode), None)

    def on_wire(self, kind: ParameterKind, value: float) -> float:
        if not self.bytewise or kind.kind == mavlink.MAV_PARAM_TYPE_REAL32:
            return value
        number: float = struct.unpack("<f", struct.pack("<i", round(value)))[0]
        return number

    def off_wire(self, kind: ParameterKind, sent: float) -> float:
        if not self.bytewise or kind.kind == mavlink.MAV_PARAM_TYPE_REAL32:
            return sent
        number: int = struct.unpack("<i", struct.pack("<f", sent))[0]
        return float(number)


def _px4(main: int, sub: int = 0) -> int:
    return main << 16 | sub << 24


_REAL, _INT = mavlink.MAV_PARAM_TYPE_REAL32, mavlink.MAV_PARAM_TYPE_INT32
_HANDLING = frozenset({mavlink.MAV_CMD_DO_GRIPPER, mavlink.MAV_CMD_DO_WINCH})
"""Only ArduCopter 4.7 was met with a winch and a gripper."""
_STANDARD = {
    Mode.LOITER: mavlink.MAV_STANDARD_MODE_POSITION_HOLD,
    Mode.AUTO: mavlink.MAV_STANDARD_MODE_MISSION,
    Mode.RTL: mavlink.MAV_STANDARD_MODE_SAFE_RECOVERY,
    Mode.LAND: mavlink.MAV_STANDARD_MODE_LAND,
}

ARDUPILOT = Persona(
    autopilot=mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
    version=(4, 7, 0, 255),
    modes={
        Mode.STABILIZE: 0,
        Mode.AUTO: 3,
        Mode.GUIDED: 4,
        Mode.LOITER: 5,
        Mode.RTL: 6,
        Mode.LAND: 9,
        Mode.BRAKE: 17,
    },
    standard=_STANDARD,
    parameters=(
        ParameterKind("SYSID_THISMAV", "", 1.0, _INT, 1, 255),
        ParameterKind("WPNAV_SPEED", "cruise_m_s", 100.0, _REAL, 10, 2000),
        ParameterKind("WPNAV_SPEED_UP", "climb_m_s", 100.0, _REAL, 10, 1000),
        ParameterKind("WPNAV_SPEED_DN", "descent_m_s", 100.0, _REAL, 10, 500),
        ParameterKind("LAND_SPEED", "land_m_s", 100.0, _REAL, 30, 200),
        ParameterKind("RTL_ALT", "return_m", 100.0, _REAL, 200, 300_000),
        ParameterKind("RTL_ALT_FINAL", "final_m", 100.0, _REAL, 0, 100_000),
        ParameterKind("FS_GCS_ENABLE", "link_loss_action", 1.0, _INT, 0, 7),
        ParameterKind("FS_GCS_TIMEOUT", "link_loss_s", 1.0, _REAL, 2, 120),
        ParameterKind("FS_OPTIONS", "link_loss_options", 1.0, _INT, 0, 63),
        ParameterKind("SYSID_MYGCS", "station_id", 1.0, _INT, 1, 255),
        ParameterKind("BATT_FS_LOW_ACT", "battery_low_action", 1.0, _INT, 0, 2),
        ParameterKind("PILOT_TKOFF_ALT", "take_off_m", 100.0, _REAL, 100, 100_000),
        ParameterKind("DISARM_DELAY", "disarm_s", 1.0, _REAL, 1, 127),
        ParameterKind("FENCE_ENABLE", "fence_on", 1.0, _INT, 0, 1),
        ParameterKind("FENCE_TYPE", "fence_kinds", 1.0, _INT, 0, 15),
        ParameterKind("FENCE_ALT_MAX", "fence_highest_m", 1.0, _REAL, 10, 1000),
        ParameterKind("FENCE_ALT_MIN", "fence_lowest_m", 1.0, _REAL, -100, 100),
        ParameterKind("FENCE_RADIUS", "fence_radius_m", 1.0, _REAL, 30, 10_000),
        ParameterKind("FENCE_OPTIONS", "fence_options", 1.0, _INT, 0, 7),
        ParameterKind("GRIP_ENABLE", "gripper_on", 1.0, _INT, 0, 1),
        ParameterKind("WINCH_TYPE", "winch_type", 1.0, _INT, 0, 2),
        ParameterKind("WINCH_RATE_MAX", "winch_m_s", 1.0, _REAL, 0, 10),
    ),
    bytewise=False,
    names_take_off=False,
    home_is_item_0=True,
    denies_unguided=True,
)
"""ArduCopter 4.7, as it was met in the loop."""

ARDUPILOT_3_3 = replace(
    ARDUPILOT,
    version=(3, 3, 0, 255),
    not_understood=frozenset(
        {
            mavlink.MAV_CMD_DO_SET_MODE,
            mavlink.MAV_CMD_DO_SET_STANDARD_MODE,
            mavlink.MAV_CMD_DO_REPOSITION,
            mavlink.MAV_CMD_DO_SET_MISSION_CURRENT,
            mavlink.MAV_CMD_REQUEST_MESSAGE,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
            mavlink.MAV_CMD_GET_MESSAGE_INTERVAL,
            mavlink.MAV_CMD_GET_HOME_POSITION,
            mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW,
            mavlink.MAV_CMD_DO_SET_ROI_LOCATION,
            *_HANDLING,
        }
    ),
    takes_command_int=False,
    never_sent=frozenset(
        {
            mavlink.MAVLINK_MSG_ID_HOME_POSITION,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
            mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT,
            mavlink.MAVLINK_MSG_ID_CURRENT_MODE,
            mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
            mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS,
            mavlink.MAVLINK_MSG_ID_WINCH_STATUS,
        }
    ),
    on_request=True,
    is_mavlink_1=True,
)
"""ArduCopter 3.3, as it was met in the loop: points by SET_POSITION_TARGET, modes by SET_MODE, streams by group."""

PX4 = Persona(
    autopilot=mavlink.MAV_AUTOPILOT_PX4,
    version=(1, 15, 4, 255),
    modes={
        Mode.STABILIZE: _px4(7),
        Mode.LOITER: _px4(3),
        Mode.GUIDED: _px4(4, 3),
        Mode.AUTO: _px4(4, 4),
        Mode.RTL: _px4(4, 5),
        Mode.LAND: _px4(4, 6),
        Mode.OFFBOARD: _px4(6),
    },
    standard=_STANDARD,
    parameters=(
        ParameterKind("MAV_SYS_ID", "", 1.0, _INT, 1, 255),
        ParameterKind("MIS_TAKEOFF_ALT", "take_off_m", 1.0, _REAL, 1, 1000),
        ParameterKind("MPC_XY_CRUISE", "cruise_m_s", 1.0, _REAL, 0.1, 20),
        ParameterKind("MPC_Z_VEL_MAX_UP", "climb_m_s", 1.0, _REAL, 0.1, 10),
        ParameterKind("MPC_Z_VEL_MAX_DN", "descent_m_s", 1.0, _REAL, 0.1, 5),
        ParameterKind("MPC_LAND_SPEED", "land_m_s", 1.0, _REAL, 0.3, 2),
        ParameterKind("RTL_RETURN_ALT", "return_m", 1.0, _REAL, 2, 3000),
        ParameterKind("NAV_DLL_ACT", "link_loss_action", 1.0, _INT, 0, 6),
        ParameterKind("COM_DL_LOSS_T", "link_loss_s", 1.0, _INT, 5, 300),
        ParameterKind("COM_FAIL_ACT_T", "link_loss_wait_s", 1.0, _REAL, 0, 25),
        ParameterKind("COM_OBL_RC_ACT", "offboard_loss_action", 1.0, _INT, 0, 7),
        ParameterKind("COM_OF_LOSS_T", "offboard_loss_s", 1.0, _REAL, 0, 60),
        ParameterKind("BAT_LOW_THR", "battery_low", 1.0, _REAL, 0.05, 0.5),
        ParameterKind("BAT_CRIT_THR", "battery_critical", 1.0, _REAL, 0.02, 0.3),
        ParameterKind("COM_DISARM_PRFLT", "disarm_s", 1.0, _REAL, 1, 127),
        ParameterKind("GF_ACTION", "fence_on", 1.0, _INT, 0, 5),
        ParameterKind("GF_MAX_VER_DIST", "fence_highest_m", 1.0, _REAL, 0, 10_000),
        ParameterKind("GF_MAX_HOR_DIST", "fence_radius_m", 1.0, _REAL, 0, 10_000),
    ),
    bytewise=True,
    names_take_off=True,
    home_is_item_0=False,
    take_off_mode=_px4(4, 2),
    names={
        Mode.STABILIZE: "Stabilized",
        Mode.LOITER: "Position",
        Mode.GUIDED: "Hold",
        Mode.AUTO: "Mission",
        Mode.RTL: "Return",
        Mode.LAND: "Land",
        Mode.OFFBOARD: "Offboard",
    },
    stops_nowhere=True,
    accepts_outside=True,
    acknowledges_modes_twice=True,
    not_understood=_HANDLING,
    never_sent=frozenset({mavlink.MAVLINK_MSG_ID_WINCH_STATUS}),
    unscheduled=frozenset({mavlink.MAVLINK_MSG_ID_MISSION_CURRENT, mavlink.MAVLINK_MSG_ID_WINCH_STATUS}),
)

PERSONAS: Mapping[PersonaName, Persona] = {"ardupilot": ARDUPILOT, "ardupilot-3.3": ARDUPILOT_3_3, "px4": PX4}
