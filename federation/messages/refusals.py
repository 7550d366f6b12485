"""Refusals of a member's acts: a quota of them is sent, beyond it acts are left unanswered, which is counted and shown.

A refusal is signed, put, and put again until it is acknowledged: it costs more than the act that it answers. Times are the node clock.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

from dyknow import earlier
from dyknow.federation.shares import ActLimits, MemberShare

REFUSALS_PER_S, REFUSALS_BURST = 20.0, 64.0
"""Not less than the acts that are let in: each of those may be refused in words."""
QUIET_US: Final = 60_000_000
MOST: Final = 64
"""Members that are remembered as left without an answer."""


@dataclass(slots=True)
class UnansweredActs:
    """Acts of one member that were not answered: how many, since when, and the last of them."""

    since_us: int
    last_us: int
    count: int = 0

    @property
    def how(self) -> str:
        """In words that change seldom."""
        return f"{10 ** (len(str(self.count)) - 1)} acts or more"


class ShownSilence(NamedTuple):
    text: str
    since_us: int


class Refusals:
    """Of one platform. `share_of`: the member behind a name, and its shares.

    Attributes:
        unanswered: by member.
        is_news: whether `shown` has changed since this was reset.
    """

    def __init__(self, share_of: Callable[[str], MemberShare]) -> None:
        self._share_of, self._limits = share_of, ActLimits(REFUSALS_PER_S, REFUSALS_BURST)
        self.unanswered: dict[str, UnansweredActs] = {}
        self.is_news = False

    def admit(self, unit: str, now_us: int) -> bool:
        """Whether one more act of a unit is answered by a refusal; if not, that is counted."""
        owner, shares = self._share_of(unit)
        if self._limits.admit(owner, now_us, 1 / shares):
            return True
        found = self.unanswered.pop(owner, None)
        self.is_news |= found is None
        found = self.unanswered[owner] = found or UnansweredActs(now_us, now_us)
        before, found.count, found.last_us = found.how, found.count + 1, now_us
        self.is_news |= before != found.how
        if len(self.unanswered) > MOST:
            del self.unanswered[next(iter(self.unanswered))]
        return False

    def shown(self) -> Iterator[ShownSilence]:
        for owner, each in self.unanswered.items():
            yield ShownSilence(f"too much is refused to {owner}: {each.how} without an answer", each.since_us)

    @property
    def deadline_us(self) -> int | None:
        due_us: int | None = None
        for each in self.unanswered.values():
            due_us = earlier(due_us, each.last_us + QUIET_US)
        return due_us

    def on_time(self, now_us: int) -> None:
        """A member that was quiet for a minute is shown no longer."""
        for owner in [owner for owner, each in self.unanswered.items() if each.last_us + QUIET_US <= now_us]:
            del self.unanswered[owner]
            self.is_news = True
