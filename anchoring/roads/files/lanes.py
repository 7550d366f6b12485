"""Lanes as texts give them: a number of lanes, or signed offsets."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Final

from dyknow.anchoring.roads.elements import Lane

MOST_LANES: Final = 32


@lru_cache(maxsize=1024)
def even_lanes(count: int, width_m: float, *, one_way: bool = False, left_hand: bool = False) -> tuple[Lane, ...]:
    """Lanes of equal width, from right to left; half of them lead back, and one lane alone leads both ways."""
    each_m = width_m / count
    offsets = [((count - 1) / 2 - n) * each_m for n in range(count)]
    if one_way:
        return tuple(Lane(offset, 1) for offset in offsets)
    if count == 1:
        return (Lane(0.0, 0),)
    ahead = (count + 1) // 2
    if left_hand:
        offsets.reverse()
    return tuple(Lane(offset, 1 if n < ahead else -1) for n, offset in enumerate(offsets))


def offset_lanes(offsets_m: Sequence[float], *, one_way: bool = False, left_hand: bool = False) -> tuple[Lane, ...]:
    """A lane for each offset, positive on the right; those on the side of the traffic lead ahead, one at 0 both ways."""
    side = -1 if left_hand else 1
    return tuple(Lane(at, 1 if one_way else 0 if at == 0.0 else side if at > 0.0 else -side) for at in offsets_m)
