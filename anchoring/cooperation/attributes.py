"""Attributes of objects that are handed over between members: changes in streams of this one, under the names of the
picture.

A chronicle speaks of attributes with discrete values, `lane[?car]` or `follows.too_close[?car1, ?car2]`. The streams of
this member have its own symbols; a change waits until the picture has names for its objects, and is dropped if there
are none in time.
"""

from collections.abc import Iterable, Mapping
from typing import Final, NamedTuple

from dyknow import US_PER_S, Label, Value
from dyknow.anchoring.cooperation.rows import PictureRow
from dyknow.reasoning.chronicles import symbol

NAMED_US: Final = 1_500_000
"""So long a change waits for the names of its objects."""
REPEATED_US: Final = US_PER_S
KEPT_US: Final = 5 * US_PER_S
"""How long the name of a track is kept that is followed no longer."""
MOST_HELD: Final = 4096
LONGEST: Final = 64
"""Characters of a name or a value."""
UNSEEN_US: Final = US_PER_S
MOST_SIGHTS: Final = 1024


class ObjectAttribute(NamedTuple):
    """A value of an attribute of one object or two, by their names in the picture.

    Attributes:
        seen_us: until when it is known.
        is_shared: whether all of the label are objects of the picture.
    """

    label: Label
    value: str
    since_us: int
    seen_us: int
    is_shared: bool = True


class AttributeChanges:
    """Changes in streams of this member, once its objects have names.

    Args:
        delay_us: how late samples come: a value is known until so long before.

    Attributes:
        lost: changes that were left out, since too many wait for names.
    """

    def __init__(self, delay_us: int) -> None:
        self._delay_us, self.lost = delay_us, 0
        self._waiting: list[tuple[Label, int, str]] = []
        self._held: dict[Label, tuple[int, str]] = {}
        self._told_us: dict[Label, int] = {}
        self._names: dict[str, tuple[str, int]] = {}

    def on_sample(self, label: Label, valid_us: int, value: Value) -> None:
        """A sample of a stream. A value that is no symbol, such as a number, is ignored."""
        new = symbol(value)
        is_new = new is not None and self._held.get(label, (0, None))[1] != new
        if new is None or not is_new:
            return
        if len(self._waiting) >= MOST_HELD:
            self.lost += 1
        else:
            if label not in self._held and len(self._held) >= MOST_HELD:
                self._told_us.pop(oldest := next(iter(self._held)), None)
                del self._held[oldest]
            self._held[label] = valid_us, new
            self._waiting.append((label, valid_us, new))

    def forget(self, label: Label) -> None:
        """The stream has ended."""
        self._held.pop(label, None)
        self._told_us.pop(label, None)

    def news(self, rows: Iterable[PictureRow], unit: str, at_us: int) -> list[ObjectAttribute]:
        """Values that changed since the last call, and once a second each present value of objects that this member sees."""
        seen: set[str] = set()
        for row in rows:
            if unit in row.by:
                own = [key.symbol for key in row.tracks if key.unit == unit]
                self._names |= dict.fromkeys(own, (row.name, at_us))
                seen.add(row.name)
        self._names = {each: one for each, one in self._names.items() if at_us - one[1] <= KEPT_US}
        found, left = list[ObjectAttribute](), list[tuple[Label, int, str]]()
        for label, since_us, value in self._waiting:
            is_named = self._names.keys() >= set(label.objects)
            if is_named or since_us <= at_us - NAMED_US:
                found.append(ObjectAttribute(self._named(label), value, since_us, since_us, is_named))
                self._told_us[label] = at_us
            else:
                left.append((label, since_us, value))
        self._waiting = left
        for label, told_us in self._told_us.items():
            if label.objects and at_us - told_us >= REPEATED_US and self._names.keys() >= set(label.objects):
                named, held = self._named(label), self._held.get(label)
                if held is not None and seen.issuperset(named.objects):
                    found.append(ObjectAttribute(named, held[1], held[0], max(held[0], at_us - self._delay_us)))
                    self._told_us[label] = at_us
        return found

    def _named(self, label: Label) -> Label:
        return Label(label.feature, tuple(self._names.get(each, (each, 0))[0] for each in label.objects))


class Sights:
    """Since when and until when objects are seen; a second without being seen begins another span."""

    def __init__(self) -> None:
        self._spans: dict[str, tuple[int, int]] = {}

    def see(self, seen: Mapping[str, int]) -> None:
        """Objects were seen at these times."""
        for name, at_us in seen.items():
            begin_us, end_us = self._spans.pop(name, (at_us, at_us))
            self._spans[name] = (begin_us if at_us - end_us <= UNSEEN_US else at_us), max(at_us, end_us)
        while len(self._spans) > MOST_SIGHTS:
            del self._spans[next(iter(self._spans))]

    def __contains__(self, name: object) -> bool:
        return name in self._spans

    def since_us(self, name: str) -> int:
        """Since when it is seen."""
        return self._spans.get(name, (0, 0))[0]

    def has(self, name: str, at_us: int) -> bool:
        """Whether it was seen within the second before a time."""
        begin_us, end_us = self._spans.get(name, (0, -UNSEEN_US))
        return begin_us - UNSEEN_US <= at_us <= end_us + UNSEEN_US
