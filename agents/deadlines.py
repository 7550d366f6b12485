"""When the parts of a platform have work next, and which of them are due."""

from collections.abc import Iterator, Sequence
from typing import Final

from dyknow.agents.containment import Containment
from dyknow.agents.part import Followed, Part, Within

NEVER_US: Final = 1 << 62


class PartDeadlines:
    """The deadlines of parts (node clock), in the order of the parts.

    To ask every part is dear, and most steps change few deadlines: a deadline is asked for again only after a step that
    may have changed it, which is one that names the part or may have changed anything. So few are known at once that the
    least of a list is found sooner than a heap is kept.

    Attributes:
        due_us: the earliest, as far as it is known, or earlier; None when it has to be found.
    """

    def __init__(self, parts: Sequence[Part], containment: Containment) -> None:
        self._parts, self._containment = tuple(parts), containment
        self._place = {part: at for at, part in enumerate(self._parts)}
        self._due_us = [NEVER_US] * len(self._parts)
        self._asked = [0] * len(self._parts)
        self._change = 1
        self.due_us: int | None = None

    def forget(self) -> None:
        """Forget all deadlines: any of them may have changed."""
        self._change += 1
        self.due_us = None

    def hasten(self, followed: Followed) -> None:
        """The deadlines of these may have changed; None: of any part."""
        if followed is None:
            self.forget()
            return
        place, containment, earliest_us = self._place, self._containment, self.due_us
        for each in followed:
            part, timed = each if isinstance(each, Within) else (each, each)
            at = place.get(part)
            if at is None:
                continue
            try:
                due_us = timed.deadline_us
            except Exception:  # noqa: BLE001  (contained)
                due_us = containment.due_us(part)
            if part in containment.paused_us:
                due_us = containment.due_us(part)
            found_us = NEVER_US if due_us is None else due_us
            if part is timed:
                self._due_us[at], self._asked[at] = found_us, self._change
            elif found_us < self._due_us[at]:
                self._due_us[at] = found_us
            if earliest_us is not None and found_us < earliest_us:
                self.due_us = earliest_us = found_us

    def due(self, now_us: int) -> Iterator[Part]:
        """The parts that are due by now, in their order; a part that an earlier one has made due is among them."""
        for at, part in enumerate(self._parts):
            if self._asked[at] != self._change:
                self.hasten((part,))
            if self._due_us[at] <= now_us:
                yield part
                self._asked[at] = 0
        self.due_us = None

    def earliest_us(self, now_us: int) -> int:
        """The earliest of all, `now_us` for one that is overdue.

        Raises:
            LookupError: no part is ever due.
        """
        if self.due_us is None:
            change = self._change
            self.hasten([part for part, asked in zip(self._parts, self._asked, strict=True) if asked != change])
            self.due_us = min(self._due_us, default=NEVER_US)
        if self.due_us == NEVER_US:
            raise LookupError("no part of this platform has a deadline")
        return max(now_us, self.due_us)
