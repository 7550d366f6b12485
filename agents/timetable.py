"""When a platform has work next: the earliest deadline of its parts."""

from collections.abc import Sequence
from typing import Protocol

from federation.clock import FederationClock


class Timed(Protocol):
    """A part that is stepped by time."""

    @property
    def deadline_us(self) -> int | None: ...


class Timetable:
    """The deadlines of parts, in node time or in federation time.

    Finding the earliest of all is dear and most events change few, so what an event can have made earlier is
    compared (`hasten`), and all are looked at only when the time that is known has come: a deadline that has moved
    away costs one look too many.
    """

    def __init__(self, clock: FederationClock, parts: Sequence[Timed], federation_parts: Sequence[Timed]) -> None:
        self._clock, self._parts, self._federation_parts = clock, parts, federation_parts
        self.due_us: int | None = None

    def forget(self) -> None:
        """Everything may have changed."""
        self.due_us = None

    def hasten(self, part: Timed) -> None:
        """`part`, in node time, may be due earlier than it was."""
        due_us, known_us = part.deadline_us, self.due_us
        if due_us is not None and known_us is not None and due_us < known_us:
            self.due_us = due_us

    def hasten_federation(self, part: Timed) -> None:
        """`part`, in federation time, may be due earlier than it was."""
        due_us, known_us = part.deadline_us, self.due_us
        if due_us is not None and known_us is not None and (due_us := self._clock.wall_us(due_us)) < known_us:
            self.due_us = due_us

    def earliest_us(self, else_us: int) -> int:
        """The earliest of all; `else_us` when that is sooner."""
        found_us = else_us
        for part in self._parts:
            due_us = part.deadline_us
            if due_us is not None and due_us < found_us:
                found_us = due_us
        for part in self._federation_parts:
            due_us = part.deadline_us
            if due_us is not None:
                found_us = min(found_us, self._clock.wall_us(due_us))
        return found_us
