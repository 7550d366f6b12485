"""Does a specification make a network? Names, arities, sorts, cycles, and what nobody can reach (thesis 4.4, 4.5).

Labels of members (`pos[car]` in `for car in ...`, select and merge) stand for all labels that they can become.
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from functools import cached_property
from typing import NamedTuple

from dyknow.errors import TextError
from dyknow.labels import Label
from kpl.complaints import Complaints
from kpl.declared import CHRONICLE, GENERATOR, MAKER, MARGIN, RECOGNISED, Declared, Made, names_of, needs_of, stem
from kpl.formula_checking import FormulaChecker
from kpl.known import ANY, Known, Streams
from kpl.specification import (
    Declaration,
    Define,
    Export,
    ForEach,
    FromSource,
    GeneratorDeclaration,
    Import,
    Link,
    Merge,
    MonitorDeclaration,
    Refinement,
    Select,
    SourceDeclaration,
    StreamTerm,
    UnitDeclaration,
)
from kpl.suspicions import suspicions
from reasoning.formulas import Node

LONGEST_CHAIN = 64
"""Samples flow by plain calls: so many processes may follow one another."""
WORDS = ("state", "select", "merge", "link")


class Findings(NamedTuple):
    """What is wrong with a specification, and what is only suspicious, each in the order of the text."""

    errors: tuple[TextError, ...]
    warnings: tuple[TextError, ...]


def check_specification(
    specification: Iterable[Declaration], known: Known | None = None, text: str = "", file: str = ""
) -> Findings:
    """Look at all declarations together; `text` and `file` are what they were read from, for the drawing of errors."""
    every = tuple(specification)
    checker = _Checker(Declared(every), known or Known(), text, file)
    checker.check(every, every)
    known = checker.known
    suspicious = suspicions(every, checker.declared, known.labels, known.figures, checker)
    return Findings(_in_order(checker.errors), _in_order(suspicious))


def check_change(
    declared: Declared,
    gone: Sequence[Declaration],
    new: Sequence[Declaration],
    known: Known,
    text: str = "",
    file: str = "",
) -> tuple[TextError, ...]:
    """What is wrong with `declared` now that these have gone and come, if nothing was before: as if all were looked at.

    Looked at is what is new, and what depends on what changed.
    """
    touched = {id(each): each for each in new}
    waiting = [*gone, *new]
    while waiting:
        changed = waiting.pop()
        for each in declared.dependent(changed):
            if id(each) not in touched:
                touched[id(each)] = each
                waiting.append(each)  # its sort may be another one now, and chains through it longer
    checker = _Checker(declared, known, text, file)
    checker.check(new, tuple(touched.values()))
    return _in_order(checker.errors)


class _Checker(Complaints):
    def __init__(self, declared: Declared, known: Known, text: str, file: str) -> None:
        super().__init__(text, file)
        self.declared, self.known = declared, known
        self.streams = Streams(declared, known)

    @cached_property
    def _formulas(self) -> FormulaChecker:
        return FormulaChecker(self.streams, self)

    def check(self, new: Sequence[Declaration], touched: Sequence[Declaration]) -> None:
        """`new` are from the text, the others that are touched run already."""
        from_text = {id(each) for each in new}
        for each in touched:
            self.of, self.is_old = each, id(each) not in from_text
            if not self.is_old:
                self._check_names(each)
                self._check(each)
            self._check_making(each)
            self._check_inputs(each)
            if isinstance(each, Define | MonitorDeclaration):
                self._formulas.look_at(each)
        self.of = None
        self._check_chains(touched, from_text)

    # Names

    def _check_names(self, declaration: Declaration) -> None:
        for kind, name in names_of(declaration):
            before = next(iter(self.declared.named[kind, name].values()))
            said = name[0] if isinstance(name, tuple) and not isinstance(name, Label) else name
            if before is not declaration:
                where = "the running instance" if before in self.known.running else f"line {before.place.line}"
                self.wrong(f"{said} is {kind} already, in {where}", declaration, "another name")
            elif (kind == GENERATOR and name in self.known.labels) or (kind == MAKER and self._is_other(declaration)):
                self.wrong(f"{said} is {kind} already, in the running instance", declaration, "another name")

    def _is_other(self, declaration: Declaration) -> bool:
        """Whether there is a unit under the name of a source, or a source under that of a unit."""
        if isinstance(declaration, SourceDeclaration):
            return declaration.name in self.known.units
        return isinstance(declaration, UnitDeclaration) and declaration.name in self.known.sources

    # Declarations, one by one

    def _check(self, declaration: Declaration) -> None:
        match declaration:
            case SourceDeclaration(sort, _):
                self._sort(sort, declaration)
            case UnitDeclaration(sort, _, inputs):
                for each in dict.fromkeys((sort, *inputs)):
                    self._sort(each, declaration)
            case ForEach(variable, _, body):
                if variable not in body.label.objects:
                    self.wrong(
                        f"every member of the stream would make {body.label}",
                        body,
                        f"{body.label.feature}[{', '.join((variable, *body.label.objects))}]",
                    )
            case Import(semantic) | Export(semantic):
                if self.known.semantic is not None and semantic not in self.known.semantic:
                    some = ", ".join(sorted(self.known.semantic)[:8])
                    repair = self.closest(semantic, self.known.semantic) or f"one that it has, such as {some}"
                    self.wrong(f"the ontology has no label {semantic}", declaration, repair)

    def _check_making(self, declaration: Declaration) -> None:
        body = declaration.body if isinstance(declaration, ForEach) else declaration
        made = body.made if isinstance(body, GeneratorDeclaration) else None
        match made:
            case FromSource(source):
                self._from_source(source, made)
            case Refinement(unit, inputs):
                self._unit(unit, len(inputs), made)
            case Link(_, unit):
                self._unit(unit, 1, made)
            case Select(term, variable) | Merge(term, variable):
                if variable not in term.label.objects:
                    self.wrong(
                        f"{term.label} is the same for every {variable}", made, f"{term.label.feature}[{variable}]"
                    )

    def _from_source(self, source: str, made: Node) -> None:
        if self.streams.source(source) is not None or source in self.known.unread:
            return
        declared = self.streams.unit(source)
        sources = (*self.declared.sources(), *self.known.sources, *self.known.offered)
        if declared is not None:
            self.wrong(f"{source} is a unit, which takes streams", made, f"{source}({', '.join(declared[1])})")
        elif any(True for _ in self.declared.makers(Label(source))):
            units = [*self.declared.units(), "Unit"]
            self.wrong(f"{source} is a stream, and no source: units take streams", made, f"{units[0]}({source})")
        else:
            repair = self.closest(source, sources) or f"source SORT {source}, before it"
            self.wrong(f"{source} is no source that is declared", made, repair)

    def _unit(self, unit: str, arity: int, made: Node) -> None:
        declared = self.streams.unit(unit)
        if unit in self.known.unread:
            return
        if declared is None:
            is_source = self.streams.source(unit) is not None
            kind = "a source, which takes no streams" if is_source else "no computational unit that is declared"
            units = (*self.declared.units(), *self.known.units, *self.known.offered, *WORDS)
            repair = unit if is_source else self.closest(unit, units)
            sorts = ", ".join(["SORT"] * arity)
            self.wrong(f"{unit} is {kind}", made, repair or f"compunit SORT {unit}({sorts}), before it")
        elif len(declared[1]) != arity:
            takes = ", ".join(declared[1])
            self.wrong(
                f"{unit} takes {len(declared[1])} stream{'s' * (len(declared[1]) != 1)} ({takes}), not {arity}",
                made,
                f"{unit}({takes})",
            )

    def _sort(self, sort: str, node: Node) -> None:
        if self.known.sorts is not None and sort not in self.known.sorts:
            self.wrong(f"there is no sort {sort}", node, self.closest(sort, self.known.sorts))

    # Inputs: are they there, and of the right sort

    def _check_inputs(self, declaration: Declaration) -> None:
        for need in needs_of(declaration):
            self._present(need.term, need.variables)
        body = declaration.body if isinstance(declaration, ForEach) else declaration
        if isinstance(declaration, ForEach):
            self._names_objects(declaration.domain, frozenset())
        if isinstance(body, GeneratorDeclaration) and isinstance(body.made, Select | Merge):
            self._names_objects(body.made.domain, self.declared.made[id(declaration)].variables)
        if isinstance(body, GeneratorDeclaration) and isinstance(body.made, Refinement):
            self._check_sorts(body.made, self.declared.made[id(declaration)].variables)

    def _check_sorts(self, made: Refinement, variables: frozenset[str]) -> None:
        declared = self.streams.unit(made.unit)
        if declared is None or len(declared[1]) != len(made.inputs):
            return
        for wanted, term in zip(declared[1], made.inputs, strict=True):
            sort = self.streams.sort_of(term.label, variables)
            if sort is not None and sort != wanted and not wanted.startswith(ANY):
                self.wrong(f"{made.unit} takes {wanted} here; {term.label} is {sort}", term, f"a stream of {wanted}")

    def _present(self, term: StreamTerm, variables: frozenset[str]) -> None:
        label = term.label
        if label.feature in self.known.figures and len(label.objects) == 1:
            if label.feature == MARGIN and label.objects[0] not in variables:
                self._formulas.margin(label.objects[0], term)
            return
        if label.feature == RECOGNISED and any((CHRONICLE, name) in self.declared.named for name in label.objects[:1]):
            return
        if self.streams.has(label, variables):
            lacking = self.streams.lacks(label, variables)
            if lacking is not None:
                self.wrong(lacking[0], term, lacking[1])
            return
        if stem(label) in self.known.unread:
            return
        if not label.objects and self.streams.source(label.feature) is not None:
            said = f"nothing makes {label}, which is a source: a stream is taken from a generator that is made from it"
            made = next((made.label for made in self.declared.made.values() if _source_of(made) == label.feature), None)
            self.wrong(said, term, str(made or f"strmgen {label}_stream = {label}, before it"))
            return
        own = self.declared.made.get(id(self.of))
        names = (*(made.label for made in self.declared.made.values() if made is not own), *self.known.labels)
        self.unmade(f"nothing makes {label}", term, label, self.closest(str(label), names))

    def _names_objects(self, domain: StreamTerm, variables: frozenset[str]) -> None:
        """A stream of members is one of objects, or of sets of them."""
        said = self.streams.names_no_objects(domain.label, variables)
        if said:
            self.wrong(said, domain, "a stream of objects, or of sets of them")

    # The whole

    def _check_chains(self, touched: Sequence[Declaration], from_text: Collection[int]) -> None:
        """A generator that needs, by whatever way, what it makes itself; each cycle is told once. And long chains."""
        depth: dict[int, int] = {}  # 0 while it is on the path
        told = False
        for start in touched:
            made = self.declared.made.get(id(start))
            path: list[tuple[Made, Iterator[Made]]] = []
            if made is not None:
                self._enter(made, depth, path)
            while path:
                made, rest = path[-1]
                after = next(rest, None)
                if after is None:
                    path.pop()
                    depth[id(made)] = 1 + max((depth[id(one)] for one in self._before(made)), default=0)
                    if depth[id(made)] > LONGEST_CHAIN and not told:
                        told = True
                        self._at(made, from_text)
                        self.wrong(
                            f"{made.label} is at the end of a chain of more than {LONGEST_CHAIN} processes",
                            made.node,
                            f"chains of at most {LONGEST_CHAIN}",
                        )
                elif depth.get(id(after)) == 0:
                    at = next(i for i, (one, _) in enumerate(path) if one is after)
                    around = " <- ".join(str(one.label) for one in [*(one for one, _ in path[at:]), after])
                    self._at(made, from_text)
                    self.wrong(f"a cycle: {around}", made.node, "a stream from outside the cycle")
                else:
                    self._enter(after, depth, path)

    def _at(self, made: Made, from_text: Collection[int]) -> None:
        self.of, self.is_old = made.node, id(made.node) not in from_text

    def _before(self, made: Made) -> Iterable[Made]:
        """What it needs."""
        return {
            id(one): one for need in made.needs for one in self.declared.makers(need.term.label, need.variables)
        }.values()

    def _enter(self, made: Made, depth: dict[int, int], path: list[tuple[Made, Iterator[Made]]]) -> None:
        if id(made) not in depth:
            depth[id(made)] = 0
            path.append((made, iter(self._before(made))))


def _in_order(errors: list[TextError]) -> tuple[TextError, ...]:
    return tuple(sorted(errors, key=lambda error: (error.line, error.column)))


def _source_of(made: Made) -> str | None:
    body = made.body
    return body.made.source if isinstance(body, GeneratorDeclaration) and isinstance(body.made, FromSource) else None
