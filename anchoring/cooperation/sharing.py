"""The level of sharing between two members: by bandwidth, by load, by the partner's abilities, and by need.

| level | shared | computed by |
|---|---|---|
| `percepts` | percepts of detectors | the receiver links it |
| `states` | objects with covariances | the receiver recognises |
| `relations` | relations of pairs, when they change | the sender relates, the receiver recognises |
| `events` | that an object has come in front, or has fallen behind | the sender recognises |
| `none` | nothing | |

At each but the last, names are agreed on by tracks, which then come seldom.
"""

from collections.abc import Collection, Iterable, Mapping
from math import hypot
from typing import Final, Literal, NamedTuple, TypeAlias, get_args

from dyknow import US_PER_S
from dyknow.anchoring.links.states import ObjectState, moved

SharingLevel: TypeAlias = Literal["none", "events", "relations", "states", "percepts"]
LEVELS: Final[tuple[SharingLevel, ...]] = get_args(SharingLevel)
"""From least to most."""
TRACKS_US: Final[Mapping[SharingLevel, int]] = {
    "none": 0, "events": 400_000, "relations": 400_000, "states": 200_000, "percepts": 400_000
}  # fmt: skip
"""The period of tracks; 0: none are shared."""
_TRACK_BYTES: Final = 110
_BYTES_S: Final[Mapping[SharingLevel, float]] = {
    "none": 0.0, "events": 10.0, "relations": 80.0, "states": 0.0, "percepts": 10.0 * 60.0
}  # fmt: skip
"""Of one object in a second, besides its track."""
AHEAD_US: Final = 10 * US_PER_S


class Partner(NamedTuple):
    """A member as it is known before anything is shared.

    Attributes:
        levels: the levels that it offers.
        kbit_s: of the link to it, declared; None: unlimited.
        is_busy: whether it has too much to do.
        x_m, y_m, reach_m: its area; None: not known.
    """

    unit: str
    levels: frozenset[SharingLevel]
    kbit_s: float | None = None
    is_busy: bool = False
    x_m: float | None = None
    y_m: float | None = None
    reach_m: float = 80.0


def kbit_s(level: SharingLevel, objects: int) -> float:
    """The bandwidth of a level for a number of objects, about."""
    tracks_s = US_PER_S / TRACKS_US[level] if TRACKS_US[level] else 0.0
    return objects * (tracks_s * _TRACK_BYTES + _BYTES_S[level]) * 8.0 / 1000.0


def chosen_level(partner: Partner, objects: int, *, is_busy: bool = False) -> SharingLevel:
    """The level that says most of those that the partner offers, the link carries, and both have time for.

    A busy member neither links the percepts nor relates the states of another; a busy partner relates and recognises
    for no other.
    """
    left_out: set[SharingLevel] = {
        "percepts"
    }  # states say as much, for less; percepts are for partners that link nothing
    if is_busy:
        left_out |= {"percepts", "states"}
    if partner.is_busy:
        left_out |= {"relations", "events"}
    fits = [
        level
        for level in LEVELS
        if level in {*partner.levels, "none"} and (partner.kbit_s is None or kbit_s(level, objects) <= partner.kbit_s)
    ]
    best = [level for level in fits if level not in left_out and level != "none"]
    return (best or fits)[-1]


def right_neighbour(state: ObjectState, partners: Iterable[Partner]) -> str | None:
    """The member into whose area an object moves next; None: into none of theirs within `AHEAD_US`."""
    placed = [each for each in partners if each.x_m is not None and each.y_m is not None]
    for ahead_us in range(0, AHEAD_US + 1, US_PER_S // 2):
        expected = moved(state, state.valid_us + ahead_us, 0.0)
        apart = {
            each.unit: hypot(expected.x_m - (each.x_m or 0.0), expected.y_m - (each.y_m or 0.0)) / each.reach_m
            for each in placed
        }
        inside = {unit: share for unit, share in apart.items() if share <= 1.0}
        if inside:
            return min(inside, key=lambda unit: (inside[unit], unit))
    return None


def wanted_of(states: Mapping[str, ObjectState], partners: Collection[Partner]) -> dict[str, set[str]]:
    """By member, the objects that move into its area next."""
    wanted: dict[str, set[str]] = {}
    for name, state in states.items():
        unit = right_neighbour(state, partners)
        if unit is not None:
            wanted.setdefault(unit, set()).add(name)
    return wanted
