"""MAVLink 2 frames of one vehicle: bytes in and out, one sequence per peer.

Only the message types that a vehicle reads are decoded: an unknown type has no checksum of its own.
"""

from collections.abc import Iterator
from typing import Any, TypeAlias

from pymavlink.dialects.v20 import all as mavlink

from dyknow.proxies.mavlink.frames import Cutter
from dyknow.sim_uavs.dynamics.settings import Peer

Message: TypeAlias = Any  # pymavlink builds its message classes without types

COMPONENT = mavlink.MAV_COMP_ID_AUTOPILOT1
_V1 = 0xFE
_FORGET_US = 30_000_000
_MOST_PEERS = 16

READ = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_PING,
        mavlink.MAVLINK_MSG_ID_SET_MODE,
        mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ,
        mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST,
        mavlink.MAVLINK_MSG_ID_PARAM_SET,
        mavlink.MAVLINK_MSG_ID_MISSION_REQUEST,
        mavlink.MAVLINK_MSG_ID_MISSION_SET_CURRENT,
        mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_LIST,
        mavlink.MAVLINK_MSG_ID_MISSION_COUNT,
        mavlink.MAVLINK_MSG_ID_MISSION_CLEAR_ALL,
        mavlink.MAVLINK_MSG_ID_MISSION_ACK,
        mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT,
        mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT,
        mavlink.MAVLINK_MSG_ID_REQUEST_DATA_STREAM,
        mavlink.MAVLINK_MSG_ID_COMMAND_INT,
        mavlink.MAVLINK_MSG_ID_COMMAND_LONG,
        mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED,
        mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT,
        mavlink.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL,
        mavlink.MAVLINK_MSG_ID_TIMESYNC,
    }
)


class Decoder:
    """Frames to messages; a frame with a wrong checksum is counted and dropped."""

    def __init__(self, version: int = 2) -> None:
        self._mav, self._version = mavlink.MAVLink(None), version
        self.dropped = 0

    def read(self, data: bytes) -> Iterator[Message]:
        cutter = Cutter()
        found = cutter.cut(data)
        self.dropped += cutter.damaged
        for frame in found:
            if frame.message_id not in READ or (self._version == 1 and frame.data[0] != _V1):
                continue
            try:
                message = self._mav.decode(bytearray(frame.data))
            except mavlink.MAVError:
                self.dropped += 1
                continue
            yield message


class MavlinkLink:
    """One peer: its own frame sequence, and how often it wants which stream (message id -> ticks, 0: never).

    `met` is whether anything was sent to it yet: a new peer is sent everything at once.
    """

    def __init__(self, peer: Peer, system_id: int, now_us: int, version: int = 2, *, forever: bool) -> None:
        self.peer, self.heard_us, self._forever, self._version = peer, now_us, forever, version
        self.ticks: dict[int, int] = {}
        self.met = False
        self._mav = mavlink.MAVLink(None, srcSystem=system_id, srcComponent=COMPONENT)

    def is_forgotten(self, now_us: int) -> bool:
        return not self._forever and now_us - self.heard_us > _FORGET_US

    def packed(self, message: Message) -> bytes:
        data: bytes = message.pack(self._mav, force_mavlink1=self._version == 1)
        self._mav.seq = (self._mav.seq + 1) % 256
        return data


class Links:
    """The peers of a vehicle: those it was given, and at most 16 in all that have spoken to it lately."""

    def __init__(self, system_id: int, given: tuple[Peer, ...], now_us: int, version: int = 2) -> None:
        self._system_id, self._version = system_id, version
        self._links = {peer: MavlinkLink(peer, system_id, now_us, version, forever=True) for peer in given}

    def __iter__(self) -> Iterator[MavlinkLink]:
        return iter(tuple(self._links.values()))

    def heard(self, peer: Peer, now_us: int) -> MavlinkLink | None:
        """The link of a peer that sent a sound message; None when there are too many to take it in."""
        link = self._links.get(peer)
        if link is None and len(self._links) < _MOST_PEERS:
            link = self._links[peer] = MavlinkLink(peer, self._system_id, now_us, self._version, forever=False)
        if link is not None:
            link.heard_us = now_us
        return link

    def forget(self, now_us: int) -> None:
        """Drop learned peers that have been silent for half a minute."""
        self._links = {peer: link for peer, link in self._links.items() if not link.is_forgotten(now_us)}
