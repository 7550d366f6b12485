"""The tracks of all members, with their reports of the last seconds."""

from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from dyknow import US_PER_S
from dyknow.anchoring.cooperation.reports import FASTEST_M_S, MOST_TRACKS, ReportGate, TrackKey, TrackReport, sound
from dyknow.anchoring.links.states import ObjectState, moved

KEPT: Final = 48
"""Reports of a track that are kept."""
FRESH_US: Final = 500_000
"""How far a report is moved to another time as evidence."""
LIVE_US: Final = 1_500_000
"""A track is live while it was seen so recently."""
DORMANT_US: Final = 120 * US_PER_S
"""A track that is not seen is kept so long."""
NOISE: Final = 4.0
"""Of the acceleration, m^2/s^3."""
COURSE_S: Final = 0.8
COURSE_NOISE: Final = 0.5
"""Of the acceleration of what drives on, m^2/s^3."""
GAP_US: Final = US_PER_S
"""After a longer gap a track may be of another object."""
BREAK_US: Final = 1_500_000
BREAK: Final = 32.0
"""Above every d^2 that cars came to, turning within `BREAK_US`; two that meet and are mistaken for each other come to 50."""
_SLACK_M: Final = 20.0


@dataclass(slots=True, eq=False)
class Track:
    """One track of one member.

    Attributes:
        first_us, seen_us: when it was seen first and last; 0: never.
        steady_us: since when it is one thing as far as is known: there was no gap, and no turn that vehicles cannot make.
        seen: states that were seen, in the order of time.
    """

    key: TrackKey
    seen: deque[ObjectState] = field(default_factory=lambda: deque(maxlen=KEPT))
    latest: ObjectState | None = None
    first_us: int = 0
    seen_us: int = 0
    steady_us: int = 0
    has_ended: bool = False

    def take(self, report: TrackReport) -> None:
        """Take a report that is later than those before."""
        state = sound(report.state)
        self.latest = state
        if report.is_anchored:
            if state.valid_us - self.seen_us > GAP_US:
                self.steady_us = state.valid_us
            self.seen.append(state)
            self.first_us = self.first_us or state.valid_us
            self.seen_us = state.valid_us

    def is_live(self, at_us: int) -> bool:
        """Whether it was seen shortly before."""
        return not self.has_ended and bool(self.seen_us) and at_us - self.seen_us <= LIVE_US

    def check_course(self) -> bool:
        """Whether it is where what was seen `BREAK_US` before cannot have got: it is steady from now on only."""
        latest = self.seen[-1]
        before_us = latest.valid_us - BREAK_US
        before = next((each for each in reversed(self.seen) if each.valid_us <= before_us), None)
        if before is None or before_us < self.steady_us:
            return False
        expected = moved(before, latest.valid_us, NOISE)
        between = np.array([latest.x_m - expected.x_m, latest.y_m - expected.y_m])
        total = (latest.covariance + expected.covariance)[:2, :2]
        if float(between @ np.linalg.solve(total, between)) <= BREAK:
            return False
        self.steady_us = latest.valid_us
        return True

    @property
    def course(self) -> ObjectState | None:
        """The first of the states that are kept, with the mean velocity since then, which is surer than that of one state."""
        if not self.seen:
            return None
        first, last = self.seen[0], self.seen[-1]
        seconds = (last.valid_us - first.valid_us) / US_PER_S
        if seconds < COURSE_S:
            return last
        covariance = first.covariance.copy()
        covariance[2:, :2], covariance[:2, 2:] = 0.0, 0.0
        covariance[2:, 2:] = (first.covariance[:2, :2] + last.covariance[:2, :2]) / seconds**2
        covariance[2:, 2:] += COURSE_NOISE * seconds / 3.0 * np.eye(2)
        velocity = (last.x_m - first.x_m) / seconds, (last.y_m - first.y_m) / seconds
        return first._replace(vx_m_s=velocity[0], vy_m_s=velocity[1], covariance=covariance)

    def at(self, at_us: int) -> ObjectState | None:
        """The state at a time, predicted from the one just before; None: there is none."""
        for state in reversed(self.seen):
            if state.valid_us <= at_us:
                return moved(state, at_us, NOISE) if at_us - state.valid_us <= FRESH_US else None
        return None


class Tracks:
    """All tracks, within bounds for each member.

    Attributes:
        late: how many reports came after a later one, by member.
    """

    def __init__(self, gate: ReportGate) -> None:
        self._gate = gate
        self._of: dict[str, dict[TrackKey, Track]] = {}
        self._lives: dict[str, int] = {}
        self.late = Counter[str]()

    def units(self) -> list[str]:
        """The members that have tracks, sorted."""
        return sorted(unit for unit, tracks in self._of.items() if tracks)

    def of(self, unit: str) -> dict[TrackKey, Track]:
        """The tracks of one member."""
        return self._of.get(unit, {})

    def __iter__(self) -> Iterator[Track]:
        return (track for unit in sorted(self._of) for track in self._of[unit].values())

    def key(self, unit: str, symbol: str) -> TrackKey:
        """The key of a track of a member that runs now."""
        return TrackKey(unit, symbol, self._lives.get(unit, 0))

    def get(self, key: TrackKey) -> Track | None:
        return self._of.get(key.unit, {}).get(key)

    def restart(self, unit: str) -> None:
        """The member began again: its symbols mean other tracks from now on."""
        self._lives[unit] = self._lives.get(unit, 0) + 1

    def take(self, report: TrackReport, now_us: int) -> Track | None:
        """Take a report if it can be; None: it was refused."""
        if not self._gate.passes(report, now_us):
            return None
        key = self.key(report.unit, report.symbol)
        tracks = self._of.setdefault(report.unit, {})
        track = tracks.get(key)
        if report.has_ended:
            if track is not None:
                track.has_ended = True
            return track
        before = None if track is None else track.latest
        if before is not None and report.state.valid_us <= before.valid_us:
            self.late[report.unit] += 1
            return None
        if before is not None and _leaps(before, report.state):
            self._gate.refuse(report.unit, "a leap")
            return None
        if track is None:
            if len(tracks) >= MOST_TRACKS and not self._make_room(tracks, now_us):
                self._gate.refuse(report.unit, "too many tracks")
                return None
            track = tracks[key] = Track(key)
        track.has_ended = False
        track.take(report)
        return track

    def forget(self, now_us: int) -> list[TrackKey]:
        """Remove tracks that were not seen for long; tracks that were never seen end sooner."""
        gone: list[TrackKey] = []
        for tracks in self._of.values():
            for key, track in tuple(tracks.items()):
                latest_us = track.seen_us or (0 if track.latest is None else track.latest.valid_us)
                if now_us - latest_us > (DORMANT_US if track.seen_us else LIVE_US):
                    del tracks[key]
                    gone.append(key)
        return gone

    def _make_room(self, tracks: dict[TrackKey, Track], now_us: int) -> bool:
        """Remove the track of a member that was not seen for longest, if it is not live."""
        oldest = min(tracks.values(), key=lambda each: each.seen_us)
        if oldest.is_live(now_us):
            return False
        del tracks[oldest.key]
        return True


def _leaps(before: ObjectState, after: ObjectState) -> bool:
    """Whether nothing could have got from one place to the other in the time between."""
    seconds = (after.valid_us - before.valid_us) / US_PER_S
    return before.distance_m(after) > _SLACK_M + 3.0 * before.deviation_m + FASTEST_M_S * seconds
