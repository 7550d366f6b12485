"""Wanted objects in a linkage: they are looked for, found, tracked, lost and found again, under the symbol they are wanted by."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple, Protocol

from dyknow import US_PER_S, Value
from dyknow.anchoring.links.composites import CompositeObjects
from dyknow.anchoring.links.deciding.wanted import WantedObject, described
from dyknow.anchoring.links.objects import EventKind, LinkEvent, LinkObject, LinkReason
from dyknow.anchoring.links.processes import LinkProcess
from dyknow.anchoring.links.states import ObjectState
from dyknow.reasoning.formulas.tree import Eventually, Formula

TRACKED_US: Final = US_PER_S
"""A wanted object that is in view for so long is tracked."""
_MADE: Final[tuple[EventKind, ...]] = ("established", "reestablished")
_ENDED: Final[tuple[EventKind, ...]] = ("unlinked",)


class WantedAmong(Protocol):
    """The structures among which objects are wanted."""

    def find(self, symbol: str) -> LinkObject | None:
        """A live object, or percept, by its symbol."""

    def anchored(self, symbol: str) -> bool:
        """Whether live links lead from a percept to this object."""

    def new_symbol(self, type_: str) -> str:
        """A symbol that no object of the type has."""

    def tell(self, event: LinkEvent, *about: LinkObject) -> None:
        """Something happened to these objects."""


class _Want(NamedTuple):
    """A wanted object: its type and description."""

    type: str
    description: Formula
    place: ObjectState | None
    only: str | None


@dataclass(slots=True)
class _FoundObject:
    """A wanted object since it was found.

    Attributes:
        since_us: since when it is in view; None: it is not.
    """

    one: LinkObject
    since_us: int | None
    is_tracked: bool = False


class TopDown:
    """The wanted objects of one linkage, whose tables it is given.

    Args:
        objects: by type and symbol.
        into, out_of: the processes that lead to a type, and from it.
        composites: the makers of composites, by type.
    """

    def __init__(
        self,
        among: WantedAmong,
        objects: Mapping[str, dict[str, LinkObject]],
        into: Mapping[str, Sequence[LinkProcess]],
        out_of: Mapping[str, Sequence[LinkProcess]],
        composites: Mapping[str, CompositeObjects],
    ) -> None:
        self._among, self._objects, self._into, self._out_of = among, objects, into, out_of
        self._composites = composites
        self._wants: dict[str, _Want] = {}
        self._sought: dict[str, list[WantedObject]] = {}
        self._found: dict[str, _FoundObject] = {}
        self._released: dict[str, LinkObject] = {}

    @property
    def sought(self) -> tuple[str, ...]:
        """The symbols of those that are not found."""
        return tuple(symbol for symbol in self._wants if symbol not in self._found)

    def want(
        self,
        symbol: str,
        type_: str,
        description: Formula | Mapping[str, Value],
        place: ObjectState | None = None,
        only: str | None = None,
    ) -> None:
        """Look for an object that is described: the first one below for which the description holds is given the symbol.

        It is looked for until `unwant`, and once more when it was found and forgotten.

        Args:
            symbol: of no other object.
            type_: of objects that are linked, or composites.
            description: a formula over the symbol or `from`, and over `to` if a place is given, which may become true at
                any time; or values of attributes.
            place: where it is thought to be.
            only: the symbol of the one object that it is, whatever it is like; empty: none yet; None: the first as described.

        Raises:
            ValueError: there is no link into the type, or the symbol is taken.
        """
        types = (*self._into, *self._composites)
        if type_ not in types:
            raise ValueError(f"no link leads to the type {type_!r}; there are {', '.join(types)}")
        if symbol in self._wants or (self._among.find(symbol) is not None and symbol not in self._released):
            raise ValueError(f"the symbol {symbol!r} is taken; give the wanted object another")
        formula = described(description) if isinstance(description, Mapping) else description
        self._wants[symbol] = _Want(type_, Eventually(formula), place, only)
        self._seek(symbol)

    def unwant(self, symbol: str) -> None:
        """Look for it no more; if it is found, it is known by another symbol from the next tick on."""
        if self._wants.pop(symbol, None) is not None:
            self._end_search(symbol)
            if (found := self._found.pop(symbol, None)) is not None:
                self._released[symbol] = found.one

    def _seek(self, symbol: str) -> None:
        want = self._wants[symbol]
        makers: list[LinkProcess | CompositeObjects] = [*self._into.get(want.type, ())]
        if want.type in self._composites:
            makers.append(self._composites[want.type])
        for process in makers:
            wanted = WantedObject(symbol, process.specification, want.description, want.place)
            self._sought.setdefault(process.name, []).append(wanted)

    def _end_search(self, symbol: str) -> None:
        for some in self._sought.values():
            some[:] = [each for each in some if each.symbol != symbol]

    # Wants at a tick

    def release(self, valid_us: int) -> None:
        """Give objects that are no longer wanted another symbol."""
        for symbol, one in self._released.items():
            if self._objects[one.type].get(symbol) is one:
                self._rename(valid_us, one, self._among.new_symbol(one.type), LinkReason("released"))
        self._released.clear()

    def drop(self, process: str, symbol: str) -> None:
        """An object that a process starts from is gone."""
        for wanted in self._sought.get(process, ()):
            wanted.drop(symbol)

    def seek(self, valid_us: int, process: LinkProcess, sources: Sequence[LinkObject]) -> None:
        """Find wanted objects among those in view that are not linked to what excludes their type, or was wanted itself."""
        may_be: list[tuple[LinkObject, ObjectState]] | None = None
        for wanted in tuple(self._sought.get(process.name, ())):
            only = self._wants[wanted.symbol].only
            if only is not None:
                self._take(valid_us, process, wanted.symbol, only, sources)
                continue
            if may_be is None:
                free = (one for one in sources if one.prediction is None and process.may_rename(one, self._found))
                may_be = [(one, process.estimate(one)) for one in free]
            sighting = wanted.step(valid_us, may_be)
            if sighting is not None:
                self._on_found(valid_us, process, wanted.symbol, *sighting)
                may_be = None

    def seek_composites(self, valid_us: int, composites: CompositeObjects, objects: Iterable[LinkObject]) -> None:
        """Find wanted objects among composites, whose own states are described."""
        for wanted in tuple(self._sought.get(composites.name, ())):
            if self._wants[wanted.symbol].only is not None:
                continue
            may_be = (one for one in objects if one.prediction is None and one.symbol not in self._found)
            sighting = wanted.step(valid_us, ((one, one.state) for one in may_be))
            if sighting is not None:
                one, reason = sighting
                self._end_search(wanted.symbol)
                self._rename(valid_us, one, wanted.symbol, reason)
                self._found[wanted.symbol] = _FoundObject(one, valid_us)
                self._tell(valid_us, "find", one, reason)

    def _take(self, valid_us: int, process: LinkProcess, symbol: str, only: str, sources: Sequence[LinkObject]) -> None:
        """It is decided elsewhere which object is the wanted one."""
        for one in sources:
            link = one.outgoing.get(process.name)
            if one.prediction is None and link is not None and link.target.symbol == only and only not in self._found:
                self._on_found(valid_us, process, symbol, one, LinkReason("wanted"))
                return

    def _on_found(
        self, valid_us: int, process: LinkProcess, symbol: str, source: LinkObject, reason: LinkReason
    ) -> None:
        self._end_search(symbol)
        if (link := source.outgoing.get(process.name)) is None:
            process.anchor(valid_us, source, symbol, reason)
        else:
            self._rename(valid_us, link.target, symbol, reason)
        one = self._objects[process.specification.target][symbol]
        self._found[symbol] = _FoundObject(one, valid_us)
        self._tell(valid_us, "find", one, reason, source)

    def _rename(self, valid_us: int, one: LinkObject, symbol: str, reason: LinkReason) -> None:
        """Rename an object in all tables."""
        self._among.tell(LinkEvent(valid_us, "forgotten", "", "", one.symbol, one.type, reason), one)
        before, tables = one.symbol, [self._objects[one.type], *self._tables_of(one.type)]
        for table in tables:
            if before in table:
                table[symbol] = table.pop(before)
        for process in self._into.get(one.type, ()):
            for candidates in process.candidates.values():
                candidates.rename(before, symbol)
        for process in self._out_of.get(one.type, ()):
            for wanted in self._sought.get(process.name, ()):
                wanted.rename(before, symbol)
        for composites in self._composites.values():
            if composites.specification.source == one.type:
                composites.rename(before, symbol, self._objects[composites.specification.target].values())
        one.symbol = symbol
        for link in one.incoming.values():
            self._tell(valid_us, "reestablished", one, reason, link.source)

    def _tables_of(self, type_: str) -> Iterator[dict[str, Any]]:
        """The tables of processes that are keyed by symbols of objects of a type."""
        for process in self._out_of.get(type_, ()):
            yield process.unlinked
            yield process.candidates
            yield process.trials.by_source
        for process in self._into.get(type_, ()):
            yield process.available
            yield from (waiting.pairs for waiting in process.unlinked.values())
            yield from process.trials.pairs()

    def observe(self, valid_us: int) -> None:
        """Tell what became of those that are found: at the end of a tick."""
        for symbol, found in tuple(self._found.items()):
            one = found.one
            if self._objects[one.type].get(symbol) is not one:
                if found.since_us is not None:
                    self._tell(valid_us, "lost", one, one.history[-1].reason)
                del self._found[symbol]
                self._seek(symbol)
            elif not self._among.anchored(symbol):
                if found.since_us is not None:
                    self._tell(valid_us, "lost", one, _latest(one, _ENDED).reason)
                found.since_us, found.is_tracked = None, False
            elif found.since_us is None:
                found.since_us, latest = valid_us, _latest(one, _MADE)
                self._tell(valid_us, "reacquire", one, latest.reason, self._among.find(latest.source))
            elif not found.is_tracked and valid_us - found.since_us >= TRACKED_US:
                found.is_tracked = True
                self._tell(valid_us, "track", one, LinkReason("tracked", for_us=valid_us - found.since_us))

    def _tell(
        self, valid_us: int, kind: EventKind, one: LinkObject, reason: LinkReason, source: LinkObject | None = None
    ) -> None:
        name, type_ = ("", "") if source is None else (source.symbol, source.type)
        self._among.tell(LinkEvent(valid_us, kind, name, type_, one.symbol, one.type, reason), one)


def _latest(one: LinkObject, kinds: Collection[EventKind]) -> LinkEvent:
    """The latest event of these kinds of an object, or of those below that it is linked to."""
    return max(_events(one, kinds), key=lambda each: each.valid_us)


def _events(one: LinkObject, kinds: Collection[EventKind]) -> Iterator[LinkEvent]:
    yield from (each for each in one.history if each.kind in kinds)
    for link in one.incoming.values():
        yield from _events(link.source, kinds)
