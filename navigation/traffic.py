"""Aircraft that are no members, as they are heard: bounded, each for some seconds, moved on to the time that is asked for.

Pure, federation time. Broadcasts may be wrong on purpose: identities by the thousand, places that leap, numbers that
are none. None of that removes an aircraft that is heard well and near, and all of it is counted.
"""

import hashlib
import math
import re
from collections import Counter
from dataclasses import dataclass
from typing import Final, NamedTuple

from dyknow.navigation.geodesy import distance_m, metres_per_degree
from dyknow.navigation.heard_aircraft import HeardAircraft

MOST_AIRCRAFT: Final = 64
SILENT_US: Final = 15_000_000
"""An aircraft that was not heard for so long is forgotten, and where it is is unknown."""
AHEAD_US: Final = 2_000_000
MOST_HEARINGS: Final = 32
_ALIKE_M, _AS_HIGH_M = 200.0, 150.0
"""Two hearings of one identity that are farther apart are of two aircraft."""
_FASTEST_M_S, _HIGHEST_M, _LOWEST_M = 400.0, 30_000.0, -1_000.0
_TELEPORT_M: Final = 200.0
"""How much farther than the fastest flies a place may be by its error alone."""
_HEARD_WELL: Final = 3
_PLACE_SD_M, _SPEED_SD_M_S, _UNKNOWN_SPEED_M_S = 30.0, 3.0, 80.0
_UNKNOWN_SMALL_M_S: Final = 20.0
_KIND: Final = 8
_IDENTITY: Final = re.compile(r"[a-z0-9][a-z0-9_-]{0,24}[a-z0-9]")
_DERIVED_S: Final = (0.5, 10.0)
"""Between which times of two places a velocity follows from them."""


def identity_of(kind: str, text: str) -> str:
    """The name of an aircraft: its kind and its own identity, unlike that of any platform; else with a digest."""
    kind, text = re.sub(r"[^a-z0-9]", "", kind.lower())[:_KIND] or "x", text.lower()
    name = text if text.startswith(f"{kind}-") else f"{kind}-{text}"
    if _IDENTITY.fullmatch(name):
        return name
    return f"{kind}-{hashlib.sha256(text.encode(errors='replace')).hexdigest()[:16]}"


class TrafficState(NamedTuple):
    """Where an aircraft is at a time, as far as it is known: degrees, metres, metres a second; None: not known.

    Attributes:
        identity: `adsb-4ca123`, `rid-` and the broadcast identity; with `_2` behind it the second place of an identity
            that one hearing has in two, with `-2` that of another hearing.
        source: the kind of hearing: `adsb`, `remote-id`, or the name of the host's stream.
        heard_us: when the place held that this one is predicted from.
        radius_m: within it the aircraft is with 95 %, horizontally; it grows with the age of the broadcast.
        altitude_m: above mean sea level within `altitude_error_m`, 95 %.
        by: the platforms that heard it.
    """

    identity: str
    source: str
    valid_us: int
    heard_us: int
    latitude_deg: float
    longitude_deg: float
    altitude_m: float | None
    altitude_error_m: float
    altitude_reference: str
    north_m_s: float | None
    east_m_s: float | None
    down_m_s: float | None
    radius_m: float
    kind: str
    callsign: str
    by: tuple[str, ...] = ()


@dataclass(slots=True)
class _Track:
    """One aircraft of one hearing: its last broadcast, and their number."""

    heard: HeardAircraft
    times: int = 1
    distance_m: float = math.inf

    @property
    def rank(self) -> tuple[bool, float]:
        """The greatest gives way first: aircraft heard once, then far ones."""
        return self.times < _HEARD_WELL, self.distance_m


class _Hearing:
    """The aircraft that one receiver, stream or platform tells of, at most `most`."""

    def __init__(self, most: int, counts: Counter[str]) -> None:
        self.tracks: dict[str, _Track] = {}
        self._most, self._counts = most, counts

    def take(self, heard: HeardAircraft, place: tuple[float, float] | None) -> bool:
        name, track = heard.identity, self.tracks.get(heard.identity)
        if track is not None and _leaps(track.heard, heard):
            # One of both places is wrong, and it is not known which: there are two aircraft until one is silent.
            self._counts["in two places"] += 1
            name = f"{name}_2"
            track = self.tracks.get(name)
        distance_to_m = _distance_m(place, heard)
        if track is None:
            return self._add(name, _Track(heard, distance_m=distance_to_m))
        if heard.valid_us > track.heard.valid_us:
            track.heard, track.times, track.distance_m = _merged(track.heard, heard), track.times + 1, distance_to_m
        return True

    def _add(self, name: str, track: _Track) -> bool:
        if len(self.tracks) >= self._most:
            worst = max(self.tracks, key=lambda one: self.tracks[one].rank)
            self._counts["too many"] += 1
            if track.distance_m >= self.tracks[worst].distance_m:
                return False
            del self.tracks[worst]
        self.tracks[name] = track
        return True


class TrafficPicture:
    """The aircraft around a place, of all hearings together.

    Each hearing has room of its own, so that none crowds out another's aircraft, and its own place of an identity:
    where hearings do not agree where one is, there are several. The platform's own hearing stands first.

    Args:
        own: this platform.
        most: aircraft of one hearing of its own; another platform has half of that.

    Attributes:
        counts: reports that were dropped, by reason.
    """

    def __init__(self, own: str = "", most: int = MOST_AIRCRAFT, silent_us: int = SILENT_US) -> None:
        self.own, self.most, self.silent_us = own, most, silent_us
        self.counts: Counter[str] = Counter()
        self._hearings: dict[tuple[str, str], _Hearing] = {}
        self._place: tuple[float, float] | None = None

    def __len__(self) -> int:
        return sum(len(hearing.tracks) for hearing in self._hearings.values())

    def move(self, latitude_deg: float, longitude_deg: float) -> None:
        """This is where we are: distances are from here."""
        self._place = latitude_deg, longitude_deg

    def take(self, heard: HeardAircraft, by: str, now_us: int, channel: str = "") -> bool:
        """Take a platform's hearing of an aircraft by one of its receivers; whether it is part of the picture now."""
        wrong = unusable(heard)
        if not wrong:
            is_old = heard.valid_us < now_us - self.silent_us
            wrong = "old" if is_old else "ahead of time" if heard.valid_us > now_us + AHEAD_US else ""
        hearing = self._hearings.get((by, channel))
        if not wrong and hearing is None:
            if len(self._hearings) >= MOST_HEARINGS:
                wrong = "too many"
            else:
                most = self.most if by == self.own else self.most // 2
                hearing = self._hearings[by, channel] = _Hearing(most, self.counts)
        if wrong or hearing is None:
            self.counts[wrong] += 1
            return False
        return hearing.take(heard, self._place)

    def forget(self, now_us: int) -> list[str]:
        """Remove what is silent; returns the identities that no hearing has."""
        gone = set[str]()
        for name, hearing in list(self._hearings.items()):
            for identity, track in list(hearing.tracks.items()):
                if track.heard.valid_us < now_us - self.silent_us:
                    del hearing.tracks[identity]
                    gone.add(identity)
            if not hearing.tracks:
                del self._hearings[name]
        return sorted(gone - {identity for hearing in self._hearings.values() for identity in hearing.tracks})

    def at(self, at_us: int) -> list[TrafficState]:
        """Where each is at a time, flown on straight, the nearest first; those on the ground are left out."""
        found: dict[str, list[TrafficState]] = {}
        for (by, _), hearing in sorted(self._hearings.items(), key=lambda each: (each[0][0] != self.own, each[0])):
            for identity, track in hearing.tracks.items():
                if track.heard.valid_us >= at_us - self.silent_us and not track.heard.on_ground:
                    _join(found.setdefault(identity, []), moved(track.heard, at_us, (by,)))
        named = [
            each._replace(identity=f"{identity}-{number}" if number > 1 else identity)
            for identity, each_of in found.items()
            for number, each in enumerate(each_of, start=1)
        ]
        return sorted(named, key=lambda one: _distance_m(self._place, one))


def _join(there: list[TrafficState], one: TrafficState) -> None:
    """Join another hearing of an aircraft: to its state, or as one in another place."""
    for at, other in enumerate(there):
        apart_m = distance_m(one.latitude_deg, one.longitude_deg, other.latitude_deg, other.longitude_deg)
        height_m = abs((one.altitude_m or 0.0) - (other.altitude_m or 0.0))
        is_as_high = one.altitude_m is None or other.altitude_m is None or height_m <= _AS_HIGH_M
        if apart_m <= _ALIKE_M + one.radius_m + other.radius_m and is_as_high:
            there[at] = other._replace(by=tuple(dict.fromkeys((*other.by, *one.by))))
            return
    there.append(one)


def _distance_m(place: tuple[float, float] | None, of: HeardAircraft | TrafficState) -> float:
    return math.inf if place is None else distance_m(*place, of.latitude_deg, of.longitude_deg)


def unusable(heard: HeardAircraft) -> str:
    """Why a report of an aircraft is of no use; empty if it is."""
    numbers = [heard.latitude_deg, heard.longitude_deg]
    numbers += [
        each for each in (heard.altitude_m, heard.north_m_s, heard.east_m_s, heard.down_m_s) if each is not None
    ]
    if not all(math.isfinite(each) for each in numbers):
        return "no number"
    if not (abs(heard.latitude_deg) <= 90.0 and abs(heard.longitude_deg) <= 180.0):
        return "no place"
    if heard.altitude_m is not None and not _LOWEST_M <= heard.altitude_m <= _HIGHEST_M:
        return "no altitude"
    speeds = (heard.north_m_s or 0.0, heard.east_m_s or 0.0, heard.down_m_s or 0.0)
    return "too fast" if math.hypot(*speeds) > _FASTEST_M_S else ""


def moved(heard: HeardAircraft, at_us: int, by: tuple[str, ...] = ()) -> TrafficState:
    """The state at a time, by a straight flight from the broadcast one."""
    age_s = (at_us - heard.valid_us) / 1e6
    north_m_s, east_m_s, down_m_s = heard.north_m_s, heard.east_m_s, heard.down_m_s
    north_m, east_m = (north_m_s or 0.0) * age_s, (east_m_s or 0.0) * age_s
    m_lat, m_lon = metres_per_degree(heard.latitude_deg)
    altitude_m = heard.altitude_m
    error_m = heard.altitude_error_m
    if altitude_m is not None:
        altitude_m -= (down_m_s or 0.0) * age_s
        error_m += abs(age_s) * (2.0 if down_m_s is not None else 5.0)
    if north_m_s is None:
        drift_m_s = _UNKNOWN_SMALL_M_S if heard.source == "remote-id" else _UNKNOWN_SPEED_M_S
    else:
        drift_m_s = 2.0 * _SPEED_SD_M_S
    sd_m = _PLACE_SD_M if heard.horizontal_sd_m is None else heard.horizontal_sd_m
    return TrafficState(
        heard.identity, heard.source, at_us, heard.valid_us,
        max(-90.0, min(90.0, heard.latitude_deg + north_m / m_lat)),
        (heard.longitude_deg + east_m / m_lon + 180.0) % 360.0 - 180.0,
        altitude_m, error_m, heard.altitude_reference, north_m_s, east_m_s, down_m_s,
        2.0 * sd_m + drift_m_s * abs(age_s), heard.kind, heard.callsign, by,
    )  # fmt: skip


def _leaps(before: HeardAircraft, heard: HeardAircraft) -> bool:
    """Whether no aircraft flies from one place to the other in that time."""
    apart_m = distance_m(before.latitude_deg, before.longitude_deg, heard.latitude_deg, heard.longitude_deg)
    return apart_m > _TELEPORT_M + _FASTEST_M_S * abs(heard.valid_us - before.valid_us) / 1e6


def _merged(before: HeardAircraft, heard: HeardAircraft) -> HeardAircraft:
    """The newer report; a callsign and a kind that only came before are kept, and a velocity that is missing follows from both places."""
    heard = heard._replace(callsign=heard.callsign or before.callsign, kind=heard.kind or before.kind)
    seconds = (heard.valid_us - before.valid_us) / 1e6
    if heard.north_m_s is not None or not _DERIVED_S[0] <= seconds <= _DERIVED_S[1]:
        return heard
    m_lat, m_lon = metres_per_degree(heard.latitude_deg)
    north_m = (heard.latitude_deg - before.latitude_deg) * m_lat
    east_m = math.remainder(heard.longitude_deg - before.longitude_deg, 360.0) * m_lon
    return heard._replace(north_m_s=north_m / seconds, east_m_s=east_m / seconds)
