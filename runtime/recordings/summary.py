"""The contents of a recording of a federation: platforms, streams and their gaps, alarms, acts, and losses."""

from array import array
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from statistics import median_low
from typing import Any, Final, TypeVar

from dyknow.runtime.recordings.recorded import FederationRecording, RecordedMessage
from dyknow.runtime.recordings.recording_file import (
    ACT,
    ALARM,
    IMPORTS,
    LOST,
    MISSIONS,
    MONITOR,
    MOST_CHANNELS,
    PLATFORM,
    SAMPLE,
    TASK,
)

K = TypeVar("K")
T = TypeVar("T")
GAP_PERIODS: Final = 3
"""A gap is where the next sample is valid this number of periods later, or more."""
MOST_GAPS, MOST_CHANGES, MOST_SAMPLES = 1000, 10_000, 20_000_000
LATEST_US: Final = 253_402_300_799_000_000
"""The end of the year 9999: later instants are of no clock."""


def period_and_gaps(valid_us: Sequence[int]) -> tuple[int, list[tuple[int, int]]]:
    """The period that most samples have, 0 for none, and the valid times in order between which samples lack."""
    times = sorted(valid_us)
    steps = [after - before for before, after in pairwise(times) if after > before]
    if not steps:
        return 0, []
    period_us = round(median_low(steps))
    gaps = [(before, after) for before, after in pairwise(times) if after - before >= GAP_PERIODS * period_us]
    return period_us, gaps[:MOST_GAPS]


@dataclass(slots=True)
class StreamSummary:
    """One stream of one platform.

    Attributes:
        period_us: the median of the differences of its valid times; 0: fewer than two samples.
        gaps: valid times between which samples lack, the first thousand. A late sample is no gap.
    """

    unit: str
    label: str
    valid_us: "array[int]" = field(default_factory=lambda: array("q"))
    period_us: int = 0
    gaps: list[tuple[int, int]] = field(default_factory=list)

    @property
    def samples(self) -> int:
        return len(self.valid_us)

    @property
    def first_us(self) -> int:
        return min(self.valid_us)

    @property
    def last_us(self) -> int:
        return max(self.valid_us)

    def close(self) -> None:
        """No more comes."""
        self.period_us, self.gaps = period_and_gaps(self.valid_us)


@dataclass(slots=True)
class AlarmSummary:
    """The alarms of one monitor of one platform about the same units: how often, how long, and whether one is open."""

    monitor: str
    by: str
    units: tuple[str, ...]
    opened: int = 0
    closed: int = 0
    longest_us: int = 0
    edges: list[tuple[str, int]] = field(default_factory=list)
    _since_us: int | None = None

    def take(self, event: str, valid_us: int) -> None:
        if len(self.edges) < MOST_GAPS:
            self.edges.append((event, valid_us))
        if event == "opened":
            self.opened, self._since_us = self.opened + 1, valid_us
        elif self._since_us is not None:
            self.closed, self.longest_us = self.closed + 1, max(self.longest_us, valid_us - self._since_us)
            self._since_us = None

    @property
    def is_open(self) -> bool:
        return self._since_us is not None


@dataclass(slots=True)
class RecordingSummary:
    """See the module. Instants are federation time.

    Attributes:
        kinds: messages by schema.
        platforms: each platform's newest state.
        monitors: which there were, by name, platform and units.
        unknown: how often each monitor became unknown, by its name, platform and units.
        lost: messages that the recorder did not keep, by platform.
        unread: where the file is cut off or damaged, and how much of it is not read, in words.
    """

    about: Mapping[str, str]
    first_us: int = 0
    last_us: int = 0
    is_whole: bool = False
    unread: str = ""
    skipped: int = 0
    kinds: Counter[str] = field(default_factory=Counter)
    platforms: dict[str, str] = field(default_factory=dict)
    changes: list[tuple[int, str, str]] = field(default_factory=list)
    streams: dict[tuple[str, str], StreamSummary] = field(default_factory=dict)
    alarms: dict[tuple[str, str, tuple[str, ...]], AlarmSummary] = field(default_factory=dict)
    unknown: Counter[tuple[str, str, tuple[str, ...]]] = field(default_factory=Counter)
    acts: Counter[str] = field(default_factory=Counter)
    tasks: dict[str, str] = field(default_factory=dict)
    monitors: set[tuple[str, str, tuple[str, ...]]] = field(default_factory=set)
    lost: Counter[str] = field(default_factory=Counter)


def summary_of(recording: FederationRecording) -> RecordingSummary:
    """Read a recording once, and tell what is in it."""
    found = RecordingSummary(recording.about)
    for each in recording.messages():
        found.first_us = each.at_us if not found.kinds else min(found.first_us, each.at_us)
        found.last_us = max(found.last_us, each.at_us)
        found.kinds[each.schema] += 1
        if not _took(found, each):
            found.skipped += 1
    found.skipped += recording.skipped
    found.is_whole, found.unread = recording.is_whole, recording.unread_text
    for stream in found.streams.values():
        stream.close()
    return found


def _took(found: RecordingSummary, each: RecordedMessage) -> bool:
    """Take a message in; False if it is not as a recorder writes it, or of one thing more than a summary lists."""
    takes = _TAKES.get(each.schema)
    if takes is None:
        return each.schema in {IMPORTS, MISSIONS} or not each.schema.startswith("dyknow.")
    valid_us = each.message.get("valid_us", 0)
    return isinstance(valid_us, int) and 0 <= valid_us <= LATEST_US and takes(found, each)


def _on_sample(found: RecordingSummary, each: RecordedMessage) -> bool:
    match each.message:
        case {"unit": str(unit), "label": str(label), "valid_us": int(valid_us)} if found.kinds[SAMPLE] <= MOST_SAMPLES:
            return _in(
                found.streams,
                (unit, label),
                lambda: StreamSummary(unit, label),
                lambda one: one.valid_us.append(valid_us),
            )
    return False


def _on_alarm(found: RecordingSummary, each: RecordedMessage) -> bool:
    match each.message:
        case {
            "monitor": str(name),
            "by": str(by),
            "event": str(event),
            "units": list(about),
            "valid_us": int(valid_us),
        }:
            key = name, by, tuple(map(str, about))
            return _in(found.alarms, key, lambda: AlarmSummary(*key), lambda one: one.take(event, valid_us))
    return False


def _on_monitor(found: RecordingSummary, each: RecordedMessage) -> bool:
    match each.message:
        case {"monitor": str(name), "by": str(by), "units": list(about), **rest}:
            key = name, by, tuple(map(str, about))
            if len(found.monitors) < MOST_CHANNELS:
                found.monitors.add(key)
            if rest.get("change") == "unknown" and (key in found.unknown or len(found.unknown) < MOST_CHANNELS):
                found.unknown[key] += 1
            return True
    return False


def _on_platform(found: RecordingSummary, each: RecordedMessage) -> bool:
    match each.message:
        case {"unit": str(unit), "state": str(state)} if (
            unit in found.platforms or len(found.platforms) < MOST_CHANNELS
        ):
            if found.platforms.get(unit) != state and len(found.changes) < MOST_CHANGES:
                found.changes.append((each.at_us, unit, state))
            found.platforms[unit] = state
            return True
    return False


def _on_act(found: RecordingSummary, each: RecordedMessage) -> bool:
    match each.message:
        case {"by": str(), "outcome": str(outcome)} if outcome in found.acts or len(found.acts) < MOST_CHANNELS:
            found.acts[outcome] += 1
            return True
    return False


def _on_task(found: RecordingSummary, each: RecordedMessage) -> bool:
    match each.message:
        case {"conversation": str(name), "task": str(task), "unit": str(unit), "state": str(state)}:
            if name in found.tasks or len(found.tasks) < MOST_CHANNELS:
                found.tasks[name] = f"{task} of {unit}: {state}"
            return True
    return False


def _on_lost(found: RecordingSummary, each: RecordedMessage) -> bool:
    match each.message:
        case {"unit": str(unit), "messages": int(messages)} if unit in found.lost or len(found.lost) < MOST_CHANNELS:
            found.lost[unit] += messages
            return True
    return False


def _in(found: dict[K, T], key: K, make: Callable[[], T], take: Callable[[T], None]) -> bool:
    """Have the entry of `key` take something; False where it would be one too many."""
    if key not in found:
        if len(found) >= MOST_CHANNELS:
            return False
        found[key] = make()
    take(found[key])
    return True


_TAKES: Final[Mapping[str, Callable[[RecordingSummary, RecordedMessage], bool]]] = {
    SAMPLE: _on_sample, ALARM: _on_alarm, MONITOR: _on_monitor, PLATFORM: _on_platform, ACT: _on_act, TASK: _on_task,
    LOST: _on_lost,
}  # fmt: skip


def about_of(federation: str, clock: Any, recorder: str, since_us: int) -> dict[str, str]:
    """The metadata of a recording."""
    return {
        "federation": federation,
        "clock_epoch_us": str(clock.epoch_us),
        "clock_speed": str(clock.speed),
        "recorder": recorder,
        "since_us": str(since_us),
    }
