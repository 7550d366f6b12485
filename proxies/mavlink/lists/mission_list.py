"""The mission of an autopilot: which item flies where, as far as that is known here."""

from collections.abc import Sequence
from math import isfinite
from typing import Final

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.navigation.mission_plans import MOST_MISSION_ITEMS, MissionItem, MissionStep
from dyknow.proxies.mavlink.lists.item_list import ItemList, ListItem

_HIGHEST_M = 12_000.0
_LAST_MOVING = mavlink.MAV_CMD_NAV_LAST
"""Commands up to that fly the vehicle; those after it do something on the way, or jump."""
_STEPS: Final[dict[int, MissionStep]] = {
    mavlink.MAV_CMD_NAV_WAYPOINT: MissionStep.FLY_TO,
    mavlink.MAV_CMD_NAV_LOITER_TIME: MissionStep.FLY_TO,
    mavlink.MAV_CMD_NAV_LOITER_UNLIM: MissionStep.STAY,
    mavlink.MAV_CMD_NAV_TAKEOFF: MissionStep.TAKE_OFF,
    mavlink.MAV_CMD_NAV_LAND: MissionStep.LAND,
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: MissionStep.RETURN,
}
_STANDS: Final = frozenset({mavlink.MAV_CMD_NAV_DELAY})
_ABSOLUTE: Final = frozenset({mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT})
_RELATIVE: Final = frozenset({mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT})


def read_mission(
    items: Sequence[ListItem], home_m: float | None, first: int = 0
) -> tuple[tuple[MissionItem, ...], list[str]]:
    """The flight of the items, and a sentence for each item whose flight is unknown.

    Args:
        items: the whole list.
        home_m: the altitude of home, from which heights count; None: not known yet, nor what needs it.
        first: the first item that is flown.
    """
    found: list[MissionItem] = []
    problems: list[str] = []
    for at, item in enumerate(items[first:], first):
        read = _read(at, item, home_m)
        if isinstance(read, str):
            problems.append(f"mission item {at + 1} of {len(items)}: {read}; what follows it is in no intent")
            found.append(MissionItem(at, MissionStep.UNKNOWN))
        elif read is not None:
            found.append(read)
    return tuple(found), problems


def _read(at: int, item: ListItem, home_m: float | None) -> MissionItem | str | None:
    """The flight of the item; a text: why it is unknown; None: it flies nowhere."""
    step = _STEPS.get(item.command)
    if step is None:
        moves = item.command <= _LAST_MOVING or item.command == mavlink.MAV_CMD_DO_JUMP
        return f"command {item.command} is not known here" if moves and item.command not in _STANDS else None
    if step is MissionStep.RETURN:
        return MissionItem(at, step)
    if abs(item.x) > 900_000_000 or abs(item.y) > 1_800_000_000:
        return "expected a place on Earth, got none"
    found = MissionItem(at, step)
    if (item.x or item.y) and step is not MissionStep.TAKE_OFF:
        found = found._replace(latitude_deg=item.x / 1e7, longitude_deg=item.y / 1e7)
    if step is MissionStep.LAND:
        return found
    if not isfinite(item.z_m) or abs(item.z_m) > _HIGHEST_M:
        return f"expected an altitude of up to {_HIGHEST_M:.0f} m, got {item.z_m:g}"
    if item.frame in _ABSOLUTE:
        return found._replace(altitude_m=item.z_m)
    if item.frame not in _RELATIVE:
        return f"heights in frame {item.frame} are not known here"
    return MissionItem(at, MissionStep.UNKNOWN) if home_m is None else found._replace(altitude_m=item.z_m + home_m)


class MissionPlanList(ItemList):
    """Reads the mission of one vehicle, over and over.

    Attributes:
        steps: as they were read last; a list that does not come whole changes nothing.
    """

    def __init__(self) -> None:
        self.steps: tuple[MissionItem, ...] = ()
        self._whole: tuple[ListItem, ...] = ()
        self._home_m: float | None = None
        self._first, self._total = 0, 0
        super().__init__("mission", mavlink.MAV_MISSION_TYPE_MISSION, MOST_MISSION_ITEMS)

    def on_home(self, home_m: float | None, *, has_home: bool) -> bool:
        """Where home is, metres above mean sea level, and whether it is the first item; whether what the list means has changed."""
        first = 1 if has_home else 0
        if (home_m, first) == (self._home_m, self._first):
            return False
        self._home_m, self._first = home_m, first
        return self._on_whole(self._whole)

    def on_total(self, total: int) -> None:
        """How many items the vehicle reports to have (MISSION_CURRENT); 0: it does not say."""
        if total != self._total:
            self._total = total
            self.read_again()

    def _on_whole(self, items: Sequence[ListItem]) -> bool:
        self._whole, before = tuple(items), self.steps
        self.steps, problems = read_mission(items, self._home_m, self._first)
        self._report(problems)
        return self.steps != before

    def _on_too_long(self) -> bool:
        """Forget the mission that was read before."""
        before, self.steps, self._whole = self.steps, (), ()
        return self.steps != before
