"""The mission that a vehicle has loaded, as it flies it by itself (AUTO): which item flies where."""

from enum import StrEnum
from typing import Final, NamedTuple

MOST_MISSION_ITEMS: Final = 256


class MissionStep(StrEnum):
    """The kind of an item's flight."""

    FLY_TO = "fly-to"
    STAY = "stay"
    """It flies there, and stays."""
    TAKE_OFF = "take-off"
    LAND = "land"
    RETURN = "return"
    UNKNOWN = "unknown"
    """It may fly anywhere, and the rest of the mission is not known either."""


class MissionItem(NamedTuple):
    """One item that flies the vehicle; items that do something on the way are left out.

    Attributes:
        item: its number, as in `MissionReport.item`.
        latitude_deg, longitude_deg: WGS-84; None: where the vehicle is.
        altitude_m: metres above mean sea level; None: the ground, or that of the item before.
    """

    item: int
    step: MissionStep
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    altitude_m: float | None = None


class MissionPlanReport(NamedTuple):
    """The mission as it was read from the vehicle; empty: it has none, or none that is known here."""

    valid_us: int
    items: tuple[MissionItem, ...]
