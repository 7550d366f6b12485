"""Which of the aircraft that are heard are vehicles of the federation, heard by their own ADS-B or Remote ID.

A broadcast identity may be false, so that only the motion of an aircraft decides: it is at the place of a member, as
fast, in five reports, while that member has flown a way. Where Remote ID names the member, one such report is enough. An
aircraft that is elsewhere later is another one again. Two that hover next to each other are two.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from dyknow.navigation.geodesy import distance_m
from dyknow.navigation.traffic import TrafficState

ALIKE: Final = 5
WAY_M: Final = 10.0
NEAR_M, NEAR_M_S, NEAR_UP_M = 25.0, 5.0, 60.0
_LEAVES: Final = 3.0
REMOTE_ID: Final = "rid-"


class MemberState(NamedTuple):
    """Where a member's vehicle is at a time; degrees, metres, metres a second."""

    unit: str
    latitude_deg: float
    longitude_deg: float
    altitude_m: float | None
    north_m_s: float | None = None
    east_m_s: float | None = None
    down_m_s: float | None = None


@dataclass(slots=True)
class _Alike:
    """An aircraft and a member that were at one place: in how many reports, since where."""

    first: MemberState
    heard_us: int
    number: int = 1
    is_echo: bool = False


@dataclass(slots=True)
class MemberEchoes:
    """The aircraft that are members' own vehicles."""

    _alike: dict[tuple[str, str], _Alike] = field(default_factory=dict)

    def look(self, aircraft: Iterable[TrafficState], members: Iterable[MemberState]) -> dict[str, str]:
        """Compare them at one time; returns the member of each aircraft that is one, by identity."""
        members = list(members)
        aircraft = list(aircraft)
        known = {one.identity for one in aircraft}
        for pair in [pair for pair in self._alike if pair[0] not in known]:
            del self._alike[pair]
        found: dict[str, str] = {}
        for one in aircraft:
            for member in members:
                if self._is_echo(one, member):
                    found.setdefault(one.identity, member.unit)
        return found

    def _is_echo(self, one: TrafficState, member: MemberState) -> bool:
        pair = one.identity, member.unit
        alike = self._alike.get(pair)
        wider = _LEAVES if alike is not None and alike.is_echo else 1.0
        if not _agree(one, member, wider):
            self._alike.pop(pair, None)
            return False
        if alike is None:
            alike = self._alike[pair] = _Alike(member, one.heard_us)
        elif one.heard_us > alike.heard_us:
            alike.heard_us, alike.number = one.heard_us, alike.number + 1
        named = one.identity.removesuffix("_2") == REMOTE_ID + member.unit
        alike.is_echo |= named or (alike.number >= ALIKE and _way_m(alike.first, member) >= WAY_M)
        return alike.is_echo


def _agree(one: TrafficState, member: MemberState, wider: float) -> bool:
    near_m = NEAR_M + min(one.radius_m, NEAR_M)
    if distance_m(one.latitude_deg, one.longitude_deg, member.latitude_deg, member.longitude_deg) > wider * near_m:
        return False
    up_m = NEAR_UP_M + one.altitude_error_m
    if one.altitude_m is not None and member.altitude_m is not None and abs(one.altitude_m - member.altitude_m) > up_m:
        return False
    if one.north_m_s is None or one.east_m_s is None or member.north_m_s is None or member.east_m_s is None:
        return True
    north_m_s, east_m_s = one.north_m_s - member.north_m_s, one.east_m_s - member.east_m_s
    return math.hypot(north_m_s, east_m_s) <= wider * NEAR_M_S


def _way_m(first: MemberState, last: MemberState) -> float:
    up_m = 0.0 if first.altitude_m is None or last.altitude_m is None else last.altitude_m - first.altitude_m
    return distance_m(first.latitude_deg, first.longitude_deg, last.latitude_deg, last.longitude_deg, up_m)
