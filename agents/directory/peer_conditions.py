"""Conditions about peers that others contradict, or whose clock differs from the federation's.

They are only shown to users: the word of a single peer changes no platform's behaviour. Times are the node clock.
"""

from collections.abc import Iterable

from dyknow.federation.members.clock import Standing
from dyknow.federation.members.member import Member
from dyknow.federation.messages.descriptions import ConditionEntry

MOST = 8
"""Peers whose clocks are shown."""


class PeerConditions:
    """The conditions about peers, kept up to date by `look`."""

    def __init__(self, member: Member) -> None:
        self._member = member
        self._skewed_us: dict[str, int] = {}
        self._shown: tuple[tuple[str, int], ...] = ()

    def on_clock(self, unit: str, now_us: int) -> None:
        """The clock of a peer was compared."""
        offset = self._member.offsets.of(unit)
        if offset is None or offset.standing is not Standing.SKEWED:
            self._skewed_us.pop(unit, None)
        else:
            self._skewed_us.setdefault(unit, now_us)
            if len(self._skewed_us) > MOST:
                del self._skewed_us[next(iter(self._skewed_us))]

    def on_gone(self, unit: str) -> None:
        self._skewed_us.pop(unit, None)

    def look(self) -> bool:
        """Whether what is shown has changed since the last look."""
        found = [(one.text, one.since_us) for one in self._member.directory.contradicted]
        for unit, since_us in self._skewed_us.items():
            found.append((f"the clock of {unit} is not the federation's: its samples are not taken", since_us))
        if [text for text, _ in found] == [text for text, _ in self._shown]:
            return False
        self._shown = tuple(found)
        return True

    def conditions(self) -> Iterable[ConditionEntry]:
        for text, since_us in self._shown:
            yield ConditionEntry(text=text[:200], since_us=max(0, since_us))
