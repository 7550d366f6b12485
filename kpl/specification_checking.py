"""Does a specification make a network? Names, arities, sorts, cycles, and what nobody can reach (thesis 4.4, 4.5).

Labels of members (`pos[car]` in `for car in ...`, select and merge) stand for all labels that they can become.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping
from difflib import get_close_matches
from typing import NamedTuple

from dyknow.errors import TextError
from dyknow.labels import Label
from kpl.formula_monitors import domains_of
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
    StreamDeclaration,
    StreamTerm,
    UnitDeclaration,
)
from reasoning.formulas import Feature, Node, walk

STATE = "state"
SELF = "self"
ANY = "?"
"""How the sorts begin that stand for any: a unit that has such and is not declared is told of where it is made."""
LONGEST_GUESS = 64
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
    checker = _Checker(tuple(specification), known or Known(), text, file)
    checker.check()
    return Findings(_in_order(checker.errors), _in_order(checker.warnings))


class _Made(NamedTuple):
    """A generator, or a family of them: the variables stand for any object."""

    label: Label
    variables: frozenset[str]
    node: Node
    needs: tuple["_Need", ...]


class _Need(NamedTuple):
    term: StreamTerm
    variables: frozenset[str]


class _Checker:
    def __init__(self, specification: tuple[Declaration, ...], known: Known, text: str, file: str) -> None:
        self.errors: list[TextError] = []
        self.warnings: list[TextError] = []
        self._specification, self._known, self._text, self._file = specification, known, text, file
        self._sources = dict(known.sources)
        self._units = dict(known.units)
        self._made: list[_Made] = []
        self._by_feature: dict[str, list[_Made]] = {}
        self._sorts: dict[int, str | None] = {}
        self._known_by_stem: dict[str, list[Label]] = {}
        for label in known.labels:
            self._known_by_stem.setdefault(_stem(label), []).append(label)
        self._used = set[str]()

    def check(self) -> None:
        self._take_names()
        for declaration in self._specification:
            self._check(declaration)
        self._check_inputs()
        self._check_cycles()
        self._check_use()

    # Names

    def _take_names(self) -> None:
        seen: dict[tuple[str, object], Node] = {}
        for declaration in self._specification:
            match declaration:
                case SourceDeclaration(sort, name):
                    self._once(seen, ("a source or a unit", name), declaration, self._known.units)
                    self._sources[name] = sort
                case UnitDeclaration(sort, name, inputs):
                    self._once(seen, ("a source or a unit", name), declaration, self._known.sources)
                    self._units[name] = (sort, inputs)
                case GeneratorDeclaration(label):
                    self._once(seen, ("a generator", label), declaration, self._known.labels)
                    self._add(_Made(label, frozenset(), declaration, tuple(_needs(declaration, frozenset()))))
                case ForEach(variable, domain, body):
                    self._once(seen, ("a generator", body.label), declaration, self._known.labels)
                    inside = frozenset({variable})
                    needs = (_Need(domain, frozenset()), *_needs(body, inside))
                    self._add(_Made(body.label, inside, declaration, needs))
                case Import(_, _, term):
                    self._once(seen, ("a generator", term.label), declaration, self._known.labels)
                    self._add(_Made(term.label, frozenset(), declaration, ()))
                case StreamDeclaration(name):
                    self._once(seen, ("a stream", name), declaration)
                case Export(semantic):
                    self._once(seen, ("an export", semantic), declaration)
                case MonitorDeclaration(name):
                    self._once(seen, ("a monitor", name), declaration)
                case Define(feature):
                    self._once(seen, ("a definition", (feature.name, len(feature.objects))), declaration)

    def _once(
        self, seen: dict[tuple[str, object], Node], what: tuple[str, object], node: Node, there: Collection[object] = ()
    ) -> None:
        before = seen.setdefault(what, node)
        kind, name = what
        said = name[0] if isinstance(name, tuple) and not isinstance(name, Label) else name
        if before is not node:
            where = "the running instance" if before in self._known.running else f"line {before.place.line}"
            self._wrong(f"{said} is {kind} already, in {where}", node, "another name")
        elif name in there:
            self._wrong(f"{said} is {kind} already, in the running instance", node, "another name")

    def _add(self, made: _Made) -> None:
        self._made.append(made)
        self._by_feature.setdefault(made.label.feature, []).append(made)

    # Declarations, one by one

    def _check(self, declaration: Declaration) -> None:
        match declaration:
            case SourceDeclaration(sort, _):
                self._sort(sort, declaration)
            case UnitDeclaration(sort, _, inputs):
                for each in dict.fromkeys((sort, *inputs)):
                    self._sort(each, declaration)
            case GeneratorDeclaration(_, made):
                self._check_made(made)
            case ForEach(variable, _, body):
                if variable not in body.label.objects:
                    self._wrong(
                        f"every member of the stream would make {body.label}",
                        body,
                        f"{body.label.feature}[{', '.join((variable, *body.label.objects))}]",
                    )
                self._check_made(body.made)
            case Import(semantic) | Export(semantic):
                if self._known.semantic is not None and semantic not in self._known.semantic:
                    self._wrong(
                        f"the ontology has no label {semantic}",
                        declaration,
                        self._closest(semantic, self._known.semantic),
                    )

    def _check_made(self, made: Node) -> None:
        match made:
            case FromSource(source):
                self._used.add(source)
                if source not in self._sources:
                    repair = f"{source}(...)" if source in self._units else self._closest(source, self._sources)
                    kind = "a unit, which takes streams" if source in self._units else "no source that is declared"
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
        self._used.add(unit)
        declared = self._units.get(unit)
        if declared is None:
            is_source = unit in self._sources
            kind = "a source, which takes no streams" if is_source else "no computational unit that is declared"
            self._wrong(f"{unit} is {kind}", made, unit if is_source else self._closest(unit, self._units))
        elif len(declared[1]) != arity:
            takes = ", ".join(declared[1])
            self._wrong(f"{unit} takes {len(declared[1])} streams ({takes}), not {arity}", made, f"{unit}({takes})")

    def _sort(self, sort: str, node: Node) -> None:
        if self._known.sorts is not None and sort not in self._known.sorts:
            self._wrong(f"there is no sort {sort}", node, self._closest(sort, self._known.sorts))

    # Inputs: are they there, and of the right sort

    def _check_inputs(self) -> None:
        for made in self._made:
            for need in made.needs:
                self._present(need.term, need.variables)
            body = made.node.body if isinstance(made.node, ForEach) else made.node
            if isinstance(body, GeneratorDeclaration) and isinstance(body.made, Refinement):
                self._check_sorts(body.made, made.variables)
        for declaration in self._specification:
            if isinstance(declaration, StreamDeclaration | Export):
                self._present(declaration.term, frozenset())

    def _check_sorts(self, made: Refinement, variables: frozenset[str]) -> None:
        declared = self._units.get(made.unit)
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
        if any(True for _ in self._makers(label, variables)) or self._is_known(label, variables):
            return
        names = (*(made.label for made in self._made), *self._known.labels)
        self._wrong(f"nothing makes {label}", term, self._closest(str(label), names))

    def _is_known(self, label: Label, variables: frozenset[str]) -> bool:
        return any(_fit(label, variables, known, frozenset()) for known in self._known_by_stem.get(_stem(label), ()))

    def _makers(self, label: Label, variables: frozenset[str]) -> Iterator[_Made]:
        """All generators that may make this label; `cars.link[car1]` is an attribute of what `cars` makes."""
        exact = self._by_feature.get(label.feature)
        if exact is not None:
            yield from (made for made in exact if _fit(label, variables, made.label, made.variables))
        elif "." in label.feature:
            yield from self._by_feature.get(_stem(label), ())

    def _sort_of(self, label: Label, variables: frozenset[str], under: frozenset[int]) -> str | None:
        """None when it is not known, or not one."""
        for made in self._makers(label, variables):
            return None if made.label.feature != label.feature or id(made) in under else self._made_sort(made, under)
        return self._known.labels.get(label)

    def _made_sort(self, made: _Made, under: frozenset[int]) -> str | None:
        if id(made) not in self._sorts:
            self._sorts[id(made)] = self._found_sort(made, under | {id(made)})
        return self._sorts[id(made)]

    def _found_sort(self, made: _Made, under: frozenset[int]) -> str | None:
        if isinstance(made.node, Import):
            return (self._known.semantic or _NONE).get(made.node.semantic)
        body = made.node.body if isinstance(made.node, ForEach) else made.node
        match body.made if isinstance(body, GeneratorDeclaration) else None:
            case FromSource(source):
                return self._sources.get(source)
            case Refinement(unit):
                sort = self._units[unit][0] if unit in self._units else ANY
                return None if sort.startswith(ANY) else sort
            case StateStream():
                return STATE
            case Select(term, variable) | Merge(term, variable):
                return self._sort_of(term.label, made.variables | {variable}, under)
        return None

    # The whole

    def _check_cycles(self) -> None:
        """A generator that needs, by whatever way, what it makes itself. Each cycle is told once."""
        state: dict[int, int] = {}
        for start in self._made:
            path: list[tuple[_Made, Iterator[_Made]]] = []
            self._enter(start, state, path)
            while path:
                made, rest = path[-1]
                after = next(rest, None)
                if after is None:
                    state[id(made)] = 2
                    path.pop()
                elif state.get(id(after)) == 1:
                    at = next(i for i, (one, _) in enumerate(path) if one is after)
                    around = " <- ".join(str(one.label) for one in [*(one for one, _ in path[at:]), after])
                    self._wrong(f"a cycle: {around}", made.node, "a stream from outside the cycle")
                else:
                    self._enter(after, state, path)

    def _enter(self, made: _Made, state: dict[int, int], path: list[tuple[_Made, Iterator[_Made]]]) -> None:
        if id(made) not in state:
            state[id(made)] = 1
            after = {id(one): one for need in made.needs for one in self._makers(need.term.label, need.variables)}
            path.append((made, iter(after.values())))

    def _check_use(self) -> None:
        """Sources and units that nothing is made from, and generators whose streams nobody asks for here."""
        wanted = set[int]()
        for made in self._made:
            for need in made.needs:
                wanted.update(id(one) for one in self._makers(need.term.label, need.variables))
        features = set[str]()
        for declaration in self._specification:
            match declaration:
                case SourceDeclaration(_, name) | UnitDeclaration(_, name):
                    if name not in self._used:
                        self._suspicious(f"nothing is made from {name}", declaration)
                case StreamDeclaration(_, term) | Export(_, term):
                    wanted.update(id(one) for one in self._makers(term.label, frozenset()))
                case Define(_, formula) | MonitorDeclaration(_, formula):
                    features |= {node.name for node in walk(formula) if isinstance(node, Feature)}
                    features.update(domains_of(formula))
        for made in self._made:
            if id(made) not in wanted and _stem(made.label) not in features:
                self._suspicious(f"nobody here asks for {made.label}", made.node)

    def _wrong(self, message: str, node: Node, repair: str = "") -> None:
        self.errors.append(self._said(message, node, repair))

    def _suspicious(self, message: str, node: Node) -> None:
        self.warnings.append(self._said(message, node, ""))

    def _closest(self, name: str, names: Iterable[object]) -> str:
        """What may have been meant; looked for while there are few errors, since it takes its time."""
        if len(name) > LONGEST_GUESS or len(self.errors) >= MOST_GUESSES:
            return ""
        return next(iter(get_close_matches(name, list(map(str, names)), n=1)), "")

    def _said(self, message: str, node: Node, repair: str) -> TextError:
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


def _needs(declaration: GeneratorDeclaration, variables: frozenset[str]) -> Iterator[_Need]:
    match declaration.made:
        case Refinement(_, inputs) | StateStream(inputs):
            yield from (_Need(term, variables) for term in inputs)
        case Link(source):
            yield _Need(StreamTerm(source, place=declaration.made.place), variables)
        case Select(term, variable, domain) | Merge(term, variable, domain):
            yield _Need(domain, variables)
            yield _Need(term, variables | {variable})


def _fit(one: Label, free: frozenset[str], other: Label, also_free: frozenset[str]) -> bool:
    """Whether two labels of one feature can become the same: free objects stand for any, `self` for one unit."""
    return len(one.objects) == len(other.objects) and all(
        a in free or b in also_free or a == b or SELF in (a, b) for a, b in zip(one.objects, other.objects, strict=True)
    )


def _stem(label: Label) -> str:
    return label.feature.partition(".")[0]


def _in_order(errors: list[TextError]) -> tuple[TextError, ...]:
    return tuple(sorted(errors, key=lambda error: (error.line, error.column)))
