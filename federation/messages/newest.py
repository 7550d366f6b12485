"""The last contents of each unit, read once for all members of a process: two entries a unit, and a limited number of bytes in all.

A unit that sends ever other contents pushes out its own entries and those of units that were silent of late; a dropped
entry is only read again.
"""

from collections import OrderedDict
from collections.abc import Callable
from typing import Final, Generic, TypeVar

KEPT: Final = 2
"""Entries of a unit: while one content follows another, both arrive."""
MOST_BYTES: Final = 1 << 20
"""Bytes of all entries of one cache, as they are sent; their values take several times more."""

Item = TypeVar("Item")
Made = TypeVar("Made")


class Newest(Generic[Item, Made]):
    """Calls `make` for new contents of a unit, and returns its earlier result for known ones.

    Args:
        size: bytes of an entry.
        most_bytes: of all entries; those of the units that were heard longest ago go first.
    """

    def __init__(self, make: Callable[[Item], Made], size: Callable[[Item], int], most_bytes: int = MOST_BYTES) -> None:
        self._make, self._size, self._most_bytes = make, size, most_bytes
        self._entries: OrderedDict[str, tuple[tuple[Item, Made], ...]] = OrderedDict()
        self.bytes = 0

    def __len__(self) -> int:
        """How many units have entries."""
        return len(self._entries)

    def has(self, unit: str, said: Item) -> bool:
        """Whether what is made of it is kept."""
        return any(known == said for known, _ in self._entries.get(unit, ()))

    def __call__(self, unit: str, said: Item) -> Made:
        """The result of `make`; raises its exceptions."""
        entries = self._entries.get(unit, ())
        for known, made in entries:
            if known is said or known == said:
                return made
        made = self._make(said)
        kept = ((said, made), *entries[: KEPT - 1])
        self.bytes += self._size(said) - sum(self._size(known) for known, _ in entries[KEPT - 1 :])
        self._entries[unit] = kept
        self._entries.move_to_end(unit)
        while self.bytes > self._most_bytes and self._entries:
            _, given_up = self._entries.popitem(last=False)
            self.bytes -= sum(self._size(known) for known, _ in given_up)
        return made
