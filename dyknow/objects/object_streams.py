"""Streams of objects, made on demand: the domain of a stream of object states, and the features of one object.

Of the stream `cars` there are `cars.objects`, the set of those that are there, `cars[car1]`, the states of one of them, and
`cars.colour[car1]`, one attribute. `colour[car1]` is that attribute from whichever stream has the object; `type[car1]` is
the sort of its states, unless they have a field of that name.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Final, TypeAlias

from dyknow.model.labels import Label
from dyknow.model.members import NamedMembers
from dyknow.model.sample import Sample, Value
from dyknow.model.values import NO_VALUE, Sort
from dyknow.network.network import Network
from dyknow.network.process import Process
from dyknow.network.processes import OnDemand
from dyknow.objects.object_table import ObjectChange, ObjectTable, Undo

OBJECTS: Final = "objects"
"""After the name of a stream of object states: the domain of its objects."""
TYPE: Final = "type"
REMEMBERED: Final = 64
"""Most samples kept of a domain, and of a feature of one object: there may be thousands of them."""

View: TypeAlias = Callable[[Value], Value]
"""The wanted part of an object state."""
ViewOf: TypeAlias = Callable[[Sort], tuple[Sort, View] | None]
"""The wanted part of the states of a sort; None: they do not have it."""
_NONE: Final[Mapping[str, ViewOf]] = MappingProxyType({})


class ObjectStreams:
    """Makes them, for one network: `find` is asked for labels that no generator carries.

    Args:
        quantities: features made of object states besides their attributes, by the name of a feature of one object.
        is_other: whether a name is that of something else, such as a unit of the federation.
    """

    def __init__(
        self,
        network: Network,
        quantities: Mapping[str, ViewOf] = _NONE,
        is_other: Callable[[str], bool] = lambda _name: False,
    ) -> None:
        self.is_other = is_other
        self._network, self._quantities = network, quantities
        self._streams: dict[Label, None] = {}
        self._tables: dict[Label, ObjectTable] = {}
        network.meet(self._on_label)

    def find(self, label: Label, *, named: bool = False) -> tuple[Sort, Process] | None:
        """Sort and process of a stream about objects; None: there is none of that label. If `named`, an attribute has to be named with its stream."""
        stem, _, attribute = label.feature.rpartition(".")
        if attribute == OBJECTS and stem:
            table = self.table(Label(stem, label.objects))
            return None if table is None else (Sort("object", is_open=True), DomainStream(table))
        if len(label.objects) != 1 or self.is_other(label.objects[0]):
            return None
        views = self._views(stem, attribute) or self._views(label.feature, "")
        if not views and not stem and not (named and label.feature not in self._quantities):
            views = self.bearers(label.feature)
        if not views:
            return None
        (sort, _), *_ = (view for _, view in views)
        return sort, ObjectFeature(label.objects[0], [(table, view) for table, (_, view) in views])

    def table(self, label: Label) -> ObjectTable | None:
        """The objects of a stream; None: it is not there, or not one of object states."""
        generator = self._network.behind(label)
        if generator is None or generator.label != label or not generator.sort.is_of_objects:
            self._tables.pop(label, None)
            return None
        table = self._tables.get(label)
        if table is None or table.sort != generator.sort:
            table = self._tables[label] = ObjectTable(self._network, label, generator.sort)
        return table

    def tables(self) -> list[ObjectTable]:
        """The streams of object states that are there."""
        found = {label: self.table(label) for label in self._streams}
        return [table for table in found.values() if table is not None]

    def sources(self, label: Label) -> list[Label]:
        """The streams of object states that a stream about objects is made of."""
        found = self.find(label)
        return [table.label for table in found[1].tables] if found and isinstance(found[1], ObjectProcess) else []

    def bearers(self, feature: str) -> list[tuple[ObjectTable, tuple[Sort, View]]]:
        """The streams whose objects have a feature, and how it comes from their states."""
        quantity = self._quantities.get(feature)
        found: list[tuple[ObjectTable, tuple[Sort, View]]] = []
        for label in tuple(self._streams):
            table = self.table(label)
            if table is None:
                del self._streams[label]
                continue
            view = attribute_of(table.sort, feature) if quantity is None else quantity(table.sort)
            if view is not None:
                found.append((table, view))
        return found

    def renew(self, name: str) -> None:
        """The object of a name has changed: make its streams on demand again."""
        self._remake(label for label in self._network.labels() if name in label.objects)

    def _remake(self, labels: Iterable[Label]) -> None:
        network = self._network
        for label in tuple(labels):
            if network.is_implicit(label):
                network.remove(label)
        network.recall()

    def _views(self, stream: str, attribute: str) -> list[tuple[ObjectTable, tuple[Sort, View]]]:
        """The tables and views that a label with the stream's name refers to."""
        table = self.table(Label(stream)) if stream else None
        if table is None:
            return []
        view = attribute_of(table.sort, attribute) if attribute else (table.sort, _whole)
        return [] if view is None else [(table, view)]

    def _on_label(self, label: Label) -> None:
        """A stream of object states is there, perhaps of another sort than before: more is known of its objects."""
        network = self._network
        generator = network.behind(label)
        if network.is_implicit(label) or generator is None or not generator.sort.is_of_objects:
            return
        if label.objects:  # its objects are known by its own label only
            network.recall(domain_of(label))
            return
        self._streams[label] = None
        self._remake(each for each in network.labels() if isinstance(network.process(each), ObjectProcess))


def attribute_of(sort: Sort, name: str) -> tuple[Sort, View] | None:
    """A field of object states; `type`, without a field of that name, is the name of the sort."""
    for at, each in enumerate(sort.fields):
        if each.name == name:
            return Sort(each.unit or name, is_open=True), partial(_component, at)
    return (Sort(TYPE, is_open=True), lambda _state: sort.name) if name == TYPE else None


def _whole(state: Value) -> Value:
    return state


def _component(at: int, state: Value) -> Value:
    value = state[at]
    return value if value == value else NO_VALUE  # noqa: PLR0124 - a NaN differs from itself


class ObjectProcess(OnDemand):
    """A process over the tables of objects."""

    remembers = REMEMBERED

    def __init__(self, tables: Sequence[ObjectTable]) -> None:
        super().__init__()
        self.tables = tuple(tables)

    def taken(self) -> Sequence[Label]:
        return [table.label for table in self.tables]

    def since_us(self) -> int:
        """Earlier samples are not kept."""
        return super().since_us() if self.running or self._network is None else self._network.now_us


class DomainStream(ObjectProcess):
    """The objects of one stream: a sample whenever some appear or vanish, valid since then.

    Objects that appear in one instant are in one sample. Valid times never go back: a change that becomes known late
    counts from the newest one.
    """

    arity, priority = 1, 0

    def __init__(self, table: ObjectTable) -> None:
        super().__init__([table])
        self._table, self._undo = table, _nothing
        self._valid_us: int | None = None
        self._told_us = 0

    def begin(self) -> None:
        self._valid_us, self._told_us = None, -(2**80)
        self._undo = self._table.follow(self._on_change)
        if self._table.newest:
            self._valid_us = max(state.valid_us for state in self._table.newest.values())
        self._tell(self._table.newest)

    def end(self) -> None:
        self._undo()
        self._undo = _nothing

    @property
    def rank(self) -> int:
        """After the stream of the states."""
        return 0 if self._network is None else 1 + self._network.rank(self._table.label)

    def on_instant(self) -> None:
        self._tell(self._table.newest)

    def _on_change(self, change: ObjectChange, _now_us: int) -> None:
        if self._network is None:
            return
        if self._valid_us is not None and change.valid_us > self._valid_us:
            there = self._table.newest
            before = (each for each in there if each != change.symbol) if change.appeared else (*there, change.symbol)
            self._tell(before)
        self._valid_us = change.valid_us
        self._network.instant.put(self)

    def _tell(self, members: Iterable[str]) -> None:
        if self._network is None:
            return
        valid_us = self._network.now_us if self._valid_us is None else self._valid_us
        self._valid_us, self._told_us = None, max(valid_us, self._told_us)
        self.emit(Sample(self._network.now_us, self._told_us, NamedMembers(members)))


class ObjectFeature(ObjectProcess):
    """A part of the states of one object, from the first of several streams that has it.

    Args:
        sources: the streams that may have the object, with the view of a state.
    """

    def __init__(self, symbol: str, sources: Sequence[tuple[ObjectTable, View]]) -> None:
        super().__init__([table for table, _ in sources])
        self._symbol, self._sources = symbol, sources
        self._undo: list[Undo] = []

    def begin(self) -> None:
        self._undo = [
            table.follow_one(self._symbol, partial(self._on_state, i)) for i, (table, _) in enumerate(self._sources)
        ]

    def end(self) -> None:
        undo, self._undo = self._undo, []
        for each in undo:
            each()

    def _on_state(self, i: int, state: Sample) -> None:
        if any(self._symbol in table.newest for table, _ in self._sources[:i]):
            return
        now_us = state.available_us if self._network is None else max(state.available_us, self._network.now_us)
        quality = state.quality._replace(covariance=()) if state.quality.covariance else state.quality
        self.emit(Sample(now_us, state.valid_us, self._sources[i][1](state.value), quality))


def _nothing() -> None:
    """Nothing is followed."""


def domain_of(label: Label) -> Label:
    """The domain of a stream of object states."""
    return Label(f"{label.feature}.{OBJECTS}", label.objects)
