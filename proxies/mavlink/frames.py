"""MAVLink frames in bytes: where one begins and ends, whose it is, and what it says if we want to know.

pymavlink hands out messages of unknown types with neither checksum nor signature checked, so a frame is decoded only if
its type is on the allow-list, and only after its ids were looked at.
"""

import hashlib
import hmac
import mmap
from collections.abc import Iterator
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from proxies.mavlink.reports import DESCRIBING

_V1, _V2 = 0xFE, 0xFD
_SIGNED, _SIGNATURE = 1, 13

_NAMES = {*DESCRIBING, "SYSTEM_TIME", "COMMAND_ACK"}
WANTED = frozenset(number for number, kind in mavlink.mavlink_map.items() if kind.msgname in _NAMES)
"""The allow-list of message ids."""


class Frame(NamedTuple):
    """One frame, not yet checked. `whole` is False where the bytes end before the frame does."""

    data: bytes
    system: int
    component: int
    message_id: int
    whole: bool


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


def frames(datagram: bytes) -> Iterator[Frame]:
    """The frames of one datagram; what is not a frame is passed over."""
    offset = 0
    while offset < len(datagram):
        frame = frame_at(datagram, offset)
        if frame is None or not frame.whole:
            offset += 1
            continue
        yield frame
        offset += len(frame.data)


def decoded(codec: Any, frame: Frame) -> Any | None:
    """The message of a frame, or None: not wanted, wrong checksum, wrong or missing signature, too short.

    Args:
        codec: a pymavlink `MAVLink`; with a signing key it accepts signed frames only, each once.
        frame: as cut from the bytes.
    """
    key = codec.signing.secret_key
    if frame.message_id not in WANTED or (key is not None and not _signed(key, frame.data)):
        return None
    try:
        return codec.decode(bytearray(frame.data))
    except (mavlink.MAVError, ValueError, IndexError, TypeError):
        return None


def _signed(key: bytes, data: bytes) -> bool:
    """Whether a frame carries the key's signature: sha256(key + frame up to the signature), its first 48 bits.

    pymavlink notes a frame's signature time before it has checked the signature, so one forged frame from the future
    would make it refuse all honest ones; this check comes before it.
    """
    signed = len(data) > _SIGNATURE and data[0] == _V2 and bool(data[2] & _SIGNED)
    return signed and hmac.compare_digest(hashlib.sha256(key + data[:-6]).digest()[:6], data[-6:])
