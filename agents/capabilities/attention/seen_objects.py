"""The objects in the streams of a platform, with all hypotheses about those that its own links make."""

from collections.abc import Collection, Iterator, Sequence
from typing import Any, Protocol

from dyknow import NO_VALUE, Label, Sample
from dyknow.anchoring.attention.watched import WatchedObject, WatchedPlace, moved_on, watched
from dyknow.anchoring.links.specification import LinkSpecification
from dyknow.anchoring.links.structures import ObjectLinkage
from dyknow.kpl import Instance
from dyknow.objects.object_table import ObjectChange, ObjectTable, Undo

_FIELDS = ("x_m", "y_m", "anchored")
"""Without these a stream is not one of objects that may be looked for."""
_SD_M = 3.0


class _Links(Protocol):
    """A process that links objects."""

    linkage: ObjectLinkage
    specifications: Sequence[LinkSpecification]


class SeenObjects:
    """Reads them while somewhere a task holds them; streams that are computed on demand are computed for it. Federation time."""

    def __init__(self, instance: Instance) -> None:
        self._instance = instance
        self._holders = set[str]()
        self._held: dict[Label, tuple[ObjectTable, Undo]] = {}

    def hold(self, task: str) -> None:
        """Have the streams computed from now on, for that task."""
        self._holders.add(task)
        self._take()

    def release(self, task: str) -> None:
        """The task needs them no more."""
        self._holders.discard(task)
        if not self._holders:
            for _, undo in self._held.values():
                undo()
            self._held.clear()

    def read(self, now_us: int, followed: Collection[str] = ()) -> list[WatchedObject]:
        """All objects, where they may be now; each symbol once, that of the platform's own links first."""
        if self._holders:
            self._take()
        found: dict[str, WatchedObject] = {}
        for links in self._links():
            for each in watched(links.linkage, links.specifications, followed, now_us):
                found.setdefault(each.symbol, each)
        for table in self._tables():
            if not hasattr(self._instance.network.process(table.label), "linkage"):
                for each in _of_table(table, now_us, followed):
                    found.setdefault(each.symbol, each)
        return list(found.values())

    def names(self) -> list[str]:
        """The symbols of all objects, of every level; percepts are none, nor is what is wanted and was not found."""
        found = {symbol for table in self._tables() for symbol, _ in table.read()}
        for links in self._links():
            found |= {symbol for one in links.specifications for symbol in links.linkage.objects(one.target)}
        return sorted(found - {symbol for links in self._links() for symbol in links.linkage.wanted})

    def _tables(self) -> list[ObjectTable]:
        tables = self._instance.parts.objects.tables()
        return [each for each in tables if {field.name for field in each.sort.fields}.issuperset(_FIELDS)]

    def _links(self) -> list[_Links]:
        """One process of each linkage: declarations that are chained share one."""
        made: list[Any] = [self._instance.network.process(each.label) for each in self._tables()]
        return list({id(each.linkage): each for each in made if hasattr(each, "linkage")}.values())

    def _take(self) -> None:
        """Follow the streams that are there; changes of the specification change them."""
        tables = {each.label: each for each in self._tables()}
        for label, (table, undo) in tuple(self._held.items()):
            if tables.get(label) is not table:
                undo()
                del self._held[label]
        for label, table in tables.items():
            if label not in self._held:
                self._held[label] = table, table.follow(_ignore)


def _ignore(_change: ObjectChange, _now_us: int) -> None:
    """The tables are read when needed."""


def _of_table(table: ObjectTable, now_us: int, followed: Collection[str]) -> Iterator[WatchedObject]:
    """Objects with one place each, from their newest states."""
    names = [each.name for each in table.sort.fields]
    for symbol, sample in table.read():
        state = dict(zip(names, sample.value, strict=True))
        if state["x_m"] is NO_VALUE or state["y_m"] is NO_VALUE:
            continue
        place = moved_on(_place(state), sample.valid_us, now_us)
        interest = "followed" if symbol in followed else "known"
        yield WatchedObject(symbol, (place,), _seen_us(sample, state), state["anchored"] is True, interest)  # type: ignore[arg-type]


def _seen_us(sample: Sample, state: dict[str, Any]) -> int:
    return sample.valid_us if state["anchored"] is True else sample.valid_us - 1


def _place(state: dict[str, Any]) -> WatchedPlace:
    def number(name: str, otherwise: float) -> float:
        value = state.get(name, NO_VALUE)
        return otherwise if value is NO_VALUE else float(value)

    return WatchedPlace(
        float(state["x_m"]), float(state["y_m"]), number("vx_m_s", 0.0), number("vy_m_s", 0.0), number("sd_m", _SD_M)
    )
