"""Journals of our own nodes (.mcap) as recordings: a vehicle's reports, at the time they reached its platform."""

from collections.abc import Iterator, Mapping
from pathlib import Path

from dyknow.agents.effects import Reported
from dyknow.federation.members.clock import FederationClock
from dyknow.model.errors import DecodeError
from dyknow.model.instants import LATEST_US
from dyknow.navigation.vehicle import CommandResult, Report
from dyknow.proxies.recordings.journal_file import (
    CLOCK_EPOCH,
    CLOCK_SPEED,
    REMEDY,
    Lost,
    Stepped,
    read_about,
    read_journal,
)
from dyknow.proxies.recordings.mcap_records import Unread
from dyknow.proxies.recordings.recording import Recording

SLOWEST, FASTEST = 1e-6, 1e3
"""Speeds of a clock."""


class JournalRecording(Recording):
    """The flight that a node's journal holds. Its times are the federation time it was flown in.

    Answers to the commands of the time are left out: these commands are not given again.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._clock = recorded_clock(path, read_about(path))

    def reports(self) -> Iterator[tuple[int, Report]]:
        for entry in read_journal(self.path):
            if isinstance(entry, Unread):
                self.note(entry.offset, f"{entry.why}; {entry.size} bytes from there to the end are not read")
            elif isinstance(entry, Lost):
                self.note(0, f"{entry.entries} entries were lost while it was written")
            elif isinstance(entry, Stepped) and isinstance(entry.event, Reported):
                report = entry.event.report
                if not isinstance(report, CommandResult):
                    yield self._clock.federation_us(entry.now_us), report


def recorded_clock(path: Path, about: Mapping[str, str]) -> FederationClock:
    """The federation's clock, by which the reports are valid; entries have the node's.

    Raises:
        DecodeError: the journal does not tell it.
    """
    try:
        epoch_us, speed = int(about[CLOCK_EPOCH]), float(about[CLOCK_SPEED])
    except (KeyError, ValueError) as wrong:
        raise DecodeError("journal", f"{path}: does not tell its federation's clock ({wrong}); {REMEDY}") from None
    if abs(epoch_us) > LATEST_US or not SLOWEST <= speed <= FASTEST:
        raise DecodeError("journal", f"{path}: no clock has the epoch or the speed that it tells; {REMEDY}")
    return FederationClock(epoch_us, speed)
