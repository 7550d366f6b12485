"""The pictures of a recording, at the time that a viewer has chosen."""

from bisect import bisect_right
from collections.abc import Mapping
from typing import Any, Final, Protocol

from dyknow.console.picture.picture import Picture
from dyknow.console.picture.rows import LONGEST, instant, number
from dyknow.console.web.views import PageView, Past
from dyknow.model.errors import DecodeError
from dyknow.runtime.recordings.recorded import FederationRecording
from dyknow.runtime.recordings.recording_file import ALARM

KEYFRAME_US: Final = 5_000_000
MOST_MESSAGES: Final = 3_000_000
MOST_MARKS: Final = 1000
SLOWEST, FASTEST = 0.05, 100.0
SHOWN_TOPICS: Final = frozenset(
    {"/alarms", "/monitors", "/acts", "/tasks", "/imports", "/missions", "/flights", "/directory", "/log", "/lost"}
)


class RecordedFeed:
    """A recording in memory: its messages, and the picture every five seconds of it.

    `load` reads it, in a thread of its own; the part read so far can be looked at.
    """

    def __init__(self, recording: FederationRecording, origin: tuple[float, float] | None) -> None:
        self.recording, self.is_loaded = recording, False
        self._times: list[int] = []
        self._messages: list[tuple[str, Mapping[str, Any]]] = []
        self._frames: list[tuple[int, Picture]] = [(0, Picture(origin))]
        self._frame_us: list[int] = [0]
        self._open_us: dict[str, int] = {}
        self.marks: list[tuple[int, int | None]] = []

    def load(self) -> str:
        """Read all messages that are shown; returns the damage in words, or an empty text."""
        try:
            self._read()
            problem = self.recording.unread_text
        except DecodeError as damage:
            problem = str(damage)
        self.marks += [(opened_us, None) for opened_us in self._open_us.values()]
        self.is_loaded = True
        return problem

    def _read(self) -> None:
        picture, frame_us = self._frames[0][1].copy(), 0
        for each in self.recording.messages(lambda topic: topic in SHOWN_TOPICS or topic.count("/") == 2):
            if each.topic.endswith(("/fix", "/pose")) or len(self._times) >= MOST_MESSAGES:
                continue
            at_us = max(each.at_us, self._times[-1] if self._times else 0)
            if at_us - frame_us >= KEYFRAME_US:
                frame_us = at_us
                self._frames.append((len(self._times), picture.copy()))
                self._frame_us.append(at_us)
            picture.take(at_us, each.schema, each.message)
            if each.schema == ALARM:
                self._mark(at_us, each.message)
            self._messages.append((each.schema, each.message))
            self._times.append(at_us)

    def _mark(self, at_us: int, alarm: Mapping[str, Any]) -> None:
        """When an alarm was open, for the slider."""
        name = str(alarm.get("id"))[:LONGEST]
        if alarm.get("event") == "opened":
            self._open_us.setdefault(name, at_us)
        elif name in self._open_us and len(self.marks) < MOST_MARKS:
            self.marks.append((self._open_us.pop(name), at_us))

    @property
    def span_us(self) -> tuple[int, int]:
        """From when to when there is something."""
        return (self._times[0], self._times[-1]) if self._times else (0, 0)

    def frame_before(self, at_us: int) -> tuple[int, Picture]:
        """The number of messages that the nearest picture before has taken, and a copy of it."""
        count, picture = self._frames[bisect_right(self._frame_us, at_us) - 1]
        return count, picture.copy()

    def take_until(self, picture: Picture, count: int, at_us: int) -> int:
        """Step a picture that has taken `count` messages to a time; how many it has then."""
        end = bisect_right(self._times, at_us)
        for index in range(count, end):
            schema, message = self._messages[index]
            picture.take(self._times[index], schema, message)
        return max(count, end)


class RecordingViewer:
    """One viewer of a recording: at a time, which stands still or runs.

    Args:
        feed: the recording.
        clock: seconds that pass.
    """

    def __init__(self, feed: RecordedFeed, clock: "PageClock") -> None:
        self._feed, self._clock = feed, clock
        self._speed, self._is_playing = 1.0, False
        self._at_us: int | None = None
        self._since_s = clock()
        self._count, self._picture = feed.frame_before(0)
        self._shown_us = self._run = 0

    def look(self) -> PageView:
        """The picture at the time that this viewer is at."""
        at_us = self._now_us()
        if at_us < self._shown_us or at_us - self._shown_us > 2 * KEYFRAME_US:
            self._count, self._picture = self._feed.frame_before(at_us)
            self._run += 1
        self._count = self._feed.take_until(self._picture, self._count, at_us)
        self._shown_us = at_us
        return PageView(at_us, self._picture.sections(), self._run)

    def past(self) -> Past:
        """Of the minutes before."""
        return Past(self._picture.trails(), self._picture.curves())

    def _now_us(self) -> int:
        first_us, last_us = self._feed.span_us
        now_s = self._clock()
        passed_us = round((now_s - self._since_s) * 1e6 * self._speed) if self._is_playing else 0
        self._since_s = now_s
        self._at_us = min(max((first_us if self._at_us is None else self._at_us) + passed_us, first_us), last_us)
        return self._at_us

    def steer(self, action: Mapping[str, Any]) -> None:
        """Take the viewer's controls: `at_us`, `speed`, `play`."""
        self._now_us()
        speed, at_us = number(action.get("speed")), instant(action.get("at_us"))
        if speed is not None and SLOWEST <= speed <= FASTEST:
            self._speed = speed
        if isinstance(action.get("play"), bool):
            self._is_playing = action["play"]
        if at_us is not None:
            self._at_us = at_us
            self._run += 1

    def about(self) -> dict[str, Any]:
        """The page's facts about the whole."""
        first_us, last_us = self._feed.span_us
        return {
            "federation": self._feed.recording.about.get("federation", ""),
            "live": False,
            "origin": self._picture.base,
            "first_us": first_us,
            "last_us": last_us,
            "loaded": self._feed.is_loaded,
            "playing": self._is_playing,
            "speed": self._speed,
            "file": self._feed.recording.path.name,
            "marks": self._feed.marks if self._feed.is_loaded else [],
        }


class PageClock(Protocol):
    """Seconds, from any beginning."""

    def __call__(self) -> float: ...
