"""Objects that are looked for in one instance, whichever of its linkages may find them (top-down identification)."""

from collections.abc import Callable, Iterable
from typing import Final, NamedTuple

from anchoring.links.objects import LinkEvent
from dyknow.model.errors import Refused
from kpl.checking.definitions import Definitions
from kpl.checking.error_collector import DeclarationErrors
from kpl.checking.streams import Streams
from kpl.checking.symbols import SELF, SymbolTable
from kpl.checking.wants import check_want
from kpl.running.ports import Undo
from kpl.syntax import specification as spec
from kpl.syntax.parsing import raise_all
from reasoning.formulas.tree import Formula

MOST: Final = 64
"""Every object that comes into view is compared with the description of each."""
FOUND: Final = frozenset({"find", "track", "reacquire", "lost"})


class Wanted(NamedTuple):
    """An object that is looked for.

    Attributes:
        type: of linked objects: the label of their stream.
        description: over the symbol, in streams only.
        on_event: called when it is found, tracked, lost or found again.
    """

    symbol: str
    type: str
    description: Formula
    on_event: Callable[[LinkEvent], None] = lambda _event: None


class Wants:
    """What is looked for.

    Attributes:
        all: another value whenever it changes.
    """

    def __init__(self) -> None:
        self.all: tuple[Wanted, ...] = ()

    def add(self, wanted: Wanted) -> Undo:
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
    """What a specification declares to be looked for, ready for a linkage of its own.

    Raises:
        TextErrors: with all that is wrong with it.
    """
    errors, streams, definitions = DeclarationErrors(text), Streams(symbols), Definitions(symbols)
    wants = [each for each in declarations if isinstance(each, spec.Want)]
    for each in wants:
        check_want(each, streams, errors)
    raise_all(errors.errors)
    return [Wanted(each.symbol, str(each.stream), definitions.resolved(each.description, SELF, text)) for each in wants]
