"""The list of items a vehicle flies on its own: pure data."""

from enum import StrEnum
from typing import NamedTuple

from dyknow.navigation.geodesy import LocalFrame
from dyknow.navigation.mission_plans import MissionItem, MissionStep
from dyknow.sim_uavs.dynamics.quadcopter import Vector


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


_STEPS = {
    MissionAction.FLY_TO: MissionStep.FLY_TO,
    MissionAction.TAKE_OFF: MissionStep.TAKE_OFF,
    MissionAction.LAND: MissionStep.LAND,
    MissionAction.RETURN: MissionStep.RETURN,
}


def flown_items(items: tuple[Item, ...], frame: LocalFrame) -> tuple[MissionItem, ...]:
    """The items that fly the vehicle, as an autopilot reports them."""
    found = []
    for at, item in enumerate(items):
        if item.action not in _STEPS:
            continue
        step = MissionStep.STAY if item.stay_us is None else _STEPS[item.action]
        shown = MissionItem(at, step)
        if item.point is not None:
            latitude_deg, longitude_deg, altitude_m = frame.from_ned(*item.point)
            if step is not MissionStep.TAKE_OFF:
                shown = shown._replace(latitude_deg=latitude_deg, longitude_deg=longitude_deg)
            if step is not MissionStep.LAND:
                shown = shown._replace(altitude_m=altitude_m)
        found.append(shown)
    return tuple(found)
