"""Objects that are looked for in one instance, whichever of its linkages may find them (top-down identification)."""

from collections.abc import Callable, Iterable, Iterator
from typing import Final, NamedTuple

from dyknow.anchoring.links.composites import COUNT, PARTS
from dyknow.anchoring.links.objects import LinkEvent
from dyknow.anchoring.percepts.records import ROAD_FIELDS
from dyknow.kpl.checking.definitions import Definitions
from dyknow.kpl.checking.error_collector import DeclarationErrors
from dyknow.kpl.checking.streams import Streams
from dyknow.kpl.checking.symbols import DEFINITION, LINK_UNITS, SELF, SymbolTable
from dyknow.kpl.linking.roads import ON_ROADS
from dyknow.kpl.syntax import specification as spec
from dyknow.kpl.syntax.parsing import raise_all
from dyknow.model.errors import Refused, TextError
from dyknow.model.labels import Label
from dyknow.model.values import END, SYMBOL
from dyknow.reasoning.formulas import tree
from dyknow.reasoning.formulas.tree import Formula

MOST: Final = 16
"""Every object that comes into view is compared with the description of each."""
OF_STATES: Final = ("speed", "deviation", "x", "y", "x_m", "y_m", "vx_m_s", "vy_m_s", "sd_m")
"""The attributes of every object."""
_NEED_MORE: Final = (tree.Forall, tree.Exists, tree.Occurred, tree.Since)
FOUND: Final = frozenset({"find", "track", "reacquire", "lost"})


class Wanted(NamedTuple):
    """An object that is looked for.

    Attributes:
        type: of linked objects: the label of their stream.
        description: over the symbol, in streams only.
        on_event: called when it is found, tracked, lost or found again.
        since_us: when it became wanted.
        only: which object it is, where that is decided elsewhere; empty: that is not decided yet.
    """

    symbol: str
    type: str
    description: Formula
    on_event: Callable[[LinkEvent], None] = lambda _event: None
    since_us: int = 0
    only: str | None = None


class Wants:
    """The wanted objects.

    Attributes:
        all: another value whenever it changes.
    """

    def __init__(self) -> None:
        self.all: tuple[Wanted, ...] = ()

    def add(self, wanted: Wanted) -> Callable[[], None]:
        """Look for an object until that is undone.

        Raises:
            Refused: another is looked for by that symbol, or too many are.
        """
        if any(each.symbol == wanted.symbol for each in self.all):
            raise Refused(f"{wanted.symbol} is wanted already: give it another symbol, or cancel that", "taken")
        if len(self.all) >= MOST:
            raise Refused(f"{MOST} objects are looked for already; cancel one", "too-many")
        self.all = (*self.all, wanted)

        def undo() -> None:
            self.all = tuple(each for each in self.all if each is not wanted)

        return undo

    def tell(self, events: Iterable[LinkEvent]) -> None:
        """Hand on what became of wanted objects."""
        for event in events:
            if event.kind in FOUND:
                for each in self.all:
                    if (each.symbol, each.type) == (event.target, event.target_type):
                        each.on_event(event)


def wants_in(declarations: Iterable[spec.Declaration], symbols: SymbolTable, text: str) -> list[Wanted]:
    """The wanted objects of a specification, ready for a linkage of their own.

    Raises:
        TextError: something is wrong with it.
    """
    definitions = Definitions(symbols)
    wants = [each for each in declarations if isinstance(each, spec.WantDeclaration)]
    for each in wants:
        if not any(symbols.makers(each.stream)):
            repair = f"strmgen {each.stream} = link(...), before it"
            raise TextError.at(each.place, f"no link makes {each.stream}", text=text, repair=repair)
        check_want(each, symbols, text)
    return [Wanted(each.symbol, str(each.stream), definitions.resolved(each.description, SELF, text)) for each in wants]


def check_want(want: spec.WantDeclaration, symbols: SymbolTable, text: str = "") -> None:
    """Raise TextErrors with all that is wrong with it, but for the names of streams."""
    streams, errors = Streams(symbols), DeclarationErrors(text)
    _check(want, streams, errors)
    raise_all(errors.errors)


def _check(want: spec.WantDeclaration, streams: Streams, errors: DeclarationErrors) -> None:
    chain = list(_chain(want.stream, streams))
    is_composite = any(isinstance(one.made, spec.Composite) for one in streams.symbols.makers(want.stream))
    if not chain and not is_composite:
        if not streams.has(want.stream):
            return
        linked = [each.label for each in streams.symbols.symbols() if isinstance(each.made, spec.Link)]
        said = f"no link makes {want.stream}, so that none of its objects can be found by a description"
        nearest = errors.closest(str(want.stream), linked) or next(map(str, linked), "")
        errors.wrong(said, want, f"want {want.symbol} in {nearest or 'cars, and strmgen cars = link(...)'}")
        return
    known = {*OF_STATES, PARTS, COUNT} if is_composite else _features(chain, streams)
    if isinstance(want.description, tree.Feature) and want.description.name in OF_STATES:
        errors.wrong(f"{want.description.name} is a number: a description is true or false", want, _example(want))
    for node in tree.walk(want.description):
        if isinstance(node, _NEED_MORE):
            errors.wrong("a description is of one object, at times from when it came into view", node, _example(want))
        elif isinstance(node, tree.Feature):
            _check_feature(node, want, known, streams, errors)


def _check_feature(
    node: tree.Feature, want: spec.WantDeclaration, known: set[str] | None, streams: Streams, errors: DeclarationErrors
) -> None:
    if streams.symbols.named(DEFINITION, (node.name, len(node.objects))) is not None:
        return
    if not node.objects:
        errors.wrong(f"{node.name} is no constant; a text stands in quotes", node, f'"{node.name}"')
    elif node.objects != (tree.Variable(want.symbol),):
        said = f"a description speaks of {want.symbol} alone"
        errors.wrong(said, node, f"{node.name}[{want.symbol}]")
    elif known is not None and node.name not in known:
        repair = errors.closest(node.name, known)
        said = f"objects of {want.stream} have no {node.name}; they have {', '.join(sorted(known))}"
        errors.wrong(said, node, f"{repair}[{want.symbol}]" if repair else _example(want))


def _chain(stream: Label, streams: Streams) -> Iterator[spec.Link]:
    """The links that lead to a stream, downwards."""
    seen, waiting = set[Label](), [stream]
    while waiting:
        stream = waiting.pop()
        if stream not in seen:
            seen.add(stream)
            made = [one.made for one in streams.symbols.makers(stream) if isinstance(one.made, spec.Link)]
            yield from made
            waiting += (each.source for each in made)


def _features(chain: list[spec.Link], streams: Streams) -> set[str] | None:
    """The attributes of objects of a type; None: those of the objects below are not known."""
    known = {*OF_STATES, *((ON_ROADS,) if streams.symbols.roads() is not None else ())}
    for link in chain:
        sort = streams.record(link.source)
        if sort is None or not sort.fields or link.unit not in LINK_UNITS:
            return None
        known.update(each.name for each in sort.fields)
        known.update(ROAD_FIELDS if link.unit == "OnRoad" else ())
    return known - {SYMBOL, END, "anchored"}


def _example(want: spec.WantDeclaration) -> str:
    return f"speed[{want.symbol}] > 5"
