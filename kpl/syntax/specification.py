"""The syntax tree of a KPL specification (thesis Def. 4.4.3, 7.8.6, 8.5.3, and our additions to them).

A specification is a sequence of declarations. Equal declarations are equal whatever they were typed like; `place` says
where each stood.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final, Literal, TypeAlias

from dyknow.kpl.syntax.link_options import LEAST_PARTS, USUAL, LinkOptions
from dyknow.model.instants import US_PER_MS
from dyknow.model.labels import Label
from dyknow.model.values import Sort
from dyknow.policies.policy import Policy
from dyknow.reasoning.chronicles import ChronicleFile as Chronicles
from dyknow.reasoning.formulas.evaluation import NoValuePolicy
from dyknow.reasoning.formulas.tree import Domain, Feature, Forall, Formula, Node, instantiate

if TYPE_CHECKING:
    from dyknow.anchoring.belief.files.described import DescribedWorld
    from dyknow.anchoring.roads.network import RoadNetwork

ANY_UPDATE = Policy()
ExportVisibility: TypeAlias = Literal["public", "protected", "private"]
RECOGNISED = "chronicle"
"""The feature of streams of recognitions: `chronicle[overtake]`."""
PARTIAL = "partial"
"""The feature of streams of partial instances: `partial[overtake]`."""


@dataclass(frozen=True, slots=True)
class StreamTerm(Node):
    """A stream as a subscriber wants it: the label of its generator, and a policy (Def. 4.4.3, FLUENT_STREAM_TERM)."""

    label: Label
    policy: Policy = ANY_UPDATE


@dataclass(frozen=True, slots=True)
class SourceDeclaration(Node):
    """`source SORT NAME`: a class of primitive processes (Def. 4.4.4)."""

    sort: str
    name: str


@dataclass(frozen=True, slots=True)
class UnitDeclaration(Node):
    """`compunit SORT NAME(SORT, ...)`: a class of refinement processes (Def. 4.4.5)."""

    sort: str
    name: str
    inputs: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class FromSource(Node):
    """A primitive process: the samples of a source."""

    source: str


@dataclass(frozen=True, slots=True)
class Refinement(Node):
    """A refinement process: a computational unit, its input streams, and the policy of its output."""

    unit: str
    inputs: tuple[StreamTerm, ...]
    policy: Policy = ANY_UPDATE


@dataclass(frozen=True, slots=True)
class StateStream(Node):
    """Synchronised states of the inputs, one value of each (Def. 7.8.6)."""

    inputs: tuple[StreamTerm, ...]
    policy: Policy = ANY_UPDATE


@dataclass(frozen=True, slots=True)
class Link(Node):
    """Objects of one stream linked to those of another sort (Def. 8.5.3), `from` and `to`; `is_ready`: no conditions are typed."""

    source: Label
    unit: str
    establish: Formula
    reestablish: Formula
    maintain: Formula
    options: LinkOptions = USUAL
    is_ready: bool = False


@dataclass(frozen=True, slots=True)
class Composite(Node):
    """Objects made of several of one stream: `together` and `stays` are over two of them, `from` and `to`.

    `least` is the number of parts that make one.
    """

    source: Label
    together: Formula
    stays: Formula
    least: int = LEAST_PARTS


@dataclass(frozen=True, slots=True)
class Observing(Node):
    """`PERCEPTS as SENSOR in VIEW trust T`: the percepts of a sensor of a world model.

    Attributes:
        view: the stream of its views; None: as the model says.
        trust: how far the source is trusted, in [0, 1].
    """

    label: Label
    sensor: str
    view: Label | None = None
    trust: float = 1.0


@dataclass(frozen=True, slots=True)
class Belief(Node):
    """`believe("MODEL.toml", "KNOWLEDGE.toml", PERCEPTS as SENSOR, ... for TASK)`: instances of an environment model.

    Attributes:
        paths: of the model and of prior knowledge.
        task: for which knowledge is loaded, or the stream that names it; empty: none.
        digest: of the texts of the files; empty where they were not read.
        world: their contents, None where they were not read.
    """

    paths: tuple[str, ...]
    observed: tuple[Observing, ...]
    task: Label | str = ""
    digest: str = ""
    world: "DescribedWorld | None" = field(default=None, compare=False, repr=False)

    @property
    def inputs(self) -> tuple[Label, ...]:
        """Percepts and views of each source, then the task."""
        of_sources = [each for one in self.observed for each in (one.label, one.view) if each is not None]
        return (*of_sources, self.task) if isinstance(self.task, Label) else (*of_sources,)


@dataclass(frozen=True, slots=True)
class Select(Node):
    """Mediation, one input at a time: that of the member which `domain` names at the time."""

    term: StreamTerm
    variable: str
    domain: StreamTerm


@dataclass(frozen=True, slots=True)
class Merge(Node):
    """Mediation, a varying set of inputs: those of all members of `domain`."""

    term: StreamTerm
    variable: str
    domain: StreamTerm


@dataclass(frozen=True, slots=True)
class FirstOf(Node):
    """Redundant producers of one stream: the samples of the first of them that is heard (3.2)."""

    inputs: tuple[StreamTerm, ...]


Making: TypeAlias = FromSource | Refinement | StateStream | Link | Composite | Belief | Select | Merge | FirstOf


@dataclass(frozen=True, slots=True)
class GeneratorDeclaration(Node):
    """`strmgen LABEL = ...`: a stream generator and the process it belongs to (Def. 4.4.7)."""

    label: Label
    made: Making


@dataclass(frozen=True, slots=True)
class StreamDeclaration(Node):
    """`stream NAME = TERM`: an output of the application (Def. 4.4.3, FLUENT_STREAM_DECL)."""

    name: str
    term: StreamTerm


@dataclass(frozen=True, slots=True)
class SortDeclaration(Node):
    """`sort NAME in UNIT`, or `sort NAME(FIELD in UNIT, ...)`: the values of a sort."""

    sort: Sort

    @property
    def name(self) -> str:
        return self.sort.name


@dataclass(frozen=True, slots=True)
class LabelDeclaration(Node):
    """`label SEMANTIC-LABEL : SORT "MEANING"`: a word that platforms share; with `in UNIT` the sort is declared, too.

    `sort` is open where it is declared elsewhere.
    """

    name: str
    sort: Sort
    meaning: str


@dataclass(frozen=True, slots=True)
class Export(Node):
    """`export SEMANTIC-LABEL = TERM`: a stream for other platforms; `offer ... at cost C`: one to call for.

    Attributes:
        visibility: of all platforms (public), of members with a role (protected), of none but this one (private).
        receivers: the only ones that may ask; empty: no others are excluded.
        cost: of an offer, whose policy is the quality that is promised; None: it is an export.
    """

    semantic: str
    term: StreamTerm
    visibility: ExportVisibility = "public"
    receivers: tuple[str, ...] = ()
    cost: float | None = None


CALLED: Final = ""
"""The unit of an import that is called for: the one whose proposal is taken."""


@dataclass(frozen=True, slots=True)
class Import(Node):
    """`import SEMANTIC-LABEL from UNIT as TERM`: a stream of another platform, under a label of our own.

    `call SEMANTIC-LABEL as TERM`: of the platform that offers it best, which is `CALLED`.
    """

    semantic: str
    unit: str
    term: StreamTerm


@dataclass(frozen=True, slots=True)
class Define(Node):
    """`define LABEL = FORMULA`: a feature, or without objects a constant, defined by a formula."""

    feature: Feature
    formula: Formula


@dataclass(frozen=True, slots=True)
class MonitorDeclaration(Node):
    """`monitor NAME = FORMULA [with OPTIONS]`; `policy` is that of its states, `close_after` counts states (F8).

    `starts_avoidance`: whether its alarms start a manoeuvre, where platforms may give way.
    """

    name: str
    formula: Formula
    policy: Policy = ANY_UPDATE
    no_value: NoValuePolicy = "undecided"
    close_after: int = 2
    starts_avoidance: bool = False


@dataclass(frozen=True, slots=True)
class ForEach(Node):
    """`for NAME in TERM strmgen ...`: a declaration for each member, removed with it (thesis 3.3, configuration).

    Of `for a, b in TERM strmgen ...` each member is a pair of objects (thesis 8.7.5). Nothing is declared for those `left_out`.
    """

    variables: tuple[str, ...]
    domain: StreamTerm
    body: GeneratorDeclaration | StreamDeclaration | Export | Import | MonitorDeclaration
    left_out: tuple[str, ...] = ()

    def members(self, member: Sequence[str]) -> dict[str, str]:
        """The object of each variable, for one member."""
        return dict(zip(self.variables, member, strict=True))


@dataclass(frozen=True, slots=True)
class ChronicleDeclaration(Node):
    """`chronicle file "PATH" [with max delay D, max age T, first values [of NAME, ...] since ever]`.

    Attributes:
        content: the file's declarations, None where it was not read.
        max_age_us: instances last no longer, which bounds what is remembered (C6); None: as the chronicles say.
        since_ever: the first values of all streams, or of those that are named, have been so since ever (C2; 8.4).
    """

    path: str
    policy: Policy = ANY_UPDATE
    content: Chronicles | None = None
    max_age_us: int | None = None
    since_ever: bool | tuple[str, ...] = False

    @property
    def max_age_ms(self) -> int | None:
        return None if self.max_age_us is None else -(-self.max_age_us // US_PER_MS)


@dataclass(frozen=True, slots=True)
class RoadsDeclaration(Node):
    """`roads "PATH"`: the roads on which linked objects are.

    Attributes:
        digest: of the text of the file; empty where it was not read.
        network: its contents, None where it was not read.
    """

    path: str
    digest: str = ""
    network: "RoadNetwork | None" = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class WantDeclaration(Node):
    """`want NAME in LABEL = FORMULA`: an object of a stream of linked objects, found by a description of it.

    In the formula the symbol is a variable for the object.
    """

    symbol: str
    stream: Label
    description: Formula


Declaration: TypeAlias = (
    SourceDeclaration
    | UnitDeclaration
    | GeneratorDeclaration
    | StreamDeclaration
    | ForEach
    | SortDeclaration
    | LabelDeclaration
    | Export
    | Import
    | Define
    | MonitorDeclaration
    | ChronicleDeclaration
    | RoadsDeclaration
    | WantDeclaration
)
Specification: TypeAlias = tuple[Declaration, ...]


def of_member(family: ForEach, member: Sequence[str]) -> Declaration:
    """A family's declaration for one member; `stream speed = ...` and monitors are called `speed-car1` then."""
    body, meant = family.body, family.members(member)
    called = "-".join(member)

    def put(label: Label) -> Label:
        return Label(label.feature, tuple(meant.get(one, one) for one in label.objects))

    match body:
        case StreamDeclaration(name, term):
            return replace(body, name=f"{name}-{called}", term=replace(term, label=put(term.label)))
        case Export(_, term):
            return replace(body, term=replace(term, label=put(term.label)))
        case Import(_, unit, term):
            term = replace(term, label=put(term.label))
            return replace(body, unit=meant.get(unit, unit), term=term)
        case MonitorDeclaration(name, formula):
            for variable, one in meant.items():
                formula = instantiate(formula, variable, one)
            return replace(body, name=f"{name}-{called}", formula=formula)
    return body


def monitor_of(declaration: Declaration) -> MonitorDeclaration | None:
    """The monitor that is declared; that of each member of a family as one over all of them."""
    if isinstance(declaration, MonitorDeclaration):
        return declaration
    if isinstance(declaration, ForEach) and isinstance(body := declaration.body, MonitorDeclaration):
        formula = body.formula
        for variable in reversed(declaration.variables):
            formula = Forall(variable, Domain(()), formula, place=formula.place)
        return replace(body, formula=formula)
    return None


def policies_of(declaration: Declaration) -> Iterator[tuple[Node, Policy]]:
    """Every policy of a declaration, with the node it constrains."""
    match declaration:
        case ForEach(_, domain, body):
            yield domain, domain.policy
            yield from policies_of(body)
        case GeneratorDeclaration(_, made):
            yield from ((term, term.policy) for term in terms_of(made))
            if isinstance(made, StateStream | Refinement):
                yield made, made.policy
        case StreamDeclaration(_, term) | Export(_, term) | Import(_, _, term):
            yield term, term.policy
        case MonitorDeclaration() | ChronicleDeclaration():
            yield declaration, declaration.policy


def terms_of(made: Making) -> tuple[StreamTerm, ...]:
    """The streams that a generator is made of."""
    match made:
        case Refinement(_, terms) | StateStream(terms) | FirstOf(terms):
            return terms
        case Select(term, _, domain) | Merge(term, _, domain):
            return (term, domain)
        case Link(source) | Composite(source):
            return (StreamTerm(source),)
        case Belief():
            return tuple(StreamTerm(each, place=made.place) for each in made.inputs)
    return ()


def making_of(declaration: Declaration) -> Making | None:
    """How the generator of a declaration, or of the members of a family, is made; None: it declares none."""
    body = declaration.body if isinstance(declaration, ForEach) else declaration
    return body.made if isinstance(body, GeneratorDeclaration) else None
