"""The observed properties of the objects of one stream, percept by percept, for as long as each of them is there.

States of linked objects have the attributes of their newest percept; a mark that was seen from one side is not in them when the
object is seen from another. Here it is remembered: a property has the value that most percepts showed.
"""

from collections import Counter
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, field
from math import isfinite
from typing import Final, NamedTuple

from dyknow import NO_VALUE, Value
from dyknow.anchoring.links.objects import LinkObject
from dyknow.anchoring.links.structures import ObjectLinkage
from dyknow.anchoring.matching.candidates import ObservedProperty
from dyknow.anchoring.matching.descriptions import PropertyValue

MOST: Final = 256
"""Most observed objects; the others are counted."""
MOST_VALUES: Final = 16
"""Values that are counted of one property."""
LEAST_COUNT: Final = 3
"""A property that fewer percepts showed is unobserved."""
KNOWN_SPEED_M_S: Final = 3.0
"""The speed of an object is unobserved while the standard deviation of its velocity is greater."""


class ObjectPlace(NamedTuple):
    """Where an object is: metres east and north, metres per second; when a percept showed it last."""

    x_m: float
    y_m: float
    vx_m_s: float
    vy_m_s: float
    seen_us: int


@dataclass(slots=True)
class _Observed:
    place: ObjectPlace
    since_us: int
    seen: bool = True
    speed: float | None = None
    counts: dict[str, Counter[PropertyValue]] = field(default_factory=dict)


class ObservedObjects:
    """See the module.

    Args:
        type_: of the objects.

    Attributes:
        left_out: objects beyond the most that are observed.
    """

    def __init__(self, type_: str) -> None:
        self._type = type_
        self._known: dict[str, _Observed] = {}
        self.left_out = 0

    def step(self, linkage: ObjectLinkage) -> None:
        """Take what percepts have shown since the last time."""
        objects = linkage.objects(self._type)
        for symbol in [each for each in self._known if each not in objects]:
            del self._known[symbol]
        for known in self._known.values():
            known.seen = False
        taken = [one for one in objects.values() if one.symbol in self._known or _percepts(one)]
        kept = sorted(taken, key=lambda each: each.symbol not in self._known)[:MOST]
        self.left_out = len(taken) - len(kept)
        for one in kept:
            self._take(one, _percepts(one))

    def _take(self, one: LinkObject, percepts: Iterable[LinkObject]) -> None:
        state = one.state
        for percept in percepts:
            newest_us = percept.observed[-1].valid_us if percept.observed else 0
            place = ObjectPlace(state.x_m, state.y_m, state.vx_m_s, state.vy_m_s, newest_us)
            known = self._known.get(one.symbol)
            if known is None:
                known = self._known[one.symbol] = _Observed(place, percept.created_us)
                before_us = 0
            else:
                before_us = known.place.seen_us
            known.place, known.seen = place, True
            sd_m_s = max(float(state.covariance[2, 2]), float(state.covariance[3, 3])) ** 0.5
            known.speed = state.speed_m_s if sd_m_s <= KNOWN_SPEED_M_S else None
            for each in percept.observed:
                if each.valid_us > before_us:
                    _count(known.counts, each.attributes)

    def forget(self, symbol: str) -> None:
        """Forget its properties: from now on percepts may show another object."""
        if symbol in self._known:
            self._known[symbol].counts.clear()

    def renamed(self, before: str, symbol: str) -> None:
        """An object has another symbol."""
        if before in self._known:
            self._known[symbol] = self._known.pop(before)

    def is_seen(self, symbol: str) -> bool:
        """Whether a percept shows it now."""
        return symbol in self._known and self._known[symbol].seen

    def place(self, symbol: str) -> ObjectPlace | None:
        """Where it is."""
        return self._known[symbol].place if symbol in self._known else None

    def begins_us(self, symbol: str) -> int:
        """Since when it is observed."""
        return self._known[symbol].since_us if symbol in self._known else 0

    def counts(self, symbol: str) -> Mapping[str, Counter[PropertyValue]]:
        """Of each property the values that percepts showed, so far; a copy."""
        known = self._known.get(symbol)
        return {} if known is None else {name: Counter(each) for name, each in known.counts.items()}

    def percepts(self, *, placed: Container[str] = ()) -> dict[str, dict[str, ObservedProperty | None]]:
        """All objects that percepts show now, with the properties that were observed; of `x_m`, `y_m` and `speed` those in `placed`."""
        found: dict[str, dict[str, ObservedProperty | None]] = {}
        for symbol, one in self._known.items():
            if one.seen:
                found[symbol] = properties_of(one.counts)
                moving = {"x_m": one.place.x_m, "y_m": one.place.y_m, "speed": one.speed}
                found[symbol] |= {
                    name: ObservedProperty(round(value, 1))
                    for name, value in moving.items()
                    if name in placed and value is not None
                }
        return found


def properties_of(counts: Mapping[str, Counter[PropertyValue]]) -> dict[str, ObservedProperty | None]:
    """Of each property the value that was shown most, with its share as confidence; numbers by their median."""
    found: dict[str, ObservedProperty | None] = {}
    for name, each in counts.items():
        total = each.total()
        value, most = each.most_common(1)[0]
        if isinstance(value, float):
            value, most = sorted(one for one in each.elements() if isinstance(one, float))[total // 2 - 1], total
        found[name] = ObservedProperty(value, most / total) if total >= LEAST_COUNT else None
    return found


def since(
    counts: Mapping[str, Counter[PropertyValue]], before: Mapping[str, Counter[PropertyValue]]
) -> dict[str, Counter[PropertyValue]]:
    """The properties shown after another time."""
    left = {name: each - before.get(name, Counter()) for name, each in counts.items()}
    return {name: each for name, each in left.items() if each}


def _percepts(one: LinkObject) -> list[LinkObject]:
    """The percepts at the bottom of an object's live links that show it."""
    found, waiting = list[LinkObject](), [one]
    while waiting:
        each = waiting.pop()
        below = [link.source for link in each.incoming.values()]
        if not below and each is not one:
            found.append(each)
        waiting += below
    return found


def _count(counts: dict[str, Counter[PropertyValue]], attributes: Mapping[str, Value]) -> None:
    for name, value in attributes.items():
        if value is NO_VALUE or not isinstance(value, bool | str | int | float):
            continue
        known: PropertyValue = value if isinstance(value, bool | str) else float(value)
        if isinstance(known, float) and not isinstance(known, bool) and not isfinite(known):
            continue
        of_name = counts.setdefault(name, Counter())
        if known in of_name or len(of_name) < MOST_VALUES:
            of_name[known] += 1
