"""In which order declarations are taken in, and how errors are reported."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields, replace
from operator import is_
from typing import Any, NamedTuple

from dyknow.kpl.checking.definitions import Definitions
from dyknow.kpl.checking.symbols import SymbolTable, symbol_of
from dyknow.kpl.linking.declarations import linkages
from dyknow.kpl.syntax import specification as spec
from dyknow.kpl.syntax.parsing import raise_all
from dyknow.model.errors import PolicyError, TextError, TextErrors, TooEarly, file_of
from dyknow.model.instants import US_PER_MS, print_span
from dyknow.model.labels import Label
from dyknow.policies.policy import Policy

_CONSTRAINED = (
    spec.StreamTerm, spec.Refinement, spec.StateStream, spec.Select, spec.Merge, spec.FirstOf, spec.GeneratorDeclaration,
    spec.ForEach, spec.StreamDeclaration, spec.Export, spec.Import, spec.MonitorDeclaration,
)  # fmt: skip
"""Parts of declarations that have a policy, or contain one that has."""


class SpecificationChange(NamedTuple):
    """The declarations that go, those that come, and all that are wanted."""

    gone: list[spec.Declaration]
    new: list[spec.Declaration]
    wanted: spec.Specification


def difference(before: spec.Specification, wanted: Iterable[spec.Declaration]) -> SpecificationChange:
    """The removed, new and resulting declarations, the last in terms of running ones: equal declarations are one.

    Running declarations are recognised by identity, so that a small change costs few comparisons.
    """
    running = {id(each): each for each in before}
    staying = set[int]()
    after: list[spec.Declaration] = []
    others: list[int] = []
    for each in wanted:
        if id(each) in running and id(each) not in staying:
            staying.add(id(each))
            after.append(each)
        else:
            others.append(len(after))
            after.append(replace(each))  # two declarations of equal text are two
    left = {each: each for each in before if id(each) not in staying} if others else {}
    new: list[spec.Declaration] = []
    for at in others:
        same = left.pop(after[at], None)
        if same is None:
            new.append(after[at])
        else:
            staying.add(id(same))
            after[at] = same
    return SpecificationChange([each for each in before if id(each) not in staying], new, tuple(after))


def resolved(node: Any, now_us: int) -> Any:
    """A declaration, or a part of one, with instants for times relative to its declaration, which is now.

    Raises:
        TextError: a duration ends before it starts.
    """
    if isinstance(node, Policy):
        return node.at(now_us)
    if type(node) is tuple:
        parts = tuple(resolved(each, now_us) for each in node)
        return node if all(map(is_, parts, node)) else parts
    if not isinstance(node, _CONSTRAINED):
        return node
    try:
        every = {
            each.name: (getattr(node, each.name), resolved(getattr(node, each.name), now_us)) for each in fields(node)
        }
    except PolicyError as wrong:
        raise TextError.at(node.place, str(wrong), repair=wrong.repair) from None
    other = {name: new for name, (old, new) in every.items() if new is not old}
    return replace(node, **other) if other else node


class DeclaredTimes:
    """Times relative to the moment of declaration: resolved once, however often the same text is read again."""

    def __init__(self) -> None:
        self._resolved: dict[spec.Declaration, spec.Declaration] = {}
        self._tried: dict[spec.Declaration, spec.Declaration] = {}

    def change(
        self, before: spec.Specification, wanted: spec.Specification, now_us: int, text: str
    ) -> SpecificationChange:
        """The `difference`, with instants in place of offsets; declarations that run keep their instants.

        Raises:
            TextErrors: durations end before they start.
        """
        change, errors = difference(before, wanted), list[TextError]()
        self._tried = {}
        for each in change.new:
            try:
                if (meant := resolved(self.declared(each), now_us)) is not each:
                    self._tried[each] = meant
            except TextError as wrong:
                errors.append(in_text(wrong, text))
        raise_all(errors)
        if not self._tried:
            return change
        new = {id(each): self._tried.get(each, each) for each in change.new}
        return difference(before, [new.get(id(each), each) for each in change.wanted])

    def declared(self, written: spec.Declaration) -> spec.Declaration:
        """The running declaration of this text, with its instants; else the same."""
        return self._resolved.get(written, written) if self._resolved else written

    def settle(self, wanted: spec.Specification) -> None:
        """The change succeeded: keep the instants of its declarations."""
        if every := {**self._resolved, **self._tried}:
            held = set(wanted)
            self._resolved = {written: meant for written, meant in every.items() if meant in held}


def needed_first(change: SpecificationChange, is_past: Callable[[spec.StreamTerm], bool]) -> list[spec.Declaration]:
    """New streams that begin in the past, after the parts they may need; without those whose name is still in use."""
    streams = [each for each in change.new if isinstance(each, spec.StreamDeclaration) and is_past(each.term)]
    if not streams:
        return []
    parts = spec.SourceDeclaration | spec.UnitDeclaration | spec.GeneratorDeclaration
    taken = {name for each in change.gone for name in _names(each)}
    first = (*(each for each in change.new if isinstance(each, parts)), *streams)
    return [each for each in first if taken.isdisjoint(_names(each))]


def _names(declaration: spec.Declaration) -> list[tuple[str, object]]:
    symbol = symbol_of(declaration)
    return [(symbol.kind, name) for name in symbol.names]


def meanings(symbols: SymbolTable, change: SpecificationChange, unit: str) -> Iterator[tuple[spec.Declaration, object]]:
    """The meaning of each declaration that stays and depends on others: monitors with definitions expanded, links with
    their chains.

    Raises:
        TextError: a formula is wrong with them.
    """
    changed, new = (*change.gone, *change.new), {id(each) for each in change.new}
    if any(isinstance(each, spec.Define) for each in changed):
        definitions = Definitions(symbols)
        for each in change.wanted:
            if id(each) not in new and (monitor := spec.monitor_of(each)) is not None:
                yield each, definitions.resolved(monitor.formula, unit)
            elif id(each) not in new and isinstance(each, spec.WantDeclaration):
                yield each, definitions.resolved(each.description, unit)
    if any(isinstance(each, spec.Define | spec.RoadsDeclaration | spec.GeneratorDeclaration) for each in changed):
        yield from linkages(symbols, change.wanted, new)


def _makers(specification: Iterable[spec.Declaration]) -> list[spec.Declaration]:
    """Without the links after the first with one label: one stream is made of them all."""
    linked = set[Label]()
    found = []
    for each in specification:
        if isinstance(each, spec.GeneratorDeclaration) and isinstance(each.made, spec.Link):
            if each.label in linked:
                continue
            linked.add(each.label)
        found.append(each)
    return found


def made_by(
    change: SpecificationChange, before: spec.Specification
) -> tuple[SpecificationChange, list[spec.Declaration]]:
    """The change to makers of streams, in order, and earlier makers; where a first link goes, the next takes over."""
    left, right = _makers(before), _makers(change.wanted)
    gone, new = change.gone, change.new
    if len(left) < len(before) or len(right) < len(change.wanted):
        running, wanted = {id(each) for each in left}, {id(each) for each in right}
        gone = [each for each in left if id(each) not in wanted]
        new = [each for each in right if id(each) not in running]
    gone, new = sorted(gone, key=rank, reverse=True), sorted(new, key=rank)
    return SpecificationChange(gone, new, change.wanted), left


def rank(declaration: spec.Declaration) -> int:
    """Makers first, then what goes to other platforms, then subscribers of streams."""
    ranks = {
        spec.SortDeclaration: -1,
        spec.LabelDeclaration: -1,
        spec.Import: 1,
        spec.Export: 2,
        spec.StreamDeclaration: 3,
        spec.MonitorDeclaration: 4,
        spec.WantDeclaration: 4,
    }
    return ranks.get(type(declaration), 0)


def in_text(wrong: TextError, text: str, repair: str = "") -> TextError:
    """The error with the text it is about."""
    return wrong.but(text=wrong.text or text, repair=wrong.repair or repair, file=wrong.file or file_of(text))


def as_text_errors(wrong: BaseException, text: str) -> TextErrors:
    if isinstance(wrong, TextErrors):
        return wrong
    if isinstance(wrong, TextError):
        return TextErrors((in_text(wrong, text),))
    said = "a chain of streams is too long" if isinstance(wrong, RecursionError) else str(wrong)
    return TextErrors((TextError(said, text=text),))


def together(errors: Iterable[TextError], more: Iterable[TextError]) -> list[TextError]:
    """Both, without repetitions, and one error a statement."""
    found = list(errors)
    lines = {each.line for each in found}
    told = set[tuple[int, int, str]]()
    for each in more:
        if each.line not in lines and (each.line, each.column, each.message) not in told:
            told.add((each.line, each.column, each.message))
            found.append(each)
    return found


def too_early(wrong: TooEarly, now_us: int) -> tuple[str, str]:
    """How long ago is too long ago, and the earliest beginning as it is written."""
    asked, held = print_span(now_us - wrong.from_us), print_span(now_us - wrong.earliest_us)
    if wrong.earliest_us >= now_us:
        return f"{wrong.what} cannot begin {asked} ago: it can begin now", "from now"
    possible = f"the earliest possible time is {held} ago"
    return f"{wrong.what} cannot begin {asked} ago: {possible}", f"from {-(-wrong.earliest_us // US_PER_MS)}"
