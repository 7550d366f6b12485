"""Shortest walks through places that have to be visited, in whatever order: exact for a few places, as bounds of moves."""

from collections.abc import Mapping
from typing import Final

from dyknow.planning.contingent.sensing_problems import CompiledSensing, Distance, bits_of

MOST_PLACES: Final = 9
"""Of more places that have to be visited the first are looked at: their walk is a bound all the same."""
_NEVER: Final = 2**62


class ShortestWalks:
    """Walks between the places of looks; each is computed once.

    Attributes:
        places: sets of them are masks, a bit each.
    """

    def __init__(self, compiled: CompiledSensing) -> None:
        self.places = sorted(compiled.looks)
        self._compiled = compiled
        self._known: dict[tuple[str, int, int], int] = {}

    def cost(self, place: str, visited: int, count: int) -> int:
        """The least cost of visiting `count` of the places of a mask, from a place on."""
        masks = bits_of(visited)
        if len(masks) > MOST_PLACES:
            count = max(0, count - (len(masks) - MOST_PLACES))
            visited = sum(1 << number for number in masks[:MOST_PLACES])
        return self._cost(place, visited, count)

    def _cost(self, place: str, visited: int, count: int) -> int:
        if count <= 0:
            return 0
        key = (place, visited, count)
        if key not in self._known:
            far: Mapping[str, Distance] = self._compiled.distances(place)
            self._known[key] = min(
                (
                    far[to][0] + self._cost(to, visited & ~(1 << number), count - 1)
                    for number in bits_of(visited)
                    if (to := self.places[number]) in far
                ),
                default=_NEVER,
            )
        return self._known[key]
