"""The fence of an autopilot: polygons and circles, inclusions and exclusions."""

from collections.abc import Sequence
from math import isfinite
from typing import Final, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.navigation.fences import FenceArea, FenceKind
from dyknow.proxies.mavlink.lists.item_list import ItemList, ListItem

MOST_ITEMS, MOST_CORNERS = 512, 128
_LARGEST_M = 100_000.0
_POLYGONS: Final[dict[int, FenceKind]] = {
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: FenceKind.INCLUSION,
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: FenceKind.EXCLUSION,
}
_CIRCLES: Final[dict[int, FenceKind]] = {
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: FenceKind.INCLUSION,
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: FenceKind.EXCLUSION,
}
_REMEDY = "only the autopilot keeps this area; upload a fence that is right"


class FenceItem(NamedTuple):
    """An item of the list: MAV_CMD, its first parameter (corners of its polygon, or radius in metres), degrees times 1e7."""

    command: int
    parameter: float
    x: int
    y: int

    @property
    def place(self) -> tuple[float, float] | None:
        """Latitude and longitude in degrees; None: it is none."""
        is_place = abs(self.x) <= 900_000_000 and abs(self.y) <= 1_800_000_000
        return (self.x / 1e7, self.y / 1e7) if is_place else None


def read_areas(items: Sequence[FenceItem]) -> tuple[tuple[FenceArea, ...], list[str]]:
    """The areas of a list, and a sentence for each that is none; points to return to are neither."""
    areas: list[FenceArea] = []
    problems: list[str] = []
    at = 0
    while at < len(items):
        item = items[at]
        read, taken = (_polygon if item.command in _POLYGONS else _other)(items[at:])
        if isinstance(read, str):
            problems.append(f"fence item {at + 1} of {len(items)}: {read}; {_REMEDY}")
        elif read is not None:
            areas.append(read)
        at += taken
    return tuple(areas), problems


def _polygon(items: Sequence[FenceItem]) -> tuple[FenceArea | str, int]:
    """The polygon at the begin of the items, or why it is none; and how many of them it takes."""
    first = items[0]
    if not isfinite(first.parameter) or first.parameter != first.parameter // 1:
        return f"expected a number of corners, got {first.parameter:g}", 1
    count = int(first.parameter)
    taken = next(
        (n for n, each in enumerate(items) if each.command != first.command or each.parameter != first.parameter or n >= count),
        len(items),
    )  # fmt: skip
    places = [each.place for each in items[:taken]]
    corners = tuple(place for place in places if place is not None)
    if not 3 <= count <= MOST_CORNERS:
        return f"expected a polygon of 3 to {MOST_CORNERS} corners, got {count}", max(1, taken)
    if taken < count:
        return f"expected {count} corners, got {taken}: the polygon is not closed", taken
    if len(corners) < count:
        return "expected corners on Earth, got one that is not", taken
    if len(set(corners)) < 3:
        return "expected 3 different corners, got fewer", taken
    return FenceArea(_POLYGONS[first.command], corners), taken


def _other(items: Sequence[FenceItem]) -> tuple[FenceArea | str | None, int]:
    item = items[0]
    kind = _CIRCLES.get(item.command)
    if kind is None:
        is_return = item.command == mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT
        return (None if is_return else f"expected a polygon or a circle, got command {item.command}"), 1
    if not (isfinite(item.parameter) and 0.0 < item.parameter <= _LARGEST_M):
        return f"expected a radius of up to {_LARGEST_M:.0f} m, got {item.parameter:g}", 1
    if item.place is None:
        return "expected a centre on Earth, got none", 1
    return FenceArea(kind, centre=item.place, radius_m=item.parameter), 1


class FenceList(ItemList):
    """Reads the fence of one vehicle, over and over.

    Attributes:
        areas: as they were read last; a list that cannot be read changes nothing.
    """

    def __init__(self) -> None:
        self.areas: tuple[FenceArea, ...] = ()
        super().__init__("fence", mavlink.MAV_MISSION_TYPE_FENCE, MOST_ITEMS)

    def _on_whole(self, items: Sequence[ListItem]) -> bool:
        before = self.areas
        self.areas, problems = read_areas([FenceItem(each.command, each.parameter, each.x, each.y) for each in items])
        self._report(problems)
        return self.areas != before
