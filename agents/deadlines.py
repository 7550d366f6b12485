"""When a platform has work next: the earliest deadline of its parts."""

from collections.abc import Callable, Sequence

from agents.part import Part, Timed


class EarliestDeadline:
    """The deadlines of parts (node clock).

    Finding the earliest of all is dear and most events change few, so what an event can have made earlier is
    compared (`hasten`), and all are looked at only when the time that is known has come: a deadline that has moved
    away costs one look too many.

    Attributes:
        due_us: the earliest, as far as it is known; None when everything may have changed.
    """

    def __init__(self, parts: Sequence[Part], due_of: Callable[[Timed], int | None]) -> None:
        self._parts, self._due_of = parts, due_of
        self.due_us: int | None = None

    def forget(self) -> None:
        """Everything may have changed."""
        self.due_us = None

    def hasten(self, timed: Sequence[Timed]) -> None:
        """These may be due earlier than they were."""
        known_us = self.due_us
        if known_us is not None:
            for each in timed:
                try:
                    due_us = each.deadline_us
                except Exception:  # noqa: BLE001  (contained)
                    due_us = self._due_of(each)
                if due_us is not None and due_us < known_us:
                    self.due_us = known_us = due_us

    def earliest_us(self, now_us: int) -> int:
        """The earliest of all, `now_us` for what is overdue.

        Raises:
            LookupError: no part is ever due.
        """
        found_us = self.due_us
        if found_us is None:
            for part in self._parts:
                due_us = self._due_of(part)
                if due_us is not None and (found_us is None or due_us < found_us):
                    found_us = due_us
                    if due_us <= now_us:
                        break
            if found_us is None:
                raise LookupError("no part of this platform has a deadline")
            self.due_us = found_us
        return max(now_us, found_us)
