"""Does a specification make a network? Checks of names, arities, sorts, cycles, and unreachable declarations (thesis
4.4, 4.5).

Labels of members (`pos[car]` in `for car in ...`, select and merge) stand for all labels that they can become.
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from dyknow.kpl.checking.error_collector import DeclarationErrors
from dyknow.kpl.checking.formulas_in_context import FormulaChecker
from dyknow.kpl.checking.streams import ANY, Streams
from dyknow.kpl.checking.symbols import CHRONICLE, GENERATOR, LINK_UNITS, MAKER, MARGIN, Symbol, SymbolTable, stem
from dyknow.kpl.checking.warnings import warnings_of
from dyknow.kpl.syntax import specification as spec
from dyknow.kpl.syntax.listing import print_declaration, print_making
from dyknow.model.errors import TextError
from dyknow.model.labels import Label
from dyknow.model.values import Sort, is_kind_of
from dyknow.reasoning.formulas.tree import Node, instantiate

if TYPE_CHECKING:
    from dyknow.kpl.checking.link_conditions import ConditionChecker

LONGEST_CHAIN = 64
"""Samples flow by plain calls: this is the longest chain of processes."""
WORDS = ("state", "select", "merge", "link", "composite")


class Findings(NamedTuple):
    """Errors and warnings about a specification, each in the order of the text."""

    errors: tuple[TextError, ...]
    warnings: tuple[TextError, ...]


def check_symbols(symbols: SymbolTable, every: Sequence[spec.Declaration], text: str = "") -> Findings:
    """Look at all declarations of a table together; `text` is what they were read from, for the drawing of errors."""
    checker = _Checker(symbols, text)
    checker.check(every, every)
    return Findings(_in_order(checker.errors), _in_order(warnings_of(every, symbols, checker)))


def check_change(
    symbols: SymbolTable,
    gone: Sequence[spec.Declaration],
    new: Sequence[spec.Declaration],
    text: str = "",
) -> tuple[TextError, ...]:
    """Check a change incrementally: equals a check of all `symbols` if they were valid before the change.

    Only new declarations and dependents of the changed ones are checked.
    """
    touched = {id(each): each for each in new}
    waiting = [*gone, *new]
    while waiting:
        changed = waiting.pop()
        for each in symbols.dependent(changed):
            if id(each) not in touched:
                touched[id(each)] = each
                waiting.append(each)  # its sort may be another one now, and chains through it longer
    checker = _Checker(symbols, text)
    checker.check(new, tuple(touched.values()))
    return _in_order(checker.errors)


class _Checker(DeclarationErrors):
    def __init__(self, symbols: SymbolTable, text: str) -> None:
        super().__init__(text)
        self.symbols, self.known = symbols, symbols.known
        self.streams = Streams(symbols)

    @cached_property
    def _formulas(self) -> FormulaChecker:
        return FormulaChecker(self.streams, self)

    @cached_property
    def _conditions(self) -> "ConditionChecker":
        from dyknow.kpl.checking.link_conditions import ConditionChecker

        return ConditionChecker(self.streams, self)

    def check(self, new: Sequence[spec.Declaration], touched: Sequence[spec.Declaration]) -> None:
        """`new` are from the text, the others that are touched run already."""
        from_text = {id(each) for each in new}
        for each in touched:
            self.of, self.is_old = each, id(each) not in from_text
            if not self.is_old:
                self._check_names(each)
                self._check(each)
            self._check_making(each)
            self._check_inputs(each)
            formula, made = spec.monitor_of(each) or each, spec.making_of(each)
            if isinstance(formula, spec.Define | spec.MonitorDeclaration):
                self._formulas.look_at(formula)
            elif isinstance(made, spec.Link | spec.Composite):
                self._conditions.look_at_conditions(self.symbols.of(each).label, made)
        self.of = None
        self._check_chains(touched, from_text)

    # Names

    def _check_names(self, declaration: spec.Declaration) -> None:
        symbol = self.symbols.of(declaration)
        for name in symbol.names:
            before, kind = next(self.symbols.others(symbol, name), None), symbol.kind
            said = name[0] if isinstance(name, tuple) and not isinstance(name, Label) else name
            if before is not None:
                where = "the running instance" if before in self.known.running else f"line {before.place.line}"
                self.wrong(f"{said} is {kind} already, in {where}", declaration, "another name")
            elif (kind == GENERATOR and name in self.known.labels) or (kind == MAKER and self._is_other(declaration)):
                self.wrong(f"{said} is {kind} already, in the running instance", declaration, "another name")

    def _is_other(self, declaration: spec.Declaration) -> bool:
        """Whether there is a unit under the name of a source, or a source under that of a unit."""
        if isinstance(declaration, spec.SourceDeclaration):
            return declaration.name in self.known.units
        return isinstance(declaration, spec.UnitDeclaration) and declaration.name in self.known.sources

    # Declarations, one by one

    def _check(self, declaration: spec.Declaration) -> None:
        match declaration:
            case spec.SourceDeclaration(sort, _):
                self._sort(sort, declaration)
            case spec.UnitDeclaration(sort, _, inputs):
                for each in dict.fromkeys((sort, *inputs)):
                    self._sort(each, declaration)
            case spec.ForEach(variables, _, body):
                if not isinstance(body, spec.GeneratorDeclaration):
                    self._check(body)
                for variable in variables:
                    self._check_member(variable, body)
            case spec.SortDeclaration(sort):
                self._shape(sort, declaration)
            case spec.LabelDeclaration():
                self._label(declaration)
            case spec.Import(semantic) | spec.Export(semantic):
                names = self.symbols.semantic_names()
                if names is not None and semantic not in names and semantic not in self.known.unread:
                    repair = self.closest(semantic, names)
                    new = (
                        f'label {semantic} : SORT in UNIT "what it means", before it, or a file of labels by --ontology'
                    )
                    self.wrong(f"the ontology has no label {semantic}", declaration, repair or new)

    def _label(self, declaration: spec.LabelDeclaration) -> None:
        """A word of our own: its sort is known, and nothing else is called so."""
        sort, shape = declaration.sort, self.symbols.shape(declaration.sort.name)
        if not sort.is_open:
            self._shape(sort, declaration)
        elif shape is None:
            new = f'label {declaration.name} : {sort.name} in ppm "{declaration.meaning}"'
            self.wrong(f"what values of sort {sort.name} are is not declared", declaration, new)
        known, meant = (self.known.semantic or {}).get(declaration.name), self.symbols.semantic(declaration.name)
        if known is not None and meant is not None and known != meant:
            repair = f"label {declaration.name} : {known}, or another name"
            self.wrong(f"{declaration.name} is defined already ({known.place}), and not so", declaration, repair)

    def _shape(self, sort: Sort, declaration: spec.Declaration) -> None:
        other = self.known.values.get(sort.name) or self.symbols.shape(sort.name)
        if other is not None and not is_kind_of(sort, other):
            self.wrong(
                f"the sort {sort.name} is declared already, as {other}", declaration, f"{other}, or another name"
            )

    def _check_making(self, declaration: spec.Declaration) -> None:
        match made := spec.making_of(declaration):
            case spec.FromSource(source):
                self._from_source(source, made)
            case spec.Refinement(unit, inputs):
                self._unit(unit, len(inputs), made)
            case spec.Link(_, unit) if self.symbols.unit(unit) is not None or unit not in LINK_UNITS:
                self._linked_unit(made)
            case spec.Select(term, variable) | spec.Merge(term, variable):
                if variable not in term.label.objects:
                    self.wrong(
                        f"{term.label} is the same for every {variable}", made, f"{term.label.feature}[{variable}]"
                    )

    def _from_source(self, source: str, made: Node) -> None:
        if self.symbols.source(source) is not None or source in self.known.unread:
            return
        declared = self.symbols.unit(source)
        sources = (*self.symbols.sources(), *self.known.sources, *self.known.offered)
        if declared is not None:
            self.wrong(f"{source} is a unit, which takes streams", made, f"{source}({', '.join(declared[1])})")
        elif any(True for _ in self.symbols.makers(Label(source))):
            units = [*self.symbols.units(), "Unit"]
            self.wrong(f"{source} is a stream, and no source: units take streams", made, f"{units[0]}({source})")
        else:
            repair = self.closest(source, sources) or f"source SORT {source}, before it"
            self.wrong(f"{source} is no source that is declared", made, repair)

    def _unit(self, unit: str, arity: int, made: spec.Refinement | spec.Link) -> None:
        declared, is_link = self.symbols.unit(unit), isinstance(made, spec.Link)
        if unit in self.known.unread:
            return
        if declared is None:
            is_source = self.symbols.source(unit) is not None
            kind = "a source, which takes no streams" if is_source else "no computational unit that is declared"
            units = (*self.symbols.units(), *self.known.units, *self.known.offered, *WORDS)
            near = "" if is_source else self.closest(unit, (*units, *(LINK_UNITS if is_link else ())))
            repair = unit if is_source else print_making(replace(made, unit=near)) if near else ""
            sorts = ", ".join(["SORT"] * arity)
            self.wrong(f"{unit} is {kind}", made, repair or f"compunit SORT {unit}({sorts}), before it")
        elif len(declared[1]) != arity:
            takes = ", ".join(declared[1])
            shorter = ""
            if isinstance(made, spec.Refinement) and arity > len(declared[1]):
                shorter = print_making(replace(made, inputs=made.inputs[: len(declared[1])]))
            self.wrong(
                f"{unit} takes {len(declared[1])} stream{'s' * (len(declared[1]) != 1)} ({takes}), not {arity}",
                made,
                shorter or f"{unit}({takes})",
            )

    def _linked_unit(self, made: spec.Link) -> None:
        """Of a link: it takes the state below, and perhaps that of its own object before."""
        declared = self.symbols.unit(made.unit)
        self._unit(made.unit, 2 if declared is not None and len(declared[1]) == 2 else 1, made)
        if declared is None:
            return
        for wanted, label, sort in zip(
            declared[1], (made.source, "what it makes"), (self.streams.sort_of(made.source), declared[0]), strict=False
        ):
            if sort is not None and sort != wanted and not wanted.startswith(ANY):
                self.wrong(f"{made.unit} takes {wanted} here; {label} is {sort}", made, f"a unit that takes {sort}")

    def _sort(self, sort: str, node: Node) -> None:
        if self.known.sorts is not None and sort not in self.known.sorts:
            self.wrong(f"there is no sort {sort}", node, self.closest(sort, self.known.sorts))

    def _check_member(self, variable: str, body: spec.Declaration) -> None:
        """A declaration for each member must depend on each of its objects."""
        match body:
            case spec.GeneratorDeclaration(label):
                if variable not in label.objects:
                    own = label._replace(objects=(variable, *label.objects))
                    repair = print_declaration(replace(body, label=own))
                    self.wrong(f"every member of the stream would make {label}", body, repair)
                return
            case spec.MonitorDeclaration(_, formula):
                is_used = instantiate(formula, variable, "?") != formula
            case spec.StreamDeclaration(_, term) | spec.Export(_, term):
                is_used = variable in term.label.objects
            case spec.Import(_, _, term):
                is_used = variable in term.label.objects
            case _:
                return
        if not is_used:
            said = f"the members of the stream would all have the same: {variable} is not in it"
            self.wrong(said, body, f"pos[{variable}]")

    # Inputs: are they there, and of the right sort

    def _check_inputs(self, declaration: spec.Declaration) -> None:
        for need in self.symbols.of(declaration).takes:
            self._present(need.term, need.variables)
        if isinstance(declaration, spec.ForEach):
            self._names_objects(declaration.domain, frozenset())
        made = spec.making_of(declaration)
        if isinstance(made, spec.Select | spec.Merge):
            self._names_objects(made.domain, self.symbols.of(declaration).variables)
        elif isinstance(made, spec.Refinement):
            self._check_sorts(made, self.symbols.of(declaration).variables)
        elif isinstance(made, spec.FirstOf):
            self._check_first_of(made, self.symbols.of(declaration).variables)
        body = declaration.body if isinstance(declaration, spec.ForEach) else declaration
        if isinstance(body, spec.Export):
            self._check_export(body)

    def _check_sorts(self, made: spec.Refinement, variables: frozenset[str]) -> None:
        declared = self.symbols.unit(made.unit)
        if declared is None or len(declared[1]) != len(made.inputs):
            return
        for wanted, term in zip(declared[1], made.inputs, strict=True):
            sort = self.streams.sort_of(term.label, variables)
            if sort is not None and sort != wanted and not wanted.startswith(ANY):
                self.wrong(f"{made.unit} takes {wanted} here; {term.label} is {sort}", term, f"a stream of {wanted}")

    def _check_first_of(self, made: spec.FirstOf, variables: frozenset[str]) -> None:
        """Several streams, each once, all of one sort."""
        first, *others = made.inputs
        if not others:
            repair = f"first of {first.label}, another stream of its sort"
            self.wrong(f"{first.label} alone is the first of nothing else", made, repair)
        sort, seen = self.streams.sort_of(first.label, variables), {first.label}
        for term in others:
            if term.label in seen:
                self.wrong(f"{term.label} is named twice", term, "each stream once")
            seen.add(term.label)
            other = self.streams.sort_of(term.label, variables)
            if sort is not None and other is not None and other != sort:
                self.wrong(f"{first.label} is {sort}; {term.label} is {other}", term, f"a stream of {sort}")

    def _check_export(self, declaration: spec.Export) -> None:
        label, term = self.symbols.semantic(declaration.semantic), declaration.term
        sort = self.streams.sort_of(term.label)
        if label is not None and sort is not None and sort != label.sort.name:
            said = f"{declaration.semantic} is of sort {label.sort.name}; {term.label} is {sort}"
            self.wrong(said, term, f"a stream of {label.sort.name}")

    def _present(self, term: spec.StreamTerm, variables: frozenset[str]) -> None:
        label = term.label
        if label.feature in self.known.figures and len(label.objects) == 1:
            if label.feature == MARGIN and label.objects[0] not in variables:
                self._formulas.margin(label.objects[0], term)
            return
        recognised = any(self.symbols.named(CHRONICLE, name) for name in label.objects[:1])
        if recognised and (
            label.feature == spec.RECOGNISED or (label.feature == spec.PARTIAL and len(label.objects) == 1)
        ):
            return
        if self.streams.has(label, variables):
            lacking = self.streams.lacks(label, variables)
            if lacking is not None:
                self.wrong(lacking[0], term, lacking[1])
            return
        if stem(label) in self.known.unread or self.streams.derives(label):
            return
        if not label.objects and self.symbols.source(label.feature) is not None:
            said = f"nothing makes {label}, which is a source: a stream is taken from a generator that is made from it"
            made = (one.label for one in self.symbols.symbols() if one.made == spec.FromSource(label.feature))
            self.wrong(said, term, str(next(made, f"strmgen {label}_stream = {label}, before it")))
            return
        near = self.closest(str(label), self.symbols.labels(but=self.of, like=label))
        linking = None if self.of is None else spec.making_of(self.of)
        if near and isinstance(linking, spec.Link | spec.Composite) and label == linking.source:
            near = print_making(replace(linking, source=Label.parse(near)))
        elif near and isinstance(self.of, spec.WantDeclaration):
            near = print_declaration(replace(self.of, stream=Label.parse(near)))
        self.unmade(f"nothing makes {label}", term, label, near)

    def _names_objects(self, domain: spec.StreamTerm, variables: frozenset[str]) -> None:
        """A stream of members is one of objects, or of sets of them."""
        said = self.streams.names_no_objects(domain.label, variables)
        if said:
            self.wrong(said, domain, "a stream of objects, or of sets of them")

    # The whole

    def _check_chains(self, touched: Sequence[spec.Declaration], from_text: Collection[int]) -> None:
        """A generator that needs, by whatever way, what it makes itself; each cycle is reported once. And long chains."""
        depth: dict[int, int] = {}  # 0 while it is on the path
        told = False
        for start in touched:
            path: list[tuple[Symbol, Iterator[Symbol]]] = []
            self._enter(self.symbols.of(start), depth, path)
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
                            made.declaration,
                            f"chains of at most {LONGEST_CHAIN}",
                        )
                elif depth.get(id(after)) == 0:
                    at = next(i for i, (one, _) in enumerate(path) if one is after)
                    around = " <- ".join(str(one.label) for one in [*(one for one, _ in path[at:]), after])
                    self._at(made, from_text)
                    self.wrong(f"a cycle: {around}", made.declaration, "a stream from outside the cycle")
                else:
                    self._enter(after, depth, path)

    def _at(self, made: Symbol, from_text: Collection[int]) -> None:
        self.of, self.is_old = made.declaration, id(made.declaration) not in from_text

    def _before(self, made: Symbol) -> Iterable[Symbol]:
        """The symbols that make its inputs."""
        return {
            id(one): one for need in made.takes for one in self.symbols.makers(need.term.label, need.variables)
        }.values()

    def _enter(
        self,
        made: Symbol,
        depth: dict[int, int],
        path: list[tuple[Symbol, Iterator[Symbol]]],
    ) -> None:
        if made.label.feature and id(made) not in depth:
            depth[id(made)] = 0
            path.append((made, iter(self._before(made))))


def _in_order(errors: list[TextError]) -> tuple[TextError, ...]:
    return tuple(sorted(errors, key=lambda error: (error.line, error.column)))
