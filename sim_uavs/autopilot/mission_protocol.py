"""The mission protocol: upload with re-requests, download, clear; of missions and of fences. Rally lists are always empty."""

from typing import NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from dyknow.navigation.fences import FenceArea
from dyknow.navigation.geodesy import LocalFrame
from dyknow.proxies.mavlink.lists.fence_list import FenceItem, read_areas
from dyknow.sim_uavs.autopilot.link import Message
from dyknow.sim_uavs.autopilot.personas import Persona
from dyknow.sim_uavs.autopilot.points import FRAMES, local_point
from dyknow.sim_uavs.dynamics.fences import FlightFence
from dyknow.sim_uavs.dynamics.flight import Flight
from dyknow.sim_uavs.dynamics.missions import Item, MissionAction
from dyknow.sim_uavs.dynamics.settings import Peer

_MISSION, _FENCE = mavlink.MAV_MISSION_TYPE_MISSION, mavlink.MAV_MISSION_TYPE_FENCE
_MOST_ITEMS = 200
_ASK_AGAIN_US = 500_000
_MOST_ASKS = 20

_PLACED = {
    mavlink.MAV_CMD_NAV_TAKEOFF,
    mavlink.MAV_CMD_NAV_LAND,
    mavlink.MAV_CMD_NAV_WAYPOINT,
    mavlink.MAV_CMD_NAV_LOITER_TIME,
    mavlink.MAV_CMD_NAV_LOITER_UNLIM,
}


class Requester(NamedTuple):
    """The requester: the address bytes come from, and the system and component in the frame."""

    peer: Peer
    system: int
    component: int


class _Stored(NamedTuple):
    """An item as it was uploaded, downloaded unchanged."""

    frame: int
    command: int
    autocontinue: int
    params: tuple[float, float, float, float]
    x: int
    y: int
    z: float


class _Upload(NamedTuple):
    """An upload under way: the items so far, and when the next was last asked for."""

    requester: Requester
    kind: int
    total: int
    stored: tuple[_Stored, ...]
    asked_us: int
    asks: int


class Missions:
    """One vehicle's lists on the wire; flown items go to `flight.items`, those of the fence to `fence`."""

    def __init__(self, flight: Flight, frame: LocalFrame, persona: Persona, fence: FlightFence) -> None:
        self._flight, self._frame, self._persona, self._fence = flight, frame, persona, fence
        self._lists: dict[int, tuple[_Stored, ...]] = {_MISSION: (), _FENCE: _fence_items(fence.areas)}
        self._upload: _Upload | None = None
        self._last: Requester | None = None
        flight.first_item = 1 if persona.home_is_item_0 else 0

    @property
    def count(self) -> int:
        return len(self._lists[_MISSION])

    @property
    def deadline_us(self) -> int | None:
        return None if self._upload is None else self._upload.asked_us + _ASK_AGAIN_US

    def on_time(self, now_us: int) -> list[tuple[Requester, Message]]:
        """Ask again for an item that did not come; give up after ten seconds."""
        upload = self._upload
        if upload is None or now_us < upload.asked_us + _ASK_AGAIN_US:
            return []
        if upload.asks >= _MOST_ASKS:
            self._upload = None
            return [
                (upload.requester, self._ack(upload.requester, mavlink.MAV_MISSION_OPERATION_CANCELLED, upload.kind))
            ]
        return [(upload.requester, self._ask(upload, now_us))]

    def on_count(self, requester: Requester, message: Message, now_us: int) -> list[Message]:
        """The start of an upload; a repeated start restarts it."""
        kind = message.mission_type
        if kind not in self._lists:
            return [self._ack(requester, mavlink.MAV_MISSION_UNSUPPORTED, kind)]
        if message.count > _MOST_ITEMS:
            return [self._ack(requester, mavlink.MAV_MISSION_NO_SPACE, kind)]
        if self._upload is not None and self._upload.requester != requester:
            return [self._ack(requester, mavlink.MAV_MISSION_DENIED, kind)]
        if message.count == 0:
            return self.on_clear(requester, message)
        return [self._ask(_Upload(requester, kind, message.count, (), now_us, 0), now_us)]

    def on_item(self, requester: Requester, message: Message, now_us: int) -> list[Message]:
        upload, kind = self._upload, message.mission_type
        if upload is None or upload.requester != requester or upload.kind != kind:
            done = requester == self._last and message.seq == len(self._lists.get(kind, ())) - 1
            result = mavlink.MAV_MISSION_ACCEPTED if done else mavlink.MAV_MISSION_INVALID_SEQUENCE
            return [self._ack(requester, result, kind)]
        if message.seq != len(upload.stored):
            return [self._ask(upload, now_us)]
        params = (message.param1, message.param2, message.param3, message.param4)
        item = _Stored(message.frame, message.command, message.autocontinue, params, message.x, message.y, message.z)
        upload = upload._replace(stored=(*upload.stored, item), asks=0)
        if len(upload.stored) < upload.total:
            return [self._ask(upload, now_us)]
        self._upload = None
        take = self._take_fence if kind == _FENCE else self._take
        return [self._ack(requester, take(requester, upload.stored), kind)]

    def on_clear(self, requester: Requester, message: Message) -> list[Message]:
        if message.mission_type in {_MISSION, mavlink.MAV_MISSION_TYPE_ALL}:
            self._upload, self._lists[_MISSION], self._flight.items = None, (), ()
        if message.mission_type in {_FENCE, mavlink.MAV_MISSION_TYPE_ALL}:
            self._upload, self._lists[_FENCE] = None, ()
            self._fence.take(())
        return [self._ack(requester, mavlink.MAV_MISSION_ACCEPTED, message.mission_type)]

    def on_list(self, requester: Requester, message: Message) -> list[Message]:
        count = len(self._lists.get(message.mission_type, ()))
        return [
            mavlink.MAVLink_mission_count_message(requester.system, requester.component, count, message.mission_type)
        ]

    def on_request(self, requester: Requester, message: Message) -> list[Message]:
        kind = message.mission_type
        stored = self._lists.get(kind, ())
        if message.seq >= len(stored):
            return [self._ack(requester, mavlink.MAV_MISSION_INVALID_SEQUENCE, kind)]
        s = stored[message.seq]
        current = int(kind == _MISSION and message.seq == self._flight.progress.item)
        return [
            mavlink.MAVLink_mission_item_int_message(
                requester.system,
                requester.component,
                message.seq,
                s.frame,
                s.command,
                current,
                s.autocontinue,
                *s.params,
                s.x,
                s.y,
                s.z,
                kind,
            )
        ]

    def _ask(self, upload: _Upload, now_us: int) -> Message:
        self._upload = upload._replace(asked_us=now_us, asks=upload.asks + 1)
        seq, requester = len(upload.stored), upload.requester
        return mavlink.MAVLink_mission_request_int_message(requester.system, requester.component, seq, upload.kind)

    @staticmethod
    def _ack(requester: Requester, result: int, mission_type: int = _MISSION) -> Message:
        return mavlink.MAVLink_mission_ack_message(requester.system, requester.component, result, mission_type)

    def _take(self, requester: Requester, stored: tuple[_Stored, ...]) -> int:
        """Store a whole mission, or none of it when an item cannot be flown."""
        items = []
        for index, one in enumerate(stored):
            item = self._read(one, is_home=index < self._flight.first_item)
            if isinstance(item, int):
                return item
            items.append(item)
        self._lists[_MISSION], self._last = stored, requester
        self._flight.items = tuple(items)
        self._flight.set_item(min(self._flight.first_item, len(items) - 1))
        return int(mavlink.MAV_MISSION_ACCEPTED)

    def _take_fence(self, requester: Requester, stored: tuple[_Stored, ...]) -> int:
        """Keep to a whole fence, or to the one before when there is something wrong with it."""
        areas, problems = read_areas([FenceItem(s.command, s.params[0], s.x, s.y) for s in stored])
        if problems:
            return int(mavlink.MAV_MISSION_INVALID)
        self._lists[_FENCE], self._last = stored, requester
        self._fence.take(areas)
        return int(mavlink.MAV_MISSION_ACCEPTED)

    def _read(self, s: _Stored, *, is_home: bool) -> Item | int:
        """An item to fly, or the MAV_MISSION_RESULT that says why not."""
        if s.command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            return Item(MissionAction.RETURN)
        if s.command == mavlink.MAV_CMD_DO_CHANGE_SPEED:
            return Item(MissionAction.SET_SPEED, speed_m_s=s.params[1])
        if s.command == mavlink.MAV_CMD_NAV_LAND and not (s.x or s.y):
            return Item(MissionAction.LAND)
        if s.command not in _PLACED:
            return int(mavlink.MAV_MISSION_UNSUPPORTED)
        if s.frame not in FRAMES:
            return int(mavlink.MAV_MISSION_UNSUPPORTED_FRAME)
        rising = s.command == mavlink.MAV_CMD_NAV_TAKEOFF or is_home
        latitude_deg = self._frame.latitude_deg if rising else s.x / 1e7
        longitude_deg = self._frame.longitude_deg if rising else s.y / 1e7
        point = local_point(self._frame, s.frame, latitude_deg, longitude_deg, s.z)
        if point is None:
            return int(mavlink.MAV_MISSION_INVALID)
        if s.command == mavlink.MAV_CMD_NAV_TAKEOFF:
            return Item(MissionAction.TAKE_OFF, point)
        if s.command == mavlink.MAV_CMD_NAV_LAND:
            return Item(MissionAction.LAND, point)
        if s.command == mavlink.MAV_CMD_NAV_LOITER_UNLIM:
            return Item(MissionAction.FLY_TO, point, stay_us=None)
        stay_s = s.params[0] if 0.0 <= s.params[0] < 86_400.0 else 0.0
        within_m = s.params[1] if 0.5 <= s.params[1] <= 100.0 else 1.5
        return Item(MissionAction.FLY_TO, point, round(stay_s * 1e6), within_m)


def _fence_items(areas: tuple[FenceArea, ...]) -> tuple[_Stored, ...]:
    """A fence as it is downloaded."""
    items = []
    for area in areas:
        places = area.corners or ((area.centre or (0.0, 0.0)),)
        form = "POLYGON_VERTEX" if area.corners else "CIRCLE"
        command = getattr(mavlink, f"MAV_CMD_NAV_FENCE_{form}_{area.kind.upper()}")
        parameter = float(len(area.corners)) if area.corners else area.radius_m
        for latitude_deg, longitude_deg in places:
            place = round(latitude_deg * 1e7), round(longitude_deg * 1e7)
            params = (parameter, 0.0, 0.0, 0.0)
            items.append(_Stored(mavlink.MAV_FRAME_GLOBAL_INT, command, 1, params, *place, 0.0))
    return tuple(items)
