"""Audit log of speech acts: every act that enters or leaves a platform, and its outcome (thesis 9.3.2)."""

from collections import Counter, deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final, Literal, NamedTuple

from dyknow.federation.members.correspondence import UNANSWERED
from dyknow.federation.messages.acts import Act

Direction = Literal["in", "out"]
RECORDED: Final = "recorded"
"""How the outcome of an act begins that a recording has, and that is only played."""
_NO_REFUSALS = frozenset({"accepted", RECORDED})


class AuditEntry(NamedTuple):
    """One act as it passed the Interface Agent; `act` is None for bytes that were no act (`outcome` says why)."""

    number: int
    at_us: int
    direction: Direction
    peer: str
    act: Act | None
    outcome: str


class AuditLog:
    """The last `capacity` acts, and counters over all of them."""

    def __init__(self, capacity: int = 1000) -> None:
        self.entries: deque[AuditEntry] = deque(maxlen=capacity)
        self.counts: Counter[tuple[Direction, str]] = Counter()
        self._listeners: list[Callable[[AuditEntry], None]] = []
        self._number = 0
        self._held: list[tuple[int, Direction, str, Act | None, str]] | None = None

    def subscribe(self, listener: Callable[[AuditEntry], None]) -> None:
        """Have `listener` called with every entry from now on."""
        self._listeners.append(listener)

    def enter(self, at_us: int, direction: Direction, peer: str, act: Act | None, outcome: str) -> None:
        """Note one act. `outcome` is `accepted`, `sent`, or the reason why it was dropped; acts left unanswered are counted and not listed."""
        if self._held is not None:
            self._held.append((at_us, direction, peer, act, outcome))
            return
        if outcome == UNANSWERED:
            self.counts[direction, outcome] += 1
            return
        self._number += 1
        entry = AuditEntry(self._number, at_us, direction, peer, act, outcome)
        self.entries.append(entry)
        self.counts[direction, outcome.split(":", 1)[0]] += 1
        for listener in self._listeners:
            listener(entry)

    @contextmanager
    def on_arrival(self, at_us: int, act: Act) -> Iterator[Callable[[str], None]]:
        """Log an act before all acts that follow from it; the yielded function takes its outcome (default: accepted)."""
        held = self._held = []
        outcomes = ["accepted"]
        try:
            yield outcomes.append
        finally:
            self._held = None
            self.enter(at_us, "in", act.sender.unit, act, outcomes[-1])
            for entry in held:
                self.enter(*entry)

    @property
    def refused(self) -> Counter[str]:
        """How many incoming acts were not accepted, by reason."""
        return Counter(
            {reason: n for (way, reason), n in self.counts.items() if way == "in" and reason not in _NO_REFUSALS}
        )
