"""The autopilot's own parameters that bound and follow a flight: its fence, what it does when its link is lost, how fast it flies.

No socket and no clock. A parameter that an autopilot does not have is not answered: of several names of one value those
of newer firmware are requested as well.
"""

import struct
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.navigation.cruise import CruiseReport
from dyknow.navigation.fences import FenceArea
from dyknow.navigation.vehicle import FailsafeReport, FenceReport, LinkLossAction

_ARDUPILOT, _PX4 = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_AUTOPILOT_PX4
FENCE_PARAMETERS = {
    _ARDUPILOT: (
        "FENCE_ENABLE", "FENCE_AUTOENABLE", "FENCE_TYPE", "FENCE_ALT_MAX", "FENCE_ALT_MIN", "FENCE_RADIUS",
        "FENCE_OPTIONS",
    ),
    _PX4: ("GF_ACTION", "GF_MAX_VER_DIST", "GF_MAX_HOR_DIST"),
}  # fmt: skip
"""The parameters that hold an autopilot's own fence."""
FAILSAFE_PARAMETERS = {
    _ARDUPILOT: (
        "FS_GCS_ENABLE", "FS_GCS_TIMEOUT", "FS_OPTIONS", "RTL_ALT", "RTL_ALT_FINAL", "RTL_ALT_M", "RTL_ALT_FINAL_M",
        "SYSID_MYGCS", "MAV_GCS_SYSID",
    ),
    _PX4: ("NAV_DLL_ACT", "COM_DL_LOSS_T", "COM_FAIL_ACT_T", "RTL_RETURN_ALT", "COM_OBL_RC_ACT", "COM_OF_LOSS_T"),
}  # fmt: skip
"""The parameters that say what an autopilot does without its link, and how it returns; RTL_ALT_M is of ArduCopter 4.7."""
CRUISE_PARAMETERS = {
    _ARDUPILOT: ("WPNAV_SPEED", "WPNAV_SPEED_UP", "WPNAV_SPEED_DN", "WP_SPD", "WP_SPD_UP", "WP_SPD_DN"),
    _PX4: ("MPC_XY_CRUISE", "MPC_Z_VEL_MAX_UP", "MPC_Z_VEL_MAX_DN", "MPC_Z_V_AUTO_UP", "MPC_Z_V_AUTO_DN"),
}  # fmt: skip
"""The parameters that say how fast it flies to places; WP_SPD is of ArduCopter 4.7, MPC_Z_V_AUTO_UP of PX4 1.13."""
_FENCE_HIGHEST, _FENCE_RADIUS, _FENCE_AREAS, _FENCE_LOWEST = 1, 2, 4, 8
_UNION = 1 << 1
"""FENCE_OPTIONS: one of the inclusions is enough."""
_MISSION_CONTINUES = 1 << 1
"""FS_OPTIONS: a mission continues although the ground station is lost."""
_A = LinkLossAction
_ARDUPILOT_ACTIONS = {
    0: _A.CARRY_ON,
    1: _A.RETURN,
    2: _A.RETURN,
    3: _A.RETURN,
    4: _A.LAND,
    5: _A.LAND,
    6: _A.RETURN,
    7: _A.LAND,
}
"""FS_GCS_ENABLE; 3 and 4 go back the way they came where they can (SMART_RTL), 7 brakes first."""
_PX4_ACTIONS = {0: _A.CARRY_ON, 1: _A.HOLD, 2: _A.RETURN, 3: _A.LAND, 5: _A.TERMINATE, 6: _A.TERMINATE}
_PX4_OFFBOARD = {3: _A.RETURN, 4: _A.LAND, 5: _A.HOLD, 6: _A.TERMINATE, 7: _A.TERMINATE}
"""COM_OBL_RC_ACT; 0 to 2 are modes of a pilot with a remote control, without one it lands."""


class VehicleParameters:
    """The parameters that a vehicle has reported."""

    def __init__(self) -> None:
        self._told: dict[str, float] = {}

    def forget(self) -> None:
        """It has restarted, and may have others."""
        self._told.clear()

    def on_value(self, autopilot: int | None, message: Any) -> str | None:
        """PARAM_VALUE: its name if it is kept. PX4 sends integers as their bits, ArduPilot as a number."""
        name = str(message.param_id)
        if name not in _wanted(autopilot):
            return None
        value = float(message.param_value)
        if autopilot == _PX4 and message.param_type != mavlink.MAV_PARAM_TYPE_REAL32:
            value = float(struct.unpack("<i", struct.pack("<f", value))[0])
        self._told[name] = value
        return name

    def untold(self, autopilot: int | None) -> tuple[str, ...]:
        """The parameters that the vehicle has not reported."""
        return tuple(name for name in _wanted(autopilot) if name not in self._told)

    def fence(self, autopilot: int | None, valid_us: int, areas: tuple[FenceArea, ...] = ()) -> FenceReport:
        """The bounds that its parameters set, and the areas that were read, if they count."""
        told = self._told
        if autopilot == _PX4:
            names = ("GF_MAX_VER_DIST", "GF_MAX_HOR_DIST") if told.get("GF_ACTION", 0.0) else ()
            highest_m, radius_m = [told.get(name, 0.0) or None for name in names] or [None, None]
            return FenceReport(valid_us, None, highest_m, radius_m, areas if names else (), is_union=True)
        on = told.get("FENCE_ENABLE", 0.0) or told.get("FENCE_AUTOENABLE", 0.0)
        kinds = int(told.get("FENCE_TYPE", 0.0)) if on else 0

        def bound(bit: int, name: str) -> float | None:
            return told.get(name) if kinds & bit else None

        return FenceReport(
            valid_us,
            bound(_FENCE_LOWEST, "FENCE_ALT_MIN"),
            bound(_FENCE_HIGHEST, "FENCE_ALT_MAX"),
            bound(_FENCE_RADIUS, "FENCE_RADIUS"),
            areas if kinds & _FENCE_AREAS else (),
            is_union=bool(int(told.get("FENCE_OPTIONS", 0.0)) & _UNION),
        )

    def failsafe(self, autopilot: int | None, valid_us: int) -> FailsafeReport:
        """Its reactions to a lost link, as far as it has reported them."""
        return self._failsafe_px4(valid_us) if autopilot == _PX4 else self._failsafe_ardupilot(valid_us)

    def cruise(self, autopilot: int | None, valid_us: int) -> CruiseReport:
        """How fast it flies to places, as far as it has reported that."""
        if autopilot == _PX4:
            up, down = (
                self._told.get(f"MPC_Z_V_AUTO_{way}", self._told.get(f"MPC_Z_VEL_MAX_{way}")) for way in ("UP", "DN")
            )
            return CruiseReport(valid_us, self._told.get("MPC_XY_CRUISE"), up, down)
        return CruiseReport(
            valid_us, *(self._metres(f"WP_SPD{way}", f"WPNAV_SPEED{way}") for way in ("", "_UP", "_DN"))
        )

    def _failsafe_ardupilot(self, valid_us: int) -> FailsafeReport:
        told, action = self._told, self._action("FS_GCS_ENABLE", _ARDUPILOT_ACTIONS)
        watched = told.get("MAV_GCS_SYSID", told.get("SYSID_MYGCS"))
        continues = int(told.get("FS_OPTIONS", 0.0)) & _MISSION_CONTINUES or told.get("FS_GCS_ENABLE") == 2.0
        return FailsafeReport(
            valid_us,
            action,
            told.get("FS_GCS_TIMEOUT"),
            _A.CARRY_ON if continues else action,
            action,
            self._metres("RTL_ALT_M", "RTL_ALT"),
            self._metres("RTL_ALT_FINAL_M", "RTL_ALT_FINAL"),
            None if watched is None else int(watched),
        )

    def _failsafe_px4(self, valid_us: int) -> FailsafeReport:
        told, action = self._told, self._action("NAV_DLL_ACT", _PX4_ACTIONS)
        lost_s = told.get("COM_DL_LOSS_T")
        delay_s = None if lost_s is None else lost_s + told.get("COM_FAIL_ACT_T", 0.0)
        in_hold = _A.CARRY_ON if action is _A.HOLD else action  # to hold in Hold keeps the place that it flies to
        return FailsafeReport(
            valid_us,
            in_hold,
            delay_s,
            action,
            self._action("COM_OBL_RC_ACT", _PX4_OFFBOARD, _A.LAND),
            told.get("RTL_RETURN_ALT"),
            None,
            None,
        )

    def _action(
        self, name: str, actions: dict[int, LinkLossAction], otherwise: LinkLossAction | None = None
    ) -> LinkLossAction | None:
        value = self._told.get(name)
        return None if value is None else actions.get(int(value), otherwise)

    def _metres(self, metres: str, centimetres: str) -> float | None:
        value_cm = self._told.get(centimetres)
        return self._told.get(metres, None if value_cm is None else value_cm / 100.0)


def _wanted(autopilot: int | None) -> tuple[str, ...]:
    kind = autopilot or 0
    return (*FENCE_PARAMETERS.get(kind, ()), *FAILSAFE_PARAMETERS.get(kind, ()), *CRUISE_PARAMETERS.get(kind, ()))
