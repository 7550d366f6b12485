"""Instants of a network: what one push brings forth is one element of every join (Def. 4.3.16, 4.5.8).

A unit with several inputs is called once they all have what the instant brings, however many of them go back to one
source and over how many units: units upstream come first. What a worker makes of it comes in a later instant.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from dyknow.model.sample import Sample


class Joining(Protocol):
    """A unit that waits until all of its inputs have come."""

    @property
    def rank(self) -> int:
        """How many units, at most, lie between a source and what it makes."""

    def on_instant(self) -> None:
        """All that this instant brings has come."""


class Instant:
    """The present instant of one network.

    Attributes:
        joins: how many units with several inputs are at work; without one nothing waits.
        is_open: whether more may come.
    """

    __slots__ = ("_waiting", "is_open", "joins")

    def __init__(self) -> None:
        self._waiting: dict[Joining, int] = {}
        self.joins = 0
        self.is_open = False

    def put(self, unit: Joining) -> None:
        """Call the unit when all has come; at once outside an instant."""
        if not self.is_open:
            unit.on_instant()
        elif unit not in self._waiting:
            self._waiting[unit] = unit.rank

    def close(self) -> None:
        """All has come from outside: call what waits, upstream first."""
        waiting = self._waiting
        try:
            while waiting:
                unit = min(waiting, key=waiting.__getitem__)
                del waiting[unit]
                unit.on_instant()
        finally:
            self.is_open = False

    @contextmanager
    def whole(self) -> Iterator[None]:
        """Several pushes are one instant."""
        if self.is_open:
            yield
            return
        self.is_open = True
        try:
            yield
        finally:
            self.close()


class JoinElements:
    """Elements of a join that were not taken yet: the n-th sample that an instant brings of an input is in the n-th."""

    __slots__ = ("_elements",)

    def __init__(self) -> None:
        self._elements: list[dict[int, Sample]] = []

    def put(self, i: int, sample: Sample) -> None:
        for element in self._elements:
            if i not in element:
                element[i] = sample
                return
        self._elements.append({i: sample})

    def take(self) -> list[dict[int, Sample]]:
        taken, self._elements = self._elements, []
        return taken
