"""What declarations name, make and need: kept up to date as they come and go, so that a change is cheap to judge."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple, TypeVar

from dyknow.labels import Label
from kpl.formula_states import domains_of
from kpl.specification import (
    ChronicleFile,
    Declaration,
    Define,
    Export,
    ForEach,
    FromSource,
    GeneratorDeclaration,
    Import,
    Link,
    Making,
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
from reasoning.formulas import Feature, Variable, walk

SELF = "self"
NOTHING = frozenset[str]()
MAKER, GENERATOR, CHRONICLE = "a source or a unit", "a generator", "a chronicle"
RECOGNISED = "chronicle"
MARGIN = "margin"
MONITOR = "a monitor"
"""Of what is recognised: `chronicle[overtake]`."""
Name = tuple[str, object]
"""What it is a name of, and the name."""
_Key = TypeVar("_Key")
_Value = TypeVar("_Value")


class Need(NamedTuple):
    """A stream that is needed; the variables in its label stand for any object."""

    term: StreamTerm
    variables: frozenset[str]


class Made(NamedTuple):
    """A generator, or a family of them: the variables stand for any object."""

    label: Label
    variables: frozenset[str]
    node: Declaration
    needs: tuple[Need, ...]

    @property
    def body(self) -> Declaration:
        """How it is made."""
        return self.node.body if isinstance(self.node, ForEach) else self.node


class Declared:
    """Declarations by what they name, make and need. Equal ones are held apart, so that both can be complained of."""

    def __init__(self, declarations: Iterable[Declaration] = ()) -> None:
        self.named: dict[Name, dict[int, Declaration]] = {}
        self.made: dict[int, Made] = {}
        self._exact: dict[Label, dict[int, Made]] = {}
        self._patterns: dict[str, dict[int, Made]] = {}
        self._features: dict[str, dict[int, Made]] = {}
        self._needing: dict[Label | str, dict[int, tuple[Declaration, tuple[Need, ...]]]] = {}
        self._using: dict[str, dict[int, Declaration]] = {}
        for each in declarations:
            self.add(each)

    def add(self, declaration: Declaration) -> None:
        """It is declared."""
        key = id(declaration)
        for name in names_of(declaration):
            self.named.setdefault(name, {})[key] = declaration
        made = _made(declaration)
        if made is not None:
            self.made[key] = made
            self._features.setdefault(made.label.feature, {})[key] = made
            if is_pattern(made.label, made.variables):
                self._patterns.setdefault(made.label.feature, {})[key] = made
            else:
                self._exact.setdefault(made.label, {})[key] = made
        needs = (*needs_of(declaration), *reads_of(declaration))
        for need in needs:
            self._needing.setdefault(_kept_under(need), {})[key] = declaration, needs
            self._needing.setdefault(stem(need.term.label), {})[key] = declaration, needs
        for used in uses_of(declaration):
            self._using.setdefault(used, {})[key] = declaration

    def discard(self, declaration: Declaration) -> None:
        """It is declared no more."""
        key = id(declaration)
        for name in names_of(declaration):
            _drop(self.named, name, key)
        made = self.made.pop(key, None)
        if made is not None:
            _drop(self._features, made.label.feature, key)
            _drop(self._patterns, made.label.feature, key)
            _drop(self._exact, made.label, key)
        for need in (*needs_of(declaration), *reads_of(declaration)):
            _drop(self._needing, _kept_under(need), key)
            _drop(self._needing, stem(need.term.label), key)
        for used in uses_of(declaration):
            _drop(self._using, used, key)

    def declarations(self) -> Iterator[Declaration]:
        """All of them, chronicle files left out."""
        return (each for held in self.named.values() for each in held.values())

    def find(self, declaration: Declaration) -> Declaration | None:
        """The one that is held and equal."""
        held = self.named.get(next(iter(names_of(declaration)), ("", "")), {})
        return next((each for each in held.values() if each == declaration), None)

    def maker(self, name: str) -> SourceDeclaration | UnitDeclaration | None:
        """The source or unit of that name."""
        found = next(iter(self.named.get((MAKER, name), {}).values()), None)
        return found if isinstance(found, SourceDeclaration | UnitDeclaration) else None

    def sources(self) -> list[str]:
        """The names of all declared sources."""
        return [name for name in self._makers_named() if isinstance(self.maker(name), SourceDeclaration)]

    def units(self) -> list[str]:
        """The names of all declared units."""
        return [name for name in self._makers_named() if isinstance(self.maker(name), UnitDeclaration)]

    def makers(self, label: Label, variables: frozenset[str] = NOTHING) -> Iterator[Made]:
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

    def of_feature(self, feature: str) -> Iterator[Made]:
        """All generators of one feature."""
        yield from self._features.get(feature, {}).values()

    def dependent(self, declaration: Declaration) -> Iterator[Declaration]:
        """Those for which it matters that it comes or goes: they need what it makes, or are made from what it is."""
        for _, name in names_of(declaration):
            if isinstance(declaration, SourceDeclaration | UnitDeclaration):
                yield from self._using.get(str(name), {}).values()
        if isinstance(declaration, Define):
            yield from (each for each, _ in self._needing.get(declaration.feature.name, {}).values())
        if isinstance(declaration, MonitorDeclaration):
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


def names_of(declaration: Declaration) -> tuple[Name, ...]:
    """What nothing else may be called."""
    match declaration:
        case SourceDeclaration(_, name) | UnitDeclaration(_, name):
            return ((MAKER, name),)
        case GeneratorDeclaration(label):
            return ((GENERATOR, label),)
        case ForEach():
            return ((GENERATOR, declaration.body.label),)
        case Import():
            return ((GENERATOR, declaration.term.label),)
        case StreamDeclaration(name):
            return (("a stream", name),)
        case Export(semantic):
            return (("an export", semantic),)
        case MonitorDeclaration(name):
            return ((MONITOR, name),)
        case ChronicleFile(content=content) if content is not None:
            return tuple((CHRONICLE, name) for name in content.chronicles)
        case Define(feature):
            return (("a definition", (feature.name, len(feature.objects))),)
    return ()


def needs_of(declaration: Declaration) -> tuple[Need, ...]:
    """The streams it takes."""
    match declaration:
        case GeneratorDeclaration():
            return tuple(_needs(declaration.made, NOTHING))
        case ForEach(variable, domain, body):
            return (Need(domain, NOTHING), *_needs(body.made, frozenset({variable})))
        case StreamDeclaration(_, term) | Export(_, term):
            return (Need(term, NOTHING),)
    return ()


def reads_of(declaration: Declaration) -> tuple[Need, ...]:
    """The streams that its formula speaks of; a domain is one, too."""
    if not isinstance(declaration, Define | MonitorDeclaration):
        return ()
    features = (node for node in walk(declaration.formula) if isinstance(node, Feature))
    read = [*map(label_of, features), *((Label(name), NOTHING) for name in domains_of(declaration.formula))]
    return tuple(Need(StreamTerm(label), variables) for label, variables in read)


def label_of(feature: Feature) -> tuple[Label, frozenset[str]]:
    """The label of a feature in a formula, and which of its objects are variables."""
    name = f"{feature.name}.{feature.attribute}" if feature.attribute else feature.name
    variables = frozenset(one.name for one in feature.objects if isinstance(one, Variable))
    return Label(name, tuple(one if isinstance(one, str) else one.name for one in feature.objects)), variables


def uses_of(declaration: Declaration) -> tuple[str, ...]:
    """The source or unit it is made from."""
    body = declaration.body if isinstance(declaration, ForEach) else declaration
    match body.made if isinstance(body, GeneratorDeclaration) else None:
        case FromSource(name) | Refinement(name) | Link(_, name):
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


def _meets(need: Need, made: Made) -> bool:
    label = need.term.label
    if label.feature != made.label.feature:
        return stem(label) == stem(made.label)
    return label == made.label or fit(label, need.variables, made.label, made.variables)


def _made(declaration: Declaration) -> Made | None:
    match declaration:
        case GeneratorDeclaration(label):
            return Made(label, NOTHING, declaration, needs_of(declaration))
        case ForEach(variable, _, body):
            return Made(body.label, frozenset({variable}), declaration, needs_of(declaration))
        case Import(_, _, term):
            return Made(term.label, NOTHING, declaration, ())
    return None


def _needs(made: Making, variables: frozenset[str]) -> Iterator[Need]:
    match made:
        case Refinement(_, inputs) | StateStream(inputs):
            yield from (Need(term, variables) for term in inputs)
        case Link(source):
            yield Need(StreamTerm(source, place=made.place), variables)
        case Select(term, variable, domain) | Merge(term, variable, domain):
            yield Need(domain, variables)
            yield Need(term, variables | {variable})


def _drop(held: dict[_Key, dict[int, _Value]], key: _Key, inside: int) -> None:
    found = held.get(key)
    if found is not None:
        found.pop(inside, None)
        if not found:
            del held[key]
