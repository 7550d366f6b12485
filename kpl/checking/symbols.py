"""The symbol table of a specification: the names of each declaration, its output and its inputs.

`symbol_of` is the one place where a kind of declaration says so. The table is kept up to date as declarations come and go,
so that a change is cheap to judge; checks, the running instance and its graph read it.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeAlias

from dyknow.kpl.checking.needs import NOTHING, Need, conditions_of, needs_of, reads_of
from dyknow.kpl.syntax import specification as spec
from dyknow.model.labels import Label
from dyknow.model.semantic_labels import SemanticLabel
from dyknow.model.values import Sort
from dyknow.reasoning.formulas import tree

if TYPE_CHECKING:
    from dyknow.anchoring.roads.network import RoadNetwork
    from dyknow.navigation.geodesy import LocalFrame

SELF = "self"
LINK_UNITS: Final = frozenset({"WorldObject", "OnRoad", "SameState"})
"""The units of links that need no declaration."""
MAKER, GENERATOR, STREAM, EXPORT = "a source or a unit", "a generator", "a stream", "an export"
MONITOR, CHRONICLE, DEFINITION = "a monitor", "a chronicle", "a definition"
SEMANTIC, SORT, ROADS, WANTED = "a semantic label", "a sort", "declared", "wanted"
MARGIN = "margin"
OF_A_PLATFORM: Final = "units"
"""The stream, and the domain of formulas, that every platform has: the platforms of its federation."""
Constant: TypeAlias = bool | int | float | str | tree.Duration
UnitSorts: TypeAlias = tuple[str, tuple[str, ...]]
"""The sort of a unit, and those of its inputs."""
_NONE: Final[Mapping[str, str]] = {}
_NO_LABEL: Final = Label("")
_Index: TypeAlias = dict[Any, dict[int, "Symbol"]]


class Known(NamedTuple):
    """Definitions outside the specification.

    Attributes:
        sorts: the names of all sorts; None: any name is a sort.
        sources: sorts of sources that need no declaration, by name.
        units: sort and input sorts of computational units that need no declaration, by name.
        labels: sorts of generators that are there already.
        semantic: the ontology's semantic labels, by name; None: any name is one.
        running, figures: declarations that an instance holds already; features of one object that it says of itself.
        values: the sorts of values, by name; values of other sorts are unchecked.
        roads, frame: those on which objects are unless others are declared; of x_m and y_m of what cameras see here.
        offered: names of what else sources and units can be made from.
        unread: words of statements that could not be read: nothing called so is missing.
    """

    sorts: Collection[str] | None = None
    sources: Mapping[str, str] = _NONE
    units: Mapping[str, UnitSorts] = {}
    labels: Mapping[Label, str] = {}
    semantic: Mapping[str, SemanticLabel] | None = None
    running: Collection[spec.Declaration] = ()
    figures: Collection[str] = ()
    values: Mapping[str, Sort] = {}
    roads: "RoadNetwork | None" = None
    frame: "LocalFrame | None" = None
    offered: Collection[str] = ()
    unread: Collection[str] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Symbol:
    """One declaration, as others see it.

    Attributes:
        kind, names: the names that no other declaration of that kind may have.
        label: of its output; without a feature there is no stream. The `variables` in it, of a family, stand for any
            object.
        takes: the streams it takes.
        reads: the streams that its formula speaks of; a domain is one, too.
    """

    declaration: spec.Declaration
    kind: str
    names: tuple[object, ...]
    label: Label = _NO_LABEL
    variables: frozenset[str] = NOTHING
    takes: tuple[Need, ...] = ()
    reads: tuple[Need, ...] = ()

    @property
    def made(self) -> spec.Making | None:
        """How what it makes is made; None: it is imported."""
        return spec.making_of(self.declaration)

    @property
    def needs(self) -> tuple[Need, ...]:
        """Its inputs and the streams that its formula reads."""
        return (*self.takes, *self.reads)

    @property
    def uses(self) -> str:
        """The source or unit it is made from; empty if it is made from none."""
        match self.made:
            case spec.FromSource(name) | spec.Refinement(name) | spec.Link(_, name):
                return name
        return ""


def symbol_of(declaration: spec.Declaration) -> Symbol:
    """The names, output and inputs of a declaration."""
    match declaration:
        case spec.SourceDeclaration(_, name) | spec.UnitDeclaration(_, name):
            return Symbol(declaration, MAKER, (name,))
        case spec.GeneratorDeclaration(label, made):
            takes, reads = tuple(needs_of(made)), reads_of(*conditions_of(made))
            return Symbol(declaration, GENERATOR, (label,), label, takes=takes, reads=reads)
        case spec.ForEach(variables, domain, body):
            free, one = frozenset(variables), symbol_of(body)
            takes = (Need(domain), *(Need(need.term, need.variables | free) for need in one.takes))
            return replace(one, declaration=declaration, variables=free, takes=takes)
        case spec.Import(_, _, term):
            return Symbol(declaration, GENERATOR, (term.label,), term.label)
        case spec.StreamDeclaration(name, term):
            return Symbol(declaration, STREAM, (name,), takes=(Need(term),))
        case spec.Export(semantic, term):
            return Symbol(declaration, EXPORT, (semantic,), takes=(Need(term),))
        case spec.LabelDeclaration(name):
            return Symbol(declaration, SEMANTIC, (name,))
        case spec.SortDeclaration():
            return Symbol(declaration, SORT, (declaration.name,))
        case spec.MonitorDeclaration(name, formula):
            return Symbol(declaration, MONITOR, (name,), reads=reads_of(formula))
        case spec.Define(feature, formula):
            return Symbol(declaration, DEFINITION, ((feature.name, len(feature.objects)),), reads=reads_of(formula))
        case spec.RoadsDeclaration():
            return Symbol(declaration, ROADS, ("roads",))
        case spec.WantDeclaration(symbol, stream, description):
            takes = (Need(spec.StreamTerm(stream, place=declaration.place)),)
            return Symbol(declaration, WANTED, (symbol,), takes=takes, reads=reads_of(description))
        case spec.ChronicleDeclaration(content=content):
            return Symbol(declaration, CHRONICLE, tuple(content.chronicles) if content is not None else ())


class SymbolTable:
    """Declarations by name, output and input, with the definitions in `known`.

    Equal ones are held apart, so that both can be complained of.
    """

    def __init__(self, declarations: Iterable[spec.Declaration] = (), known: Known | None = None) -> None:
        self.known = known or Known()
        self._symbols: dict[int, Symbol] = {}
        self._named: dict[str, _Index] = {}
        self._exact: _Index = {}
        self._patterns: _Index = {}
        self._features: _Index = {}
        self._needing: _Index = {}
        self._using: _Index = {}
        for each in declarations:
            self.add(each)

    def add(self, declaration: spec.Declaration) -> None:
        """It is declared."""
        key, symbol = id(declaration), symbol_of(declaration)
        self._symbols[key] = symbol
        for index, name in self._places(symbol):
            index.setdefault(name, {})[key] = symbol

    def discard(self, declaration: spec.Declaration) -> None:
        """It is declared no more."""
        key = id(declaration)
        symbol = self._symbols.pop(key, None)
        for index, name in () if symbol is None else self._places(symbol):
            index.get(name, {}).pop(key, None)
            if not index.get(name):
                index.pop(name, None)

    def _places(self, symbol: Symbol) -> Iterator[tuple[_Index, object]]:
        """In which indexes it stands, under which name."""
        yield from ((self._named.setdefault(symbol.kind, {}), name) for name in symbol.names)
        label = symbol.label
        if label.feature:
            yield self._features, label.feature
            if is_pattern(label, symbol.variables):
                yield self._patterns, label.feature
            else:
                yield self._exact, label
        for need in symbol.needs:
            yield self._needing, _kept_under(need)
            yield self._needing, stem(need.term.label)
        if symbol.uses:
            yield self._using, symbol.uses

    def symbols(self) -> Iterable[Symbol]:
        """All of them."""
        return self._symbols.values()

    def of(self, declaration: spec.Declaration) -> Symbol:
        """The symbol of a declaration that is held."""
        return self._symbols[id(declaration)]

    def find(self, declaration: spec.Declaration) -> spec.Declaration | None:
        """The one that is held and equal."""
        sought = symbol_of(declaration)
        held = self._named.get(sought.kind, {}).get(next(iter(sought.names), None), {})
        return next((each.declaration for each in held.values() if each.declaration == declaration), None)

    def named(self, kind: str, name: object) -> spec.Declaration | None:
        """The declaration of that name; of several the first."""
        symbol = next(iter(self._named.get(kind, {}).get(name, {}).values()), None)
        return None if symbol is None else symbol.declaration

    def others(self, symbol: Symbol, name: object) -> Iterator[spec.Declaration]:
        """Earlier declarations of the same name; links from different streams into one type may share it."""
        for each in self._named.get(symbol.kind, {}).get(name, {}).values():
            if each is symbol:
                return
            if not _beside(each.made, symbol.made):
                yield each.declaration

    def of_kind(self, kind: str) -> Iterator[spec.Declaration]:
        """All declarations of that kind; of several with one name the first."""
        return (next(iter(held.values())).declaration for held in self._named.get(kind, {}).values())

    def names(self, kind: str) -> Collection[object]:
        """All names of that kind."""
        return self._named.get(kind, {}).keys()

    def maker(self, name: str) -> spec.SourceDeclaration | spec.UnitDeclaration | None:
        """The declared source or unit of that name."""
        declared = self.named(MAKER, name)
        return declared if isinstance(declared, spec.SourceDeclaration | spec.UnitDeclaration) else None

    def source(self, name: str) -> str | None:
        """The sort of a source."""
        declared = self.maker(name)
        return declared.sort if isinstance(declared, spec.SourceDeclaration) else self.known.sources.get(name)

    def unit(self, name: str) -> UnitSorts | None:
        """Sorts of a unit and of its inputs."""
        declared = self.maker(name)
        if isinstance(declared, spec.UnitDeclaration):
            return declared.sort, declared.inputs
        return self.known.units.get(name)

    def semantic(self, name: str) -> SemanticLabel | None:
        """The definition of a semantic label: declared, or of the ontology."""
        declared = self.named(SEMANTIC, name)
        if isinstance(declared, spec.LabelDeclaration):
            return SemanticLabel(name, self.shape(declared.sort.name) or declared.sort, declared.meaning)
        return (self.known.semantic or {}).get(name)

    def semantic_names(self) -> list[str] | None:
        """The names of all semantic labels; None: any name is one."""
        declared = [str(name) for name in self.names(SEMANTIC)]
        return None if self.known.semantic is None else sorted({*declared, *self.known.semantic})

    def shape(self, name: str) -> Sort | None:
        """The declared sort of that name; None if there is none."""
        declared = self.named(SORT, name)
        if isinstance(declared, spec.SortDeclaration):
            return declared.sort
        known = self.known.values.get(name)
        if known is not None:
            return known
        labels = (each for each in self.of_kind(SEMANTIC) if isinstance(each, spec.LabelDeclaration))
        return next((each.sort for each in labels if each.sort.name == name and not each.sort.is_open), None)

    def roads(self) -> "RoadNetwork | None":
        """The roads on which linked objects are."""
        declared = self.named(ROADS, "roads")
        return declared.network if isinstance(declared, spec.RoadsDeclaration) else self.known.roads

    def sources(self) -> list[str]:
        """The names of all declared sources."""
        return [each.name for each in self.of_kind(MAKER) if isinstance(each, spec.SourceDeclaration)]

    def units(self) -> list[str]:
        """The names of all declared units."""
        return [each.name for each in self.of_kind(MAKER) if isinstance(each, spec.UnitDeclaration)]

    def labels(self, but: spec.Declaration | None = None, like: Label = _NO_LABEL) -> tuple[Label, ...]:
        """The labels of all declared and known streams, but of one declaration.

        Families are as they are written, or of the objects of the label that they are compared with.
        """

        def of_one(made: Symbol) -> Label:
            is_like = made.variables and len(like.objects) == len(made.label.objects)
            return made.label._replace(objects=like.objects) if is_like else made.label

        made = (each for each in self._symbols.values() if each.label.feature and each.declaration is not but)
        return (*map(of_one, made), *self.known.labels)

    def makers(self, label: Label, variables: frozenset[str] = NOTHING) -> Iterator[Symbol]:
        """All declarations that may make this label; `cars.link[car1]` is an attribute of the states in `cars`."""
        if label.feature in self._features:
            if is_pattern(label, variables):
                some = self._features[label.feature].values()
            else:
                yield from self._exact.get(label, {}).values()
                some = self._patterns.get(label.feature, {}).values()
            yield from (made for made in some if fit(label, variables, made.label, made.variables))
        elif "." in label.feature:
            yield from self._features.get(stem(label), {}).values()

    def of_feature(self, feature: str) -> Iterable[Symbol]:
        """All makers of streams of one feature."""
        return self._features.get(feature, {}).values()

    def dependent(self, declaration: spec.Declaration) -> Iterator[spec.Declaration]:
        """Dependents of a declaration: readers of its output, and instances of it."""
        made = self._symbols.get(id(declaration)) or symbol_of(declaration)
        dependent: list[Symbol] = []
        match declaration:
            case spec.SourceDeclaration(_, name) | spec.UnitDeclaration(_, name):
                dependent += self._using.get(name, {}).values()
            case spec.Define():
                dependent += self._needing.get(declaration.feature.name, {}).values()
            case spec.MonitorDeclaration(name):
                dependent += self._needing.get(Label(MARGIN, (name,)), {}).values()
            case spec.LabelDeclaration(name):
                dependent += (each for each in self._symbols.values() if _shares(each.declaration, name))
            case spec.RoadsDeclaration():
                dependent += (
                    each for each in self._symbols.values() if isinstance(each.made, spec.Link | spec.Composite)
                )
            case spec.SortDeclaration():
                of_sort = (each for each in self._named.get(SEMANTIC, {}).values())
                dependent += (each for held in of_sort for each in held.values() if _is_of(each, declaration.name))
        if made.label.feature:
            feature = stem(made.label)
            is_one = made.label.feature == feature and not is_pattern(made.label, made.variables)
            for key in (made.label, f"{feature}*") if is_one else (feature,):
                some = self._needing.get(key, {}).values()
                dependent += (each for each in some if any(_meets(need, made) for need in each.needs))
        return (each.declaration for each in dependent)


def _beside(one: "spec.Making | None", other: "spec.Making | None") -> bool:
    return isinstance(one, spec.Link) and isinstance(other, spec.Link) and one.source != other.source


def _shares(declaration: spec.Declaration, label: str) -> bool:
    return isinstance(declaration, spec.Export | spec.Import) and declaration.semantic == label


def _is_of(symbol: Symbol, sort: str) -> bool:
    return isinstance(symbol.declaration, spec.LabelDeclaration) and symbol.declaration.sort.name == sort


def recognises(symbols: SymbolTable, label: Label) -> bool:
    """Whether `chronicle[NAME, ARGUMENT, ...]` names a chronicle that is declared, without arguments or with all."""
    declared = symbols.named(CHRONICLE, label.objects[0])
    if not isinstance(declared, spec.ChronicleDeclaration) or declared.content is None:
        return False
    return len(label.objects) in {1, 1 + len(declared.content.chronicles[label.objects[0]].parameters)}


def constant_of(definition: spec.Define) -> Constant | None:
    """The value, if the definition is a number, a time, a text or a truth value without objects."""
    formula = definition.formula
    if definition.feature.objects:
        return None
    if isinstance(formula, tree.Duration):
        return formula
    return formula.value if isinstance(formula, tree.Const) else None


def is_pattern(label: Label, variables: frozenset[str]) -> bool:
    """Whether it may become several labels: some of its objects stand for any, or `self` for a unit."""
    return any(one in variables or one == SELF for one in label.objects)


def fit(one: Label, free: frozenset[str], other: Label, also_free: frozenset[str]) -> bool:
    """Whether two labels of one feature can become the same: free objects stand for any, `self` for one unit."""
    return len(one.objects) == len(other.objects) and all(
        a in free or b in also_free or a == b or SELF in (a, b) for a, b in zip(one.objects, other.objects, strict=True)
    )


def stem(label: Label) -> str:
    """The feature without an attribute."""
    return label.feature.partition(".")[0]


def _kept_under(need: Need) -> Label | str:
    """A need of one label is found by that, others by their feature and a star."""
    label = need.term.label
    is_one = label.feature == stem(label) and not is_pattern(label, need.variables)
    return label if is_one else f"{stem(label)}*"


def _meets(need: Need, made: Symbol) -> bool:
    label = need.term.label
    if label.feature != made.label.feature:
        return stem(label) == stem(made.label)
    return label == made.label or fit(label, need.variables, made.label, made.variables)
