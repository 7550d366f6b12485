"""The list of items a vehicle flies on its own: pure data."""

from enum import StrEnum
from typing import NamedTuple

from sim_uavs.dynamics.quadcopter import Vector


class MissionAction(StrEnum):
    FLY_TO = "fly to"
    TAKE_OFF = "take off"
    LAND = "land"
    RETURN = "return"
    SET_SPEED = "set speed"


class Item(NamedTuple):
    """One step. `point` is in the vehicle's local frame; `stay_us` None means for ever; `within_m` counts as there."""

    action: MissionAction
    point: Vector | None = None
    stay_us: int | None = 0
    within_m: float = 1.5
    speed_m_s: float = 0.0


class MissionProgress(NamedTuple):
    """Which item (by its number) is being flown and, once it was reached, since when; `complete` after the last."""

    item: int = 0
    reached_us: int | None = None
    complete: bool = False
