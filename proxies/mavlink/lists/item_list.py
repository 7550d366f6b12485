"""A list of an autopilot, read by the mission protocol, whatever its items are.

No socket and no clock. MISSION_REQUEST_LIST brings MISSION_COUNT, and each MISSION_REQUEST_INT its item; a missing
answer is requested again. A list is read when the vehicle is met, when it acknowledges an upload of another station,
and once a minute.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from enum import Enum, auto
from typing import Any, Final, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.proxies.mavlink.ways import OURSELVES, Target

_AGAIN_US, _READ_US, _ATTEMPTS = 1_000_000, 60_000_000, 5
_V2 = 0xFD
LIST_NAMES: Final = frozenset({"MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ACK"})
"""The messages that are read only here."""


class ListItem(NamedTuple):
    """An item: MAV_CMD, MAV_FRAME, its first parameter, degrees times 1e7, and metres in the sense of the frame."""

    command: int
    frame: int
    parameter: float
    x: int
    y: int
    z_m: float


class _Phase(Enum):
    WAITS = auto()
    LISTS = auto()
    READS = auto()


class ItemList(ABC):
    """Reads one list of one vehicle, over and over.

    Args:
        name: of the list, in words.
        kind: MAV_MISSION_TYPE.
        most: items; a list of more is not read.

    Attributes:
        problems: sentences about the list that was read last, until they are taken.
    """

    def __init__(self, name: str, kind: int, most: int) -> None:
        self._name, self._kind, self._most = name, kind, most
        self.problems: list[str] = []
        self._reported: list[str] = []
        self.restart()

    def restart(self) -> None:
        """The vehicle is met, or met again: read the list as soon as it may be."""
        self._phase, self._due_us, self._attempts = _Phase.WAITS, 0, 0
        self._count, self._items, self._acknowledges, self._is_unknown = 0, list[ListItem](), False, False

    @property
    def is_busy(self) -> bool:
        """Whether it is being read: some autopilots serve one list at a time."""
        return self._phase is not _Phase.WAITS or self._acknowledges

    def on_message(self, message: Any) -> bool:
        """MISSION_COUNT, MISSION_ITEM_INT, MISSION_ACK; whether what the list means has changed."""
        kind = message.get_type()
        if kind not in LIST_NAMES or message.mission_type != self._kind:
            return False
        is_ours = (message.target_system, message.target_component) == OURSELVES
        match kind:
            case "MISSION_COUNT" if is_ours and self._phase is _Phase.LISTS:
                return self._on_count(message.count)
            case "MISSION_ITEM_INT" if is_ours and self._phase is _Phase.READS and message.seq == len(self._items):
                item = ListItem(message.command, message.frame, message.param1, message.x, message.y, message.z)
                return self._on_item(item)
            case "MISSION_ACK" if not is_ours and message.type == mavlink.MAV_MISSION_ACCEPTED:
                self.read_again()
            case "MISSION_ACK" if is_ours and self._phase is not _Phase.WAITS:
                self._is_unknown = message.type == mavlink.MAV_MISSION_UNSUPPORTED
        return False

    def due(self, target: Target, now_us: int) -> list[Any]:
        """The messages to send now."""
        if self._acknowledges:
            self._acknowledges, self._due_us = False, now_us + _READ_US
            return [mavlink.MAVLink_mission_ack_message(*target, mavlink.MAV_MISSION_ACCEPTED, self._kind)]
        if now_us < self._due_us or self._is_unknown:
            return []
        if self._attempts >= _ATTEMPTS:
            if self._phase is _Phase.READS:
                at = f"item {len(self._items) + 1} of {self._count}"
                self._report(
                    [f"the autopilot's {self._name} was not read: {at} did not come; what was read before counts"]
                )
            self._phase, self._attempts, self._due_us = _Phase.WAITS, 0, now_us + _READ_US
            return []
        if self._phase is _Phase.WAITS:
            self._phase = _Phase.LISTS
        self._attempts, self._due_us = self._attempts + 1, now_us + _AGAIN_US
        if self._phase is _Phase.LISTS:
            return [mavlink.MAVLink_mission_request_list_message(*target, self._kind)]
        return [mavlink.MAVLink_mission_request_int_message(*target, len(self._items), self._kind)]

    def take_problems(self) -> list[str]:
        """The problems of the list, each sentence once."""
        problems, self.problems = self.problems, []
        return problems

    def read_again(self) -> None:
        """It may have changed."""
        if self._phase is _Phase.WAITS:
            self._due_us = 0

    def _on_count(self, count: int) -> bool:
        if count > self._most:
            too_long = f"the autopilot's {self._name} has {count} items, {self._most} are read"
            self._report([f"{too_long}: none is known here; upload a smaller one"])
            self._phase, self._acknowledges, self._attempts = _Phase.WAITS, True, 0
            return self._on_too_long()
        self._phase, self._count, self._items = _Phase.READS, count, []
        self._attempts = self._due_us = 0
        return self._is_read() if count == 0 else False

    def _on_item(self, item: ListItem) -> bool:
        self._items.append(item)
        self._attempts = self._due_us = 0
        return self._is_read() if len(self._items) == self._count else False

    def _is_read(self) -> bool:
        """The list is whole; whether what it means has changed."""
        self._phase, self._acknowledges, self._attempts = _Phase.WAITS, True, 0
        return self._on_whole(self._items)

    @abstractmethod
    def _on_whole(self, items: Sequence[ListItem]) -> bool:
        """Take a whole list; whether what it means has changed."""

    def _on_too_long(self) -> bool:
        """It is too long to be read; whether what it means has changed."""
        return False

    def _report(self, problems: list[str]) -> None:
        """Report what is wrong, unless it was reported already."""
        self.problems += [each for each in problems if each not in self._reported]
        self._reported = problems


def speaks_mavlink_2(message: Any) -> bool:
    """Whether it came in a frame of MAVLink 2: the older one has no lists but that of the mission."""
    return bytes(message.get_msgbuf() or b"")[:1] == bytes([_V2])
