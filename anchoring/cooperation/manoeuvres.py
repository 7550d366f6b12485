"""Manoeuvres of pairs of objects that no member sees whole (thesis 8.7.5, 9.2): relations, from whichever member has them.

Of each two objects that are near each other the relations of 8.7.5 are computed from their states under their common
names, in the direction in which the first drives. Reports of other members about the same pairs are merged in the order
of valid times, and so is each further attribute in a chronicle (`attributes.py`). Chronicles are recognised over all.
"""

from collections.abc import Collection, Iterable, Mapping
from heapq import heappop, heappush
from itertools import permutations
from math import atan2, cos, hypot, sin
from typing import Any, Final, Literal, NamedTuple, TypeAlias

from dyknow import US_PER_MS, US_PER_S, ComputationalUnit, Label, Sample, UnitPrototype, Value, prototypes_in
from dyknow.anchoring.cooperation.attributes import ObjectAttribute, Sights
from dyknow.anchoring.cooperation.rows import PictureRow
from dyknow.anchoring.links.states import ObjectState
from dyknow.compunits import ROAD_RELATIONS, RoadRelations, SmoothOffset, StableFields
from dyknow.reasoning.chronicles import ChangeEvents, ChronicleFile, ChronicleInstance, Recogniser, compile_chronicle

NEAR_M: Final = 80.0
MOVES_M_S: Final = 2.0
"""The direction of a slower object is unknown."""
SEEN_US: Final = 250_000
AGAIN_US: Final = US_PER_S
"""Relations that do not change are repeated so often."""
LATE_US: Final = 3_000_000
"""How long what others report is waited for."""
OVER_US: Final = 2 * US_PER_S
MOST_PAIRS: Final = 256
MAX_AGE_MS: Final = 600_000
EARLY_US: Final = US_PER_S
MOST_WAITING: Final = 4096
_FIELDS: Final = tuple(field.name for field in ROAD_RELATIONS.fields)

Pair: TypeAlias = tuple[str, str]
EventKind: TypeAlias = Literal[
    "comes-in-front", "falls-behind", "comes-left", "comes-right", "turns-oncoming", "turns-along", "comes-close", "goes-away"
]  # fmt: skip
_SECTORS: Final = ("behind", "in_front", "left", "right")
_HOLDS: Final[Mapping[EventKind, Mapping[str, bool]]] = {
    "comes-in-front": {each: each == "in_front" for each in _SECTORS} | {"beside": False},
    "falls-behind": {each: each == "behind" for each in _SECTORS} | {"beside": False},
    "comes-left": {each: each == "left" for each in _SECTORS} | {"beside": True},
    "comes-right": {each: each == "right" for each in _SECTORS} | {"beside": True},
    "turns-oncoming": {"oncoming": True},
    "turns-along": {"oncoming": False},
    "comes-close": {"close": True},
    "goes-away": {"close": False},
}
"""The relations that begin with each event."""


class PairRelation(NamedTuple):
    """The relation of the first object to the second; `record` as `ROAD_RELATIONS`, None where it is not stated."""

    valid_us: int
    pair: Pair
    record: tuple[bool | None, ...]


class PairEvent(NamedTuple):
    """A relation of the first object to the second has begun."""

    valid_us: int
    pair: Pair
    kind: EventKind


class PairRelations:
    """Computes the relations of all pairs."""

    def __init__(self) -> None:
        self._chains: dict[Pair, tuple[int, list[ComputationalUnit]]] = {}
        self._shared: dict[Pair, PairRelation] = {}

    def step(self, rows: Iterable[PictureRow], at_us: int) -> list[PairRelation]:
        """The relations of pairs of objects that were seen at a time, or just before or after it."""
        states = {row.name: _moved(row.state, at_us) for row in rows if row.by and row.seen_us >= at_us - SEEN_US}
        near = [
            pair
            for pair in permutations(states, 2)
            if states[pair[0]].distance_m(states[pair[1]]) <= NEAR_M and states[pair[0]].speed_m_s >= MOVES_M_S
        ]
        self._chains = {pair: each for pair, each in self._chains.items() if at_us - each[0] <= OVER_US}
        found: list[PairRelation] = []
        for pair in near:
            if pair not in self._chains and len(self._chains) >= MOST_PAIRS:
                continue
            chain = self._chains[pair][1] if pair in self._chains else _chain()
            self._chains[pair] = at_us, chain
            record = _stepped(chain, at_us, _offset(states[pair[0]], states[pair[1]]))
            if isinstance(record, tuple):
                found.append(PairRelation(at_us, pair, tuple(each is True for each in record)))
        return found

    def news(self, relations: Iterable[PairRelation]) -> list[PairRelation]:
        """Relations that changed, and each one again after a while."""
        news = []
        for each in relations:
            known = self._shared.get(each.pair)
            if known is None or known.record != each.record or each.valid_us - known.valid_us >= AGAIN_US:
                self._shared[each.pair] = each
                news.append(each)
        self._shared = {pair: each for pair, each in self._shared.items() if pair in self._chains}
        return news


class PairEvents:
    """Recognises which relations of pairs begin."""

    def __init__(self) -> None:
        self._last: dict[Pair, Mapping[str, bool | None]] = {}

    def news(self, relations: Iterable[PairRelation]) -> list[PairEvent]:
        """The events in new relations."""
        found: list[PairEvent] = []
        for each in relations:
            before = self._last.get(each.pair, {})
            record = dict(zip(_FIELDS, each.record, strict=True))
            found += [
                PairEvent(each.valid_us, each.pair, kind)
                for kind, holds in _HOLDS.items()
                if holds.items() <= record.items() and not holds.items() <= before.items()
            ]
            self._last[each.pair] = record
            if len(self._last) > 2 * MOST_PAIRS:
                del self._last[next(iter(self._last))]
        return found


def as_relation(event: PairEvent) -> PairRelation:
    """The relations of a pair after an event of another member; the others are unchanged."""
    holds = _HOLDS[event.kind]
    return PairRelation(event.valid_us, event.pair, tuple(holds.get(name) for name in _FIELDS))


def handed_over(chronicles: ChronicleFile) -> tuple[str, ...]:
    """The chronicles of a file that are recognised over the areas of several members: all they need are attributes, no messages.

    Raises:
        ChronicleError: one of them cannot be recognised.
    """
    left = {name: compile_chronicle(each, chronicles) for name, each in chronicles.chronicles.items()}
    while True:
        kept = {
            name: each for name, each in left.items() if all(one.change or one.name in left for one in each.patterns)
        }
        if len(kept) == len(left):
            return tuple(kept)
        left = kept


def _field(attribute: str, arity: int) -> str | None:
    """The relation of two objects that an attribute is, in the stream of any name; None: it is none."""
    field = attribute.rpartition(".")[2]
    return field if arity == len(("first", "second")) and field in _FIELDS else None


class SpanningManoeuvres:
    """Recognises chronicles over what this member and others have of objects.

    Args:
        chronicles: over the attributes `car_relations.behind[?car1, ?car2]`, `lane[?car]` and so on.
        names: which of them.
        initially: whether first values have been so since ever; names: those of these streams.
    """

    def __init__(self, chronicles: ChronicleFile, *names: str, initially: bool | Collection[str] = False) -> None:
        self._recogniser = Recogniser.of(chronicles, names, max_age_ms=MAX_AGE_MS)
        self._events = ChangeEvents(self._recogniser, initially=initially)
        self._names, self._chronicles = frozenset(names), chronicles
        attributes = self._recogniser.attributes
        self._wanted = [
            (_FIELDS.index(field), each) for each, arity in sorted(attributes) if (field := _field(each, arity))
        ]
        self._attributes = {(each, arity) for each, arity in attributes if _field(each, arity) is None}
        self._count = 0
        self._waiting: list[tuple[int, int, int, tuple[tuple[Label, object], ...]]] = []
        self._own_us: dict[tuple[str, ...], int] = {}
        self._sights, self._own = Sights(), Sights()
        self._valued_us: dict[Label, int] = {}
        self._own_labels: dict[Label, int] = {}

    def see(self, rows: Iterable[PictureRow], unit: str) -> None:
        """Objects of the picture are seen, some by this member itself."""
        seen = {row.name: (row.seen_us, row.by) for row in rows if row.by}
        self._sights.see({name: at_us for name, (at_us, _) in seen.items()})
        self._own.see({name: at_us for name, (at_us, by) in seen.items() if unit in by})

    def wants(self, label: Label) -> bool:
        """Whether a chronicle speaks of this attribute, and it is none of the relations that the picture has."""
        return (label.feature, len(label.objects)) in self._attributes

    def take(self, relations: Iterable[PairRelation]) -> None:
        """Take what this member sees itself."""
        for each in relations:
            self._own_us[each.pair] = max(each.valid_us, self._own_us.get(each.pair, 0))
            self._wait(each.valid_us, 0, self._values(each))

    def take_own(self, attribute: ObjectAttribute) -> bool:
        """Take a value that this member has itself; False: too many wait."""
        if len(self._waiting) >= MOST_WAITING:
            return False
        self._own_labels[attribute.label] = attribute.seen_us
        at_us = attribute.since_us if attribute.seen_us - attribute.since_us < LATE_US else attribute.seen_us
        self._wait(at_us, 0, ((attribute.label, attribute.value),))
        return True

    def take_from(self, relation: PairRelation, now_us: int) -> bool:
        """Take what another member reports, which counts where this one does not see the pair; False: it is of another time, or too much."""
        return self._take_late(relation.valid_us, self._values(relation), now_us)

    def take_attribute_from(self, attribute: ObjectAttribute, now_us: int) -> bool:
        """Take a value that another member has; it counts where this one has none. False: it is of another time, or too much."""
        late = attribute.since_us < now_us - LATE_US
        at_us = attribute.seen_us if late else attribute.since_us
        return self._take_late(at_us, ((attribute.label, attribute.value),), now_us)

    def _take_late(self, at_us: int, values: tuple[tuple[Label, object], ...], now_us: int) -> bool:
        is_timely = now_us - LATE_US <= at_us <= now_us + EARLY_US
        if is_timely and len(self._waiting) < MOST_WAITING:
            self._wait(at_us, 1, values)
            return True
        return False

    def _values(self, relation: PairRelation) -> tuple[tuple[Label, object], ...]:
        return tuple((Label(name, relation.pair), relation.record[at]) for at, name in self._wanted)

    def _wait(self, at_us: int, other: int, values: tuple[tuple[Label, object], ...]) -> None:
        self._count += 1
        heappush(self._waiting, (at_us, other, self._count, values))

    def on_time(self, now_us: int) -> list[ChronicleInstance]:
        """The instances recognised from all relations that were valid `LATE_US` ago."""
        found: list[ChronicleInstance] = []
        if len(self._own_us) > 2 * MOST_PAIRS:
            self._own_us = {pair: at_us for pair, at_us in self._own_us.items() if now_us - at_us <= 2 * LATE_US}
        for known in (self._valued_us, self._own_labels):
            while len(known) > MOST_WAITING:
                del known[next(iter(known))]
        while self._waiting and self._waiting[0][0] <= now_us - LATE_US:
            valid_us, other, _, values = heappop(self._waiting)
            for label, value in values:
                if self.wants(label):
                    found += self._on_attribute(label, valid_us, value, other)
                elif not other or valid_us > self._own_us.get(label.objects, 0):
                    found += self._events.on_sample(label, valid_us, value)
        found += self._recogniser.on_time((now_us - LATE_US) // US_PER_MS) if self._valued_us else ()
        return [each for each in found if each.chronicle in self._names and self._is_of_picture(each)]

    def _on_attribute(self, label: Label, valid_us: int, value: object, other: int) -> list[ChronicleInstance]:
        """A value of an attribute. It is dropped if an object was not seen for a second, and is a first value once the object is seen again."""
        shown = [each for each in label.objects if each in self._sights]
        if not all(self._sights.has(each, valid_us) for each in shown):
            return []
        if other and label in self._own_labels and all(self._own.has(each, valid_us) for each in shown):
            return []
        last_us = self._valued_us.pop(label, valid_us)
        if any(last_us < self._sights.since_us(each) <= valid_us for each in shown):
            self._events.forget(label)
        self._valued_us[label] = valid_us
        return self._events.on_sample(label, valid_us, value)

    def _is_of_picture(self, instance: ChronicleInstance) -> bool:
        """Whether it is of an object of the picture, where it can be of something else: the platform itself recognises those."""
        return not self._attributes or any(each in self._sights for each in instance.bindings.values())

    def subjects(self, instance: ChronicleInstance) -> tuple[str, ...]:
        """The arguments of a manoeuvre, in the order of its chronicle."""
        parameters = self._chronicles.chronicles[instance.chronicle].parameters
        return tuple(instance.bindings.get(str(each), "?") for each in parameters)


def _moved(state: ObjectState, at_us: int) -> ObjectState:
    seconds = (at_us - state.valid_us) / US_PER_S
    return state._replace(x_m=state.x_m + seconds * state.vx_m_s, y_m=state.y_m + seconds * state.vy_m_s)


def _chain() -> list[ComputationalUnit]:
    made = prototypes_in((SmoothOffset, RoadRelations, StableFields))
    return [ComputationalUnit(unit.make(), 1) for unit in made if isinstance(unit, UnitPrototype)]


def _stepped(chain: list[ComputationalUnit], at_us: int, value: Value) -> Any:
    sample: Sample | None = Sample(at_us, at_us, value)
    for unit in chain:
        if sample is None:
            return None
        sample = unit.on_sample(0, sample, at_us)
    return None if sample is None else sample.value


def _offset(one: ObjectState, other: ObjectState) -> Value:
    """As `RoadOffset`, in the direction in which the first moves."""
    forward = atan2(one.vx_m_s, one.vy_m_s)
    east_m, north_m = one.x_m - other.x_m, one.y_m - other.y_m
    speed_m_s = hypot(other.vx_m_s, other.vy_m_s)
    agreement = cos(atan2(other.vx_m_s, other.vy_m_s) - forward) if speed_m_s >= MOVES_M_S else 1.0
    return (
        east_m * sin(forward) + north_m * cos(forward),
        east_m * cos(forward) - north_m * sin(forward),
        agreement,
    )
