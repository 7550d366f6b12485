"""Whether what a vehicle states of its motion can be flown: its positions, altitudes and velocities, against each other.

The bounds are far beyond the estimates of real flights: there an interval of 3 s contradicts the velocities by 7 m
level and 13 m vertically, altitudes change by 3.6 m in 0.1 s, and a filter that has to find its vehicle again withholds
positions for seconds before they leap. Degrees (WGS-84), metres, metres per second; valid times in microseconds.
"""

from collections import deque
from collections.abc import Iterator
from itertools import pairwise
from math import cos, hypot, radians
from typing import Final, Literal, NamedTuple, TypeAlias

from dyknow.navigation.geodesy import distance_m

SPEED_M_S, LEAP_M = 150.0, 50.0
"""A place that changes faster, beyond a correction, is not flown."""
CLIMB_M_S, CLIMB_M = 50.0, 20.0
SPREADS, SPREAD_MOST_M = 5.0, 20.0
"""By five standard deviations a place may be corrected; a large one that is stated excuses no more."""
GAP_US: Final = 2_000_000
"""After a longer silence a filter may have found its vehicle elsewhere, where glitches of a receiver had it."""
GAP_LEAPS, GAPS_WITHIN_US = 3, 60_000_000
WINDOW_US, EVERY_US, APART_US = 3_000_000, 500_000, 1_000_000
OFF_M, OFF_UP_M, OFF_SHARE = 20.0, 30.0, 0.25
"""By how much positions of a window may differ from where the velocities lead: that, and a share of the way."""
IN_A_ROW = 2
DEGREE_M: Final = 111_320.0
THIN_US, KEPT = 90_000, 64
CAMERA_M, CAMERA_US = 100.0, 300_000

Contradiction: TypeAlias = Literal["no place", "leap", "climb", "velocity", "camera"]


class Unflown(NamedTuple):
    """A contradiction of the stated motion, in words that follow `platform 4 states`."""

    kind: Contradiction
    text: str


class StatedPlace(NamedTuple):
    """A position, and when it came."""

    valid_us: int
    latitude_deg: float
    longitude_deg: float
    at_us: int


class StatedMotion:
    """One vehicle. Samples are taken in the order of their valid times, and older ones left out.

    Attributes:
        places: the newest of the last seconds, not more than ten a second.
    """

    def __init__(self) -> None:
        self.places: deque[StatedPlace] = deque(maxlen=KEPT)
        self._altitudes: deque[tuple[int, float]] = deque(maxlen=KEPT)
        self._velocities: deque[tuple[int, float, float, float]] = deque(maxlen=KEPT)
        self._last: StatedPlace | None = None
        self._last_up: tuple[int, float] | None = None
        self._gap_leaps_us: deque[int] = deque(maxlen=GAP_LEAPS)
        self._judged_us, self._in_a_row = 0, 0

    def on_position(
        self, valid_us: int, latitude_deg: float, longitude_deg: float, sd_m: float, at_us: int
    ) -> Iterator[Unflown]:
        """Take a position with its standard deviation, and its arrival; yields its contradictions."""
        if abs(latitude_deg) > 90.0 or abs(longitude_deg) > 360.0:
            yield Unflown("no place", "positions that are no place on earth")
            return
        place, last = StatedPlace(valid_us, latitude_deg, longitude_deg, at_us), self._last
        if last is not None and valid_us <= last.valid_us:
            return
        self._last = place
        slack_m = LEAP_M + SPREADS * min(SPREAD_MOST_M, max(0.0, sd_m))
        if last is not None:
            if valid_us > last.valid_us + GAP_US:
                yield from self._on_gap(last, place, slack_m)
            elif leap := _leap(last, place, slack_m) or _leap(self.places[0], place, slack_m):
                self.places.clear()  # the velocities are not to blame
                yield from leap
        if not self.places or valid_us >= self.places[-1].valid_us + THIN_US:
            self.places.append(place)
            while self.places[0].valid_us < valid_us - WINDOW_US - THIN_US:
                self.places.popleft()
        if valid_us >= self._judged_us + EVERY_US:
            self._judged_us = valid_us
            yield from self._against_velocities()

    def _on_gap(self, last: StatedPlace, place: StatedPlace, slack_m: float) -> Iterator[Unflown]:
        self.places.clear()
        if leap := _leap(last, place, slack_m):
            leaps_us = self._gap_leaps_us
            leaps_us.append(place.valid_us)
            if len(leaps_us) == GAP_LEAPS and leaps_us[0] > place.valid_us - GAPS_WITHIN_US:
                yield from leap

    def on_altitude(self, valid_us: int, altitude_m: float, sd_m: float) -> Iterator[Unflown]:
        """Take an altitude."""
        last = self._last_up
        if last is not None and valid_us <= last[0]:
            return
        self._last_up = valid_us, altitude_m
        self._altitudes.append(self._last_up)
        if last is None or valid_us > last[0] + GAP_US:
            return
        seconds, climb_m = (valid_us - last[0]) / 1e6, abs(altitude_m - last[1])
        if climb_m > CLIMB_M + CLIMB_M_S * seconds + SPREADS * min(SPREAD_MOST_M, max(0.0, sd_m)):
            yield Unflown("climb", f"altitudes that no vehicle flies: {climb_m:.0f} m in {seconds:.2g} s")

    def on_velocity(self, valid_us: int, north_m_s: float, east_m_s: float, down_m_s: float) -> None:
        """Take a velocity, which later positions are compared with."""
        if not self._velocities or valid_us >= self._velocities[-1][0] + THIN_US:
            self._velocities.append((valid_us, north_m_s, east_m_s, down_m_s))

    def on_camera(self, valid_us: int, latitude_deg: float, longitude_deg: float) -> Iterator[Unflown]:
        """Take the place of its cameras; yields its contradiction to a position of about that time."""
        last = self._last
        if last is not None and abs(valid_us - last.valid_us) <= CAMERA_US and abs(latitude_deg) <= 90.0:
            far_m = distance_m(last.latitude_deg, last.longitude_deg, latitude_deg, longitude_deg)
            if far_m > CAMERA_M:
                yield Unflown("camera", f"cameras that are {far_m:.0f} m from its position")

    def _against_velocities(self) -> Iterator[Unflown]:
        """Compare where the velocities lead with the positions, over a window without gaps."""
        places = self.places
        since_us, until_us = places[0].valid_us, places[-1].valid_us
        moves = [each for each in self._velocities if since_us - THIN_US <= each[0] <= until_us]
        is_whole = until_us - since_us >= WINDOW_US and moves and moves[0][0] <= since_us + APART_US
        if not is_whole or until_us > moves[-1][0] + APART_US or not _is_dense(moves):
            self._in_a_row = 0
            return
        off_m, off_up_m, way_m = self._offset(moves, since_us, until_us)
        is_off = off_m > OFF_M + OFF_SHARE * way_m or off_up_m > OFF_UP_M + OFF_SHARE * way_m
        self._in_a_row = self._in_a_row + 1 if is_off else 0
        if self._in_a_row >= IN_A_ROW:
            seconds = (until_us - since_us) / 1e6
            text = f"velocities that contradict its positions: {max(off_m, off_up_m):.0f} m in {seconds:.1f} s"
            yield Unflown("velocity", text)

    def _offset(
        self, moves: list[tuple[int, float, float, float]], since_us: int, until_us: int
    ) -> tuple[float, float, float]:
        """How far, level and vertically, positions differ from where velocities lead, and the way that these are long."""
        north_m = east_m = down_m = way_m = 0.0
        ends_us = [each[0] for each in moves[1:]] + [until_us]
        begin_us = since_us
        for (_, north_m_s, east_m_s, down_m_s), end_us in zip(moves, ends_us, strict=True):
            seconds = max(0, end_us - begin_us) / 1e6
            begin_us = max(begin_us, end_us)
            north_m += north_m_s * seconds
            east_m += east_m_s * seconds
            down_m += down_m_s * seconds
            way_m += hypot(north_m_s, east_m_s, down_m_s) * seconds
        first, last = self.places[0], self.places[-1]
        level_m = moved_m(first, last)
        heights = [each for each in self._altitudes if since_us <= each[0] <= until_us]
        is_level_only = not heights or heights[0][0] > since_us + EVERY_US or heights[-1][0] < until_us - EVERY_US
        off_up_m = 0.0 if is_level_only else abs(heights[-1][1] - heights[0][1] + down_m)
        return hypot(level_m[0] - north_m, level_m[1] - east_m), off_up_m, way_m


def _leap(before: StatedPlace, after: StatedPlace, slack_m: float) -> tuple[Unflown, ...]:
    seconds = (after.valid_us - before.valid_us) / 1e6
    most_m = slack_m + SPEED_M_S * seconds
    north_m, east_m = moved_m(before, after)
    if abs(north_m) + abs(east_m) <= most_m or hypot(north_m, east_m) <= most_m:
        return ()
    far_m = distance_m(before.latitude_deg, before.longitude_deg, after.latitude_deg, after.longitude_deg)
    return (Unflown("leap", f"positions that no vehicle flies: {far_m:.0f} m in {seconds:.2g} s"),)


def moved_m(before: StatedPlace, after: StatedPlace) -> tuple[float, float]:
    """North and east, of two places that are near each other."""
    east_deg = (after.longitude_deg - before.longitude_deg + 180.0) % 360.0 - 180.0
    north_m = (after.latitude_deg - before.latitude_deg) * DEGREE_M
    return north_m, east_deg * DEGREE_M * cos(radians(before.latitude_deg))


def _is_dense(moves: list[tuple[int, float, float, float]]) -> bool:
    return all(later[0] - earlier[0] <= APART_US for earlier, later in pairwise(moves))
