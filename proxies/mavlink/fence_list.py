"""The fence of an autopilot, read by the mission protocol: polygons and circles, inclusions and exclusions.

No socket and no clock. MISSION_REQUEST_LIST brings MISSION_COUNT, and each MISSION_REQUEST_INT its item; what does not come
is requested again. The list is read when the vehicle is met, when it acknowledges an upload of another station, and once a minute.
"""

from collections.abc import Sequence
from enum import Enum, auto
from math import isfinite
from typing import Any, Final, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from navigation.fences import FenceArea, FenceKind
from proxies.mavlink.ways import OURSELVES, Target

MOST_ITEMS, MOST_CORNERS = 512, 128
_LARGEST_M = 100_000.0
_FENCE = mavlink.MAV_MISSION_TYPE_FENCE
_AGAIN_US, _READ_US, _ATTEMPTS = 1_000_000, 60_000_000, 5
_POLYGONS: Final[dict[int, FenceKind]] = {
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: FenceKind.INCLUSION,
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: FenceKind.EXCLUSION,
}
_CIRCLES: Final[dict[int, FenceKind]] = {
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: FenceKind.INCLUSION,
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: FenceKind.EXCLUSION,
}
_REMEDY = "only the autopilot keeps this area; upload a fence that is right"
_V2 = 0xFD
FENCE_NAMES: Final = frozenset({"MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ACK"})
"""The messages that are read only here."""


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


class _Phase(Enum):
    WAITS = auto()
    LISTS = auto()
    READS = auto()


class FenceList:
    """Reads the list of one vehicle, over and over.

    Attributes:
        areas: as they were read last; a list that cannot be read changes nothing.
        problems: sentences about the list that was read last, until they are taken.
    """

    def __init__(self) -> None:
        self.areas: tuple[FenceArea, ...] = ()
        self.problems: list[str] = []
        self._reported: list[str] = []
        self.restart()

    def restart(self) -> None:
        """The vehicle is met, or met again: read the list as soon as it may be."""
        self._phase, self._due_us, self._attempts = _Phase.WAITS, 0, 0
        self._count, self._items, self._acknowledges, self._is_unknown = 0, list[FenceItem](), False, False

    def on_message(self, message: Any) -> bool:
        """MISSION_COUNT, MISSION_ITEM_INT, MISSION_ACK; whether the areas have changed."""
        kind = message.get_type()
        if kind not in FENCE_NAMES or message.mission_type != _FENCE:
            return False
        is_ours = (message.target_system, message.target_component) == OURSELVES
        match kind:
            case "MISSION_COUNT" if is_ours and self._phase is _Phase.LISTS:
                return self._on_count(message.count)
            case "MISSION_ITEM_INT" if is_ours and self._phase is _Phase.READS and message.seq == len(self._items):
                return self._on_item(FenceItem(message.command, message.param1, message.x, message.y))
            case "MISSION_ACK" if not is_ours and message.type == mavlink.MAV_MISSION_ACCEPTED:
                self._read_again()
            case "MISSION_ACK" if is_ours and self._phase is not _Phase.WAITS:
                self._is_unknown = message.type == mavlink.MAV_MISSION_UNSUPPORTED
        return False

    def due(self, target: Target, now_us: int) -> list[Any]:
        """What is to be sent now."""
        if self._acknowledges:
            self._acknowledges, self._due_us = False, now_us + _READ_US
            return [mavlink.MAVLink_mission_ack_message(*target, mavlink.MAV_MISSION_ACCEPTED, _FENCE)]
        if now_us < self._due_us or self._is_unknown:
            return []
        if self._attempts >= _ATTEMPTS:
            if self._phase is _Phase.READS:
                at = f"item {len(self._items) + 1} of {self._count}"
                self._say([f"the autopilot's fence was not read: {at} did not come; what was read before counts"])
            self._phase, self._attempts, self._due_us = _Phase.WAITS, 0, now_us + _READ_US
            return []
        if self._phase is _Phase.WAITS:
            self._phase = _Phase.LISTS
        self._attempts, self._due_us = self._attempts + 1, now_us + _AGAIN_US
        if self._phase is _Phase.LISTS:
            return [mavlink.MAVLink_mission_request_list_message(*target, _FENCE)]
        return [mavlink.MAVLink_mission_request_int_message(*target, len(self._items), _FENCE)]

    def take_problems(self) -> list[str]:
        """What is wrong with the list, each sentence once."""
        problems, self.problems = self.problems, []
        return problems

    def _read_again(self) -> None:
        if self._phase is _Phase.WAITS:
            self._due_us = 0

    def _on_count(self, count: int) -> bool:
        if count > MOST_ITEMS:
            self._say(
                [
                    f"the autopilot's fence has {count} items, {MOST_ITEMS} are read: none is known here; upload a smaller one"
                ]
            )
            self._phase, self._acknowledges, self._attempts = _Phase.WAITS, True, 0
            return False
        self._phase, self._count, self._items = _Phase.READS, count, []
        self._attempts = self._due_us = 0
        return self._is_read() if count == 0 else False

    def _on_item(self, item: FenceItem) -> bool:
        self._items.append(item)
        self._attempts = self._due_us = 0
        return self._is_read() if len(self._items) == self._count else False

    def _is_read(self) -> bool:
        """The list is whole; whether it brings other areas."""
        before = self.areas
        self.areas, problems = read_areas(self._items)
        self._say(problems)
        self._phase, self._acknowledges, self._attempts = _Phase.WAITS, True, 0
        return self.areas != before

    def _say(self, problems: list[str]) -> None:
        """Report what is wrong, unless it was reported already."""
        self.problems += [each for each in problems if each not in self._reported]
        self._reported = problems


def speaks_mavlink_2(message: Any) -> bool:
    """Whether it came in a frame of MAVLink 2: the older one has no lists but that of the mission."""
    return bytes(message.get_msgbuf() or b"")[:1] == bytes([_V2])
