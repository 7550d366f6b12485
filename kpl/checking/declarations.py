"""What declarations name, make and need: kept up to date as they come and go, so that a change is cheap to judge."""

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

from dyknow.model.labels import Label
from kpl.syntax import specification as spec
from reasoning.formulas import tree

SELF = "self"
NOTHING = frozenset[str]()
MAKER, GENERATOR, CHRONICLE = "a source or a unit", "a generator", "a chronicle"
MARGIN = "margin"
MONITOR = "a monitor"
Name = tuple[str, object]
"""What it is a name of, and the name."""


class Need(NamedTuple):
    """A stream that is needed; the variables in its label stand for any object."""

    term: spec.StreamTerm
    variables: frozenset[str]


class MadeGenerator(NamedTuple):
    """A generator, or a family of them: the variables stand for any object."""

    label: Label
    variables: frozenset[str]
    node: spec.Declaration
    needs: tuple[Need, ...]

    @property
    def made(self) -> spec.Making | None:
        """How it is made; None: it is imported."""
        return spec.making_of(self.node)


class Declarations:
    """Declarations by what they name, make and need. Equal ones are held apart, so that both can be complained of."""

    def __init__(self, declarations: Iterable[spec.Declaration] = ()) -> None:
        self.named: dict[Name, dict[int, spec.Declaration]] = {}
        self.made: dict[int, MadeGenerator] = {}
        self._exact: dict[Label, dict[int, MadeGenerator]] = {}
        self._patterns: dict[str, dict[int, MadeGenerator]] = {}
        self._features: dict[str, dict[int, MadeGenerator]] = {}
        self._needing: dict[Label | str, dict[int, tuple[spec.Declaration, tuple[Need, ...]]]] = {}
        self._using: dict[str, dict[int, spec.Declaration]] = {}
        for each in declarations:
            self.add(each)

    def add(self, declaration: spec.Declaration) -> None:
        """It is declared."""
        key, made = id(declaration), _made(declaration)
        if made is not None:
            self.made[key] = made
        for table, name, entry in self._entries(declaration):
            table.setdefault(name, {})[key] = entry

    def discard(self, declaration: spec.Declaration) -> None:
        """It is declared no more."""
        key = id(declaration)
        for table, name, _ in self._entries(declaration):
            table.get(name, {}).pop(key, None)
            if not table.get(name):
                table.pop(name, None)
        self.made.pop(key, None)

    def _entries(self, declaration: spec.Declaration) -> Iterator[tuple[dict[Any, dict[int, Any]], object, object]]:
        """In which tables it stands, under which name, and what stands there."""
        yield from ((self.named, name, declaration) for name in names_of(declaration))
        made = self.made.get(id(declaration))
        if made is not None:
            yield self._features, made.label.feature, made
            if is_pattern(made.label, made.variables):
                yield self._patterns, made.label.feature, made
            else:
                yield self._exact, made.label, made
        needs = (*needs_of(declaration), *reads_of(declaration))
        for need in needs:
            yield self._needing, _kept_under(need), (declaration, needs)
            yield self._needing, stem(need.term.label), (declaration, needs)
        yield from ((self._using, used, declaration) for used in uses_of(declaration))

    def declarations(self) -> Iterator[spec.Declaration]:
        """All of them, chronicle files left out."""
        return (each for held in self.named.values() for each in held.values())

    def find(self, declaration: spec.Declaration) -> spec.Declaration | None:
        """The one that is held and equal."""
        held = self.named.get(next(iter(names_of(declaration)), ("", "")), {})
        return next((each for each in held.values() if each == declaration), None)

    def maker(self, name: str) -> spec.SourceDeclaration | spec.UnitDeclaration | None:
        """The source or unit of that name."""
        found = next(iter(self.named.get((MAKER, name), {}).values()), None)
        return found if isinstance(found, spec.SourceDeclaration | spec.UnitDeclaration) else None

    def sources(self) -> list[str]:
        """The names of all declared sources."""
        return [name for name in self._makers_named() if isinstance(self.maker(name), spec.SourceDeclaration)]

    def units(self) -> list[str]:
        """The names of all declared units."""
        return [name for name in self._makers_named() if isinstance(self.maker(name), spec.UnitDeclaration)]

    def makers(self, label: Label, variables: frozenset[str] = NOTHING) -> Iterator[MadeGenerator]:
        """All generators that may make this label; `cars.link[car1]` is an attribute of what `cars` makes."""
        if label.feature in self._features:
            if is_pattern(label, variables):
                every = self._features[label.feature].values()
                yield from (made for made in every if fit(label, variables, made.label, made.variables))
            else:
                yield from self._exact.get(label, {}).values()
                some = self._patterns.get(label.feature, {}).values()
                yield from (made for made in some if fit(label, variables, made.label, made.variables))
        elif "." in label.feature:
            yield from self._features.get(stem(label), {}).values()

    def of_feature(self, feature: str) -> Iterator[MadeGenerator]:
        """All generators of one feature."""
        yield from self._features.get(feature, {}).values()

    def dependent(self, declaration: spec.Declaration) -> Iterator[spec.Declaration]:
        """Those for which it matters that it comes or goes: they need what it makes, or are made from what it is."""
        for _, name in names_of(declaration):
            if isinstance(declaration, spec.SourceDeclaration | spec.UnitDeclaration):
                yield from self._using.get(str(name), {}).values()
        if isinstance(declaration, spec.Define):
            yield from (each for each, _ in self._needing.get(declaration.feature.name, {}).values())
        if isinstance(declaration, spec.MonitorDeclaration):
            yield from (each for each, _ in self._needing.get(Label(MARGIN, (declaration.name,)), {}).values())
        made = self.made.get(id(declaration)) or _made(declaration)
        if made is not None:
            feature = stem(made.label)
            is_one = made.label.feature == feature and not is_pattern(made.label, made.variables)
            for key in (made.label, f"{feature}*") if is_one else (feature,):
                for each, needs in self._needing.get(key, {}).values():
                    if any(_meets(need, made) for need in needs):
                        yield each

    def _makers_named(self) -> list[str]:
        return [str(name) for kind, name in self.named if kind == MAKER]


def names_of(declaration: spec.Declaration) -> tuple[Name, ...]:
    """What nothing else may be called."""
    match declaration:
        case spec.SourceDeclaration(_, name) | spec.UnitDeclaration(_, name):
            return ((MAKER, name),)
        case spec.GeneratorDeclaration(label):
            return ((GENERATOR, label),)
        case spec.ForEach():
            return ((GENERATOR, declaration.body.label),)
        case spec.Import():
            return ((GENERATOR, declaration.term.label),)
        case spec.StreamDeclaration(name):
            return (("a stream", name),)
        case spec.Export(semantic):
            return (("an export", semantic),)
        case spec.MonitorDeclaration(name):
            return ((MONITOR, name),)
        case spec.ChronicleDeclaration(content=content) if content is not None:
            return tuple((CHRONICLE, name) for name in content.chronicles)
        case spec.Define(feature):
            return (("a definition", (feature.name, len(feature.objects))),)
    return ()


def needs_of(declaration: spec.Declaration) -> tuple[Need, ...]:
    """The streams it takes."""
    match declaration:
        case spec.GeneratorDeclaration():
            return tuple(_needs(declaration.made, NOTHING))
        case spec.ForEach(variable, domain, body):
            return (Need(domain, NOTHING), *_needs(body.made, frozenset({variable})))
        case spec.StreamDeclaration(_, term) | spec.Export(_, term):
            return (Need(term, NOTHING),)
    return ()


def reads_of(declaration: spec.Declaration) -> tuple[Need, ...]:
    """The streams that its formula speaks of; a domain is one, too."""
    if not isinstance(declaration, spec.Define | spec.MonitorDeclaration):
        return ()
    features = (node for node in tree.walk(declaration.formula) if isinstance(node, tree.Feature))
    read = [*map(label_of, features), *((Label(name), NOTHING) for name in domains_of(declaration.formula))]
    return tuple(Need(spec.StreamTerm(label), variables) for label, variables in read)


def domains_of(formula: tree.Formula) -> tuple[str, ...]:
    """The named domains over which a formula quantifies."""
    found: dict[str, None] = {}
    for node in tree.walk(formula):
        if isinstance(node, tree.Forall | tree.Exists):
            domain: tree.Domain = node.domain
            found.update(dict.fromkeys(one for one in (domain.base, *domain.minus) if isinstance(one, str)))
    return tuple(found)


def label_of(feature: tree.Feature) -> tuple[Label, frozenset[str]]:
    """The label of a feature in a formula, and which of its objects are variables."""
    name = f"{feature.name}.{feature.attribute}" if feature.attribute else feature.name
    variables = frozenset(one.name for one in feature.objects if isinstance(one, tree.Variable))
    return Label(name, tuple(one if isinstance(one, str) else one.name for one in feature.objects)), variables


def uses_of(declaration: spec.Declaration) -> tuple[str, ...]:
    """The source or unit it is made from."""
    match spec.making_of(declaration):
        case spec.FromSource(name) | spec.Refinement(name) | spec.Link(_, name):
            return (name,)
    return ()


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


def _meets(need: Need, made: MadeGenerator) -> bool:
    label = need.term.label
    if label.feature != made.label.feature:
        return stem(label) == stem(made.label)
    return label == made.label or fit(label, need.variables, made.label, made.variables)


def _made(declaration: spec.Declaration) -> MadeGenerator | None:
    match declaration:
        case spec.GeneratorDeclaration(label):
            return MadeGenerator(label, NOTHING, declaration, needs_of(declaration))
        case spec.ForEach(variable, _, body):
            return MadeGenerator(body.label, frozenset({variable}), declaration, needs_of(declaration))
        case spec.Import(_, _, term):
            return MadeGenerator(term.label, NOTHING, declaration, ())
    return None


def _needs(made: spec.Making, variables: frozenset[str]) -> Iterator[Need]:
    match made:
        case spec.Refinement(_, inputs) | spec.StateStream(inputs):
            yield from (Need(term, variables) for term in inputs)
        case spec.Link(source):
            yield Need(spec.StreamTerm(source, place=made.place), variables)
        case spec.Select(term, variable, domain) | spec.Merge(term, variable, domain):
            yield Need(domain, variables)
            yield Need(term, variables | {variable})
