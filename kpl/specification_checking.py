"""Does a specification make a network? Names, arities, sorts, cycles, and what nobody can reach (thesis 4.4, 4.5).

Labels of members (`pos[car]` in `for car in ...`, select and merge) stand for all labels that they can become.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from typing import NamedTuple

from dyknow.errors import TextError
from dyknow.labels import Label
from kpl.declared import GENERATOR, MAKER, Declared, Made, fit, is_pattern, names_of, needs_of, stem, uses_of
from kpl.formula_monitors import domains_of
from kpl.listing import print_declaration
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
    StateStream,
    StreamTerm,
    UnitDeclaration,
)
from reasoning.derivation import FEATURES
from reasoning.formulas import Feature, Formula, Node, walk

STATE = "state"
LONGEST_CHAIN = 64
"""Samples flow by plain calls: so many processes may follow one another."""
ANY = "?"
"""How the sorts begin that stand for any: a unit that has such and is not declared is told of where it is made."""
LONGEST_GUESS = 64
LONGEST_SAID = 300
MOST_GUESSES = 50
_NONE: Mapping[str, str] = {}


class Known(NamedTuple):
    """What is there beside the specification.

    Attributes:
        sorts: the names of all sorts; None: any name is a sort.
        sources: sorts of sources that need no declaration, by name.
        units: sort and input sorts of computational units that need no declaration, by name.
        labels: sorts of generators that are there already.
        semantic: sorts of the ontology's semantic labels, by name; None: any name is one.
        running: declarations that a running instance holds already.
        figures: features of one object that an instance says of itself.
    """

    sorts: Collection[str] | None = None
    sources: Mapping[str, str] = _NONE
    units: Mapping[str, tuple[str, tuple[str, ...]]] = {}
    labels: Mapping[Label, str] = {}
    semantic: Mapping[str, str] | None = None
    running: Collection[Declaration] = ()
    figures: Collection[str] = ()


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
    return Findings(_in_order(checker.errors), _in_order(checker.suspicions(every)))


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


class _Checker:
    def __init__(self, declared: Declared, known: Known, text: str, file: str) -> None:
        self.errors: list[TextError] = []
        self._declared, self._known, self._text, self._file = declared, known, text, file
        self._sorts: dict[int, str | None] = {}
        self._known_by_stem: dict[str, list[Label]] = {}
        for label in known.labels:
            self._known_by_stem.setdefault(stem(label), []).append(label)
        self._of: Declaration | None = None
        self._old = False

    def check(self, new: Sequence[Declaration], touched: Sequence[Declaration]) -> None:
        """`new` are from the text, the others that are touched run already."""
        from_text = {id(each) for each in new}
        for each in touched:
            self._of, self._old = each, id(each) not in from_text
            if not self._old:
                self._check_names(each)
                self._check(each)
            self._check_making(each)
            self._check_inputs(each)
        self._of = None
        self._check_chains(touched, from_text)

    # Names

    def _check_names(self, declaration: Declaration) -> None:
        for kind, name in names_of(declaration):
            before = next(iter(self._declared.named[kind, name].values()))
            said = name[0] if isinstance(name, tuple) and not isinstance(name, Label) else name
            if before is not declaration:
                where = "the running instance" if before in self._known.running else f"line {before.place.line}"
                self._wrong(f"{said} is {kind} already, in {where}", declaration, "another name")
            elif (kind == GENERATOR and name in self._known.labels) or (kind == MAKER and self._is_other(declaration)):
                self._wrong(f"{said} is {kind} already, in the running instance", declaration, "another name")

    def _is_other(self, declaration: Declaration) -> bool:
        """Whether there is a unit under the name of a source, or a source under that of a unit."""
        if isinstance(declaration, SourceDeclaration):
            return declaration.name in self._known.units
        return isinstance(declaration, UnitDeclaration) and declaration.name in self._known.sources

    def _source(self, name: str) -> str | None:
        """The sort of a source."""
        declared = self._declared.maker(name)
        return declared.sort if isinstance(declared, SourceDeclaration) else self._known.sources.get(name)

    def _unit_of(self, name: str) -> tuple[str, tuple[str, ...]] | None:
        """Sorts of a unit and of its inputs."""
        declared = self._declared.maker(name)
        return (
            (declared.sort, declared.inputs) if isinstance(declared, UnitDeclaration) else self._known.units.get(name)
        )

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
                    self._wrong(
                        f"every member of the stream would make {body.label}",
                        body,
                        f"{body.label.feature}[{', '.join((variable, *body.label.objects))}]",
                    )
            case Import(semantic) | Export(semantic):
                if self._known.semantic is not None and semantic not in self._known.semantic:
                    self._wrong(
                        f"the ontology has no label {semantic}",
                        declaration,
                        self._closest(semantic, self._known.semantic),
                    )

    def _check_making(self, declaration: Declaration) -> None:
        body = declaration.body if isinstance(declaration, ForEach) else declaration
        made = body.made if isinstance(body, GeneratorDeclaration) else None
        match made:
            case FromSource(source):
                if self._source(source) is None:
                    is_unit = self._unit_of(source) is not None
                    sources = (*self._declared.sources(), *self._known.sources)
                    repair = f"{source}(...)" if is_unit else self._closest(source, sources)
                    kind = "a unit, which takes streams" if is_unit else "no source that is declared"
                    self._wrong(f"{source} is {kind}", made, repair)
            case Refinement(unit, inputs):
                self._unit(unit, len(inputs), made)
            case Link(_, unit):
                self._unit(unit, 1, made)
            case Select(term, variable) | Merge(term, variable):
                if variable not in term.label.objects:
                    self._wrong(
                        f"{term.label} is the same for every {variable}", made, f"{term.label.feature}[{variable}]"
                    )

    def _unit(self, unit: str, arity: int, made: Node) -> None:
        declared = self._unit_of(unit)
        if declared is None:
            is_source = self._source(unit) is not None
            kind = "a source, which takes no streams" if is_source else "no computational unit that is declared"
            units = (*self._declared.units(), *self._known.units)
            self._wrong(f"{unit} is {kind}", made, unit if is_source else self._closest(unit, units))
        elif len(declared[1]) != arity:
            takes = ", ".join(declared[1])
            self._wrong(
                f"{unit} takes {len(declared[1])} stream{'s' * (len(declared[1]) != 1)} ({takes}), not {arity}",
                made,
                f"{unit}({takes})",
            )

    def _sort(self, sort: str, node: Node) -> None:
        if self._known.sorts is not None and sort not in self._known.sorts:
            self._wrong(f"there is no sort {sort}", node, self._closest(sort, self._known.sorts))

    # Inputs: are they there, and of the right sort

    def _check_inputs(self, declaration: Declaration) -> None:
        for need in needs_of(declaration):
            self._present(need.term, need.variables)
        body = declaration.body if isinstance(declaration, ForEach) else declaration
        if isinstance(body, GeneratorDeclaration) and isinstance(body.made, Refinement):
            self._check_sorts(body.made, self._declared.made[id(declaration)].variables)

    def _check_sorts(self, made: Refinement, variables: frozenset[str]) -> None:
        declared = self._unit_of(made.unit)
        if declared is None or len(declared[1]) != len(made.inputs):
            return
        for wanted, term in zip(declared[1], made.inputs, strict=True):
            sort = self._sort_of(term.label, variables, frozenset())
            if sort is not None and sort != wanted and not wanted.startswith(ANY):
                self._wrong(f"{made.unit} takes {wanted} here; {term.label} is {sort}", term, f"a stream of {wanted}")

    def _present(self, term: StreamTerm, variables: frozenset[str]) -> None:
        label = term.label
        if label.feature in self._known.figures and len(label.objects) == 1:
            return
        if any(True for _ in self._declared.makers(label, variables)) or self._is_known(label, variables):
            return
        names = (*(made.label for made in self._declared.made.values()), *self._known.labels)
        self._wrong(f"nothing makes {label}", term, self._closest(str(label), names))

    def _is_known(self, label: Label, variables: frozenset[str]) -> bool:
        if label in self._known.labels and not is_pattern(label, variables):
            return True
        return any(fit(label, variables, known, frozenset()) for known in self._known_by_stem.get(stem(label), ()))

    def _sort_of(self, label: Label, variables: frozenset[str], under: frozenset[int]) -> str | None:
        """None when it is not known, or not one."""
        for made in self._declared.makers(label, variables):
            return None if made.label.feature != label.feature or id(made) in under else self._made_sort(made, under)
        return self._known.labels.get(label)

    def _made_sort(self, made: Made, under: frozenset[int]) -> str | None:
        if id(made) not in self._sorts:
            self._sorts[id(made)] = self._found_sort(made, under | {id(made)})
        return self._sorts[id(made)]

    def _found_sort(self, made: Made, under: frozenset[int]) -> str | None:
        if isinstance(made.node, Import):
            return (self._known.semantic or _NONE).get(made.node.semantic)
        body = made.body
        match body.made if isinstance(body, GeneratorDeclaration) else None:
            case FromSource(source):
                return self._source(source)
            case Refinement(unit):
                found = self._unit_of(unit)
                return None if found is None or found[0].startswith(ANY) else found[0]
            case StateStream():
                return STATE
            case Select(term, variable) | Merge(term, variable):
                return self._sort_of(term.label, made.variables | {variable}, under)
        return None

    # The whole

    def _check_chains(self, touched: Sequence[Declaration], from_text: Collection[int]) -> None:
        """A generator that needs, by whatever way, what it makes itself; each cycle is told once. And long chains."""
        depth: dict[int, int] = {}  # 0 while it is on the path
        told = False
        for start in touched:
            made = self._declared.made.get(id(start))
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
                        self._wrong(
                            f"{made.label} is at the end of a chain of more than {LONGEST_CHAIN} processes",
                            made.node,
                            f"chains of at most {LONGEST_CHAIN}",
                        )
                elif depth.get(id(after)) == 0:
                    at = next(i for i, (one, _) in enumerate(path) if one is after)
                    around = " <- ".join(str(one.label) for one in [*(one for one, _ in path[at:]), after])
                    self._at(made, from_text)
                    self._wrong(f"a cycle: {around}", made.node, "a stream from outside the cycle")
                else:
                    self._enter(after, depth, path)

    def _at(self, made: Made, from_text: Collection[int]) -> None:
        self._of, self._old = made.node, id(made.node) not in from_text

    def _before(self, made: Made) -> Iterable[Made]:
        """What it needs."""
        return {
            id(one): one for need in made.needs for one in self._declared.makers(need.term.label, need.variables)
        }.values()

    def _enter(self, made: Made, depth: dict[int, int], path: list[tuple[Made, Iterator[Made]]]) -> None:
        if id(made) not in depth:
            depth[id(made)] = 0
            path.append((made, iter(self._before(made))))

    def suspicions(self, every: Sequence[Declaration]) -> list[TextError]:
        """Sources and units that nothing is made from, and generators whose streams nobody asks for here."""
        found: list[TextError] = []
        wanted = set[int]()
        used = set[str]()
        features = set[str]()
        for each in every:
            for need in needs_of(each):
                wanted.update(id(one) for one in self._declared.makers(need.term.label, need.variables))
            used.update(uses_of(each))
            if isinstance(each, Define | MonitorDeclaration):
                features |= {node.name for node in walk(each.formula) if isinstance(node, Feature)}
                features.update(domains_of(each.formula))
        there = {*(stem(made.label) for made in self._declared.made.values()), *map(stem, self._known.labels)}
        there |= {*self._known.figures, *FEATURES, *(each.feature.name for each in every if isinstance(each, Define))}
        for each in every:
            made = self._declared.made.get(id(each))
            if isinstance(each, SourceDeclaration | UnitDeclaration) and each.name not in used:
                found.append(self._said(f"nothing is made from {each.name}", each, ""))
            if made is not None and id(made) not in wanted and stem(made.label) not in features:
                found.append(self._said(f"nobody here asks for {made.label}", each, ""))
            if isinstance(each, Define | MonitorDeclaration):
                found += self._unread(each.formula, there)
        return found

    def _unread(self, formula: Formula, there: Collection[str]) -> list[TextError]:
        """Features of objects that nothing is called like; names without objects may be more than features."""
        return [
            self._said(
                f"nothing here makes {node.name}, so that its value stays unknown",
                node,
                self._closest(node.name, there),
            )
            for node in walk(formula)
            if isinstance(node, Feature) and node.objects and node.name not in there
        ]

    def _wrong(self, message: str, node: Node, repair: str = "") -> None:
        self.errors.append(self._said(message, node, repair))

    def _closest(self, name: str, names: Iterable[object]) -> str:
        """What may have been meant; looked for while there are few errors, since it takes its time."""
        if len(name) > LONGEST_GUESS or len(self.errors) >= MOST_GUESSES:
            return ""
        return next(iter(get_close_matches(name, list(map(str, names)), n=1)), "")

    def _said(self, message: str, node: Node, repair: str) -> TextError:
        message, repair = shortened(message), repair if len(repair) <= LONGEST_SAID else ""
        if self._old and self._of is not None:  # it is not in the text: what runs needs what is taken from it
            running = print_declaration(self._of)
            return TextError(
                f"{message}, which the running instance needs", text=running, width=len(running), repair=repair
            )
        place = node.place
        return TextError(
            message,
            text=self._text,
            line=place.line,
            column=place.column,
            width=place.width,
            repair=repair,
            file=self._file,
        )


def shortened(message: str) -> str:
    """A message without the middle of a name that is too long to be read."""
    return message if len(message) <= LONGEST_SAID else f"{message[: LONGEST_SAID - 100]}...{message[-90:]}"


def _in_order(errors: list[TextError]) -> tuple[TextError, ...]:
    return tuple(sorted(errors, key=lambda error: (error.line, error.column)))
