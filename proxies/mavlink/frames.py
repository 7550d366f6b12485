"""MAVLink frames in bytes: begin and end, sender, and the message if it is wanted.

pymavlink hands out messages of unknown types with neither checksum nor signature checked, so a frame is decoded only if
its type is on the allow-list, and only after its ids were looked at.
"""

import hashlib
import hmac
import mmap
import re
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.proxies.mavlink.lists.item_list import LIST_NAMES
from dyknow.proxies.mavlink.reports import DESCRIBING
from dyknow.proxies.mavlink.traffic import TRAFFIC_NAMES

_V1, _V2 = 0xFE, 0xFD
_BEGINS = re.compile(b"[\xfe\xfd]")
_HEAD = 10
_MOST_DAMAGED = 64
_SIGNED, _SIGNATURE = 1, 13

_NAMES = {*DESCRIBING, *TRAFFIC_NAMES, *LIST_NAMES, "SYSTEM_TIME", "COMMAND_ACK"}
WANTED = frozenset(number for number, kind in mavlink.mavlink_map.items() if kind.msgname in _NAMES)
"""The allow-list of message ids."""


class Frame(NamedTuple):
    """One frame, not yet checked. `whole` is False where the bytes end before the frame does."""

    data: bytes
    system: int
    component: int
    message_id: int
    whole: bool

    @property
    def version(self) -> int:
        """Of the protocol: 1 or 2."""
        return 1 if self.data[0] == _V1 else 2

    @property
    def is_signed(self) -> bool:
        """Whether it carries a signature, right or wrong."""
        return self.data[0] == _V2 and len(self.data) > _SIGNATURE and bool(self.data[2] & _SIGNED)

    @property
    def is_intact(self) -> bool:
        """Whether its checksum is right; False for a type that no dialect knows, whose checksum cannot be computed."""
        kind = mavlink.mavlink_map.get(self.message_id)
        if kind is None or not self.whole:
            return False
        end = len(self.data) - 2 - (_SIGNATURE if self.is_signed else 0)
        checksum = mavlink.x25crc(self.data[1:end])
        checksum.accumulate(bytes((kind.crc_extra,)))
        return self.data[end : end + 2] == int(checksum.crc).to_bytes(2, "little")


def frame_at(data: bytes | mmap.mmap, offset: int) -> Frame | None:
    """The frame that begins at `offset`, or None where none begins."""
    head = bytes(data[offset : offset + 10])
    if len(head) >= 6 and head[0] == _V1:
        length, system, component, message_id = head[1] + 8, head[3], head[4], head[5]
    elif len(head) >= 10 and head[0] == _V2:
        length = head[1] + 12 + (_SIGNATURE if head[2] & _SIGNED else 0)
        system, component, message_id = head[5], head[6], int.from_bytes(head[7:10], "little")
    else:
        return None
    found = bytes(data[offset : offset + length])
    return Frame(found, system, component, message_id, len(found) == length)


class Cutter:
    """Cuts the bytes of one peer into frames, also where a frame comes in several pieces.

    A frame that has not ended yet waits for its rest; if what comes shows that it was none (whole frames follow, or
    its checksum is wrong), what was passed over is looked at again. Types that no dialect knows have no checksum, and
    are passed over.

    Attributes:
        damaged: number of frames with a wrong checksum.
    """

    def __init__(self) -> None:
        self.damaged = 0
        self._tail = b""

    def cut(self, data: bytes) -> list[Frame]:
        """The frames that end in `data`, which follows what was given before."""
        data = self._tail + data
        found: list[Frame] = []
        waiting: int | None = None
        offset, worst = 0, self.damaged + _MOST_DAMAGED
        while self.damaged < worst and (begins := _BEGINS.search(data, offset)):
            offset = begins.start()
            frame = frame_at(data, offset)
            if frame is not None and frame.whole and self._is_sound(frame):
                found.append(frame)
                offset, waiting = offset + len(frame.data), None
                continue
            if waiting is None and (not frame.whole if frame is not None else len(data) - offset < _HEAD):
                waiting = offset
            offset += 1
        self._tail = b"" if waiting is None or self.damaged >= worst else data[waiting:]
        return found

    def _is_sound(self, frame: Frame) -> bool:
        is_intact = frame.is_intact
        self.damaged += not is_intact and frame.message_id in mavlink.mavlink_map
        return is_intact


def decoded(codec: Any, frame: Frame) -> Any | None:
    """The message of a frame, or None: not wanted, wrong checksum, wrong or missing signature, too short.

    Args:
        codec: a pymavlink `MAVLink`; with a signing key it accepts signed frames only, each once.
        frame: as cut from the bytes.
    """
    key = codec.signing.secret_key
    if frame.message_id not in WANTED or (key is not None and not _is_signed_with(key, frame)):
        return None
    try:
        return codec.decode(bytearray(frame.data))
    except (mavlink.MAVError, ValueError, IndexError, TypeError):
        return None


def _is_signed_with(key: bytes, frame: Frame) -> bool:
    """Whether a frame carries the key's signature: sha256(key + frame up to the signature), its first 48 bits.

    pymavlink notes a frame's signature time before it has checked the signature, so one forged frame from the future
    would make it refuse all honest ones; this check comes before it.
    """
    data = frame.data
    return frame.is_signed and hmac.compare_digest(hashlib.sha256(key + data[:-6]).digest()[:6], data[-6:])
