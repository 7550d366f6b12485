"""Journals of our own nodes (.mcap) as recordings: what a vehicle reported to its platform, when it came there."""

from collections.abc import Iterator
from pathlib import Path

from agents.effects import Reported
from dyknow.model.errors import DecodeError, PolicyError
from federation.members.clock import FederationClock
from navigation.vehicle import CommandResult, Report
from proxies.recordings.journal_file import CLOCK_EPOCH, CLOCK_SPEED, Lost, Stepped, read_about, read_journal
from proxies.recordings.recording import Recording


class JournalRecording(Recording):
    """The flight that a node's journal holds. Its times are the federation time it was flown in.

    Answers to the commands of the time are left out: these commands are not given again.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._clock = _clock(path)

    def reports(self) -> Iterator[tuple[int, Report]]:
        for entry in read_journal(self.path):
            if isinstance(entry, Lost):
                self.note(0, f"{entry.entries} entries were lost while it was written")
            elif isinstance(entry, Stepped) and isinstance(entry.event, Reported):
                report = entry.event.report
                if not isinstance(report, CommandResult):
                    yield self._clock.federation_us(entry.now_us), report


def _clock(path: Path) -> FederationClock:
    """The federation's clock, by which the reports are valid; entries have the node's."""
    about = read_about(path)
    try:
        return FederationClock(int(about[CLOCK_EPOCH]), float(about[CLOCK_SPEED]))
    except (KeyError, ValueError, PolicyError) as wrong:
        raise DecodeError("recording", f"{path}: does not tell its federation's clock ({wrong})") from None
