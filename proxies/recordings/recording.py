"""Recorded flights as reports: the common interface of all formats.

Reports are read as they are asked for. Bytes that cannot be read are passed over where the format lets us find the next
record, and named in `problems`; where it does not, reading ends with a `DecodeError` after everything before the damage.
"""

import mmap
from abc import ABC, abstractmethod
from collections.abc import Iterator
from pathlib import Path

from dyknow.model.errors import DecodeError
from dyknow.navigation.vehicle import PositionReport, Report

_MOST_PROBLEMS = 20


class Recording(ABC):
    """One recorded flight of one vehicle.

    `reports` yields (record_us, report) in file order; both times count from the Unix epoch by the recording's clock.
    A last record that is cut off, as after a loss of power, ends the reports and is named in `problems`.
    """

    reference: str | None = None
    """The source whose first position is the recording's first; None: any."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.problems: list[str] = []
        self._first_position_us: int | None = None

    @abstractmethod
    def reports(self) -> Iterator[tuple[int, Report]]:
        """From the beginning, each time it is called."""

    @property
    def first_position_us(self) -> int:
        """Valid time of the first position. Read until there, once.

        Raises:
            DecodeError: there is none.
        """
        if self._first_position_us is None:
            for _, report in self.reports():
                if isinstance(report, PositionReport) and self.reference in {None, report.source}:
                    self._first_position_us = report.valid_us
                    break
            else:
                raise self.damage(0, "holds no position", "is it a flight log, from a vehicle with a satellite fix?")
            self.problems.clear()
        return self._first_position_us

    def lasting_us(self, enough_us: int) -> int:
        """How long reports continue after the first position; read until that is `enough_us`, and no further.

        Raises:
            DecodeError: it is damaged before.
        """
        lasting_us = 0
        for record_us, _ in self.reports():
            lasting_us = max(lasting_us, record_us - self.first_position_us)
            if lasting_us >= enough_us:
                break
        return lasting_us

    def damage(self, offset: int, cause: str, remedy: str = "the flight up to there can be replayed") -> DecodeError:
        return DecodeError("recording", f"{self.path}, byte {offset}: {cause}; {remedy}")

    def note(self, offset: int, cause: str) -> None:
        """Remember damage that did not end the reading."""
        if len(self.problems) < _MOST_PROBLEMS:
            self.problems.append(f"{self.path}, byte {offset}: {cause}")

    def bytes(self) -> mmap.mmap:
        """The file, mapped: pages are read when touched and given back by the system.

        Raises:
            DecodeError: it is empty.
        """
        with self.path.open("rb") as file:
            if not self.path.stat().st_size:
                raise self.damage(0, "the file is empty", "was the download or the copy finished?")
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
