"""From declarations to processes: what a generator declaration makes, with names of members and of the unit put in."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from dyknow import Label, Policy, PolicyError, Sort
from dyknow.errors import ChronicleError, SortError, TextError, TextErrors, WrongNumberOfInputs
from dyknow.factory import process_of
from dyknow.instants import US_PER_MS, print_duration
from dyknow.mediation import Mediation
from dyknow.network import Process
from dyknow.processes import Input
from dyknow.prototypes import Prototype, SourcePrototype, UnitPrototype
from dyknow.state_streams import StateStream, check_delay_before, exactly, state_policy
from kpl.changes import in_text
from kpl.declared import Declared
from kpl.definitions import Definitions
from kpl.formula_states import MAX_DELAY_US
from kpl.listing import print_declaration
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
    Select,
    SourceDeclaration,
    Specification,
    StreamDeclaration,
    StreamTerm,
    UnitDeclaration,
)
from kpl.specification import (
    Refinement as Refining,
)
from kpl.specification import (
    StateStream as States,
)
from reasoning.chronicles import Recogniser
from reasoning.formulas import Node

if TYPE_CHECKING:
    from kpl.instance import Instance

Members: TypeAlias = Mapping[str, str]
"""What variables stand for."""
LEAST_PERIOD_US = US_PER_MS
MAX_DECLARATIONS = 10_000
MAX_ERRORS = 100
"""After so many no more are looked for."""
SELF = "self"
LEFT_OUT = "nothing: leave the statement out"


class Made(NamedTuple):
    """What a generator declaration comes to.

    Attributes:
        process: None: samples are pushed, or nobody can make it yet.
        source: the source they are pushed from.
        unit: the prototype it is made from.
        lacks: there is no such prototype yet.
    """

    sort: Sort
    process: Process | None
    source: str = ""
    unit: str = ""
    lacks: bool = False


class Compiler:
    """Makes processes for one instance."""

    def __init__(self, instance: "Instance") -> None:
        self._instance = instance

    def label(self, label: Label, members: Members | None = None) -> Label:
        """The label with members for variables, and the unit for `self`."""
        meant = {SELF: self._instance.unit, **(members or {})}
        return Label(label.feature, tuple(meant.get(one, one) for one in label.objects))

    def term(self, term: StreamTerm, members: Members | None = None) -> StreamTerm:
        return StreamTerm(self.label(term.label, members), self._served(term.policy), place=term.place)

    def input(self, term: StreamTerm, members: Members | None = None) -> Input:
        return Input(self.label(term.label, members), self._served(term.policy))

    def _served(self, policy: Policy) -> Policy:
        """The policy, or with the shortest period that is served if that is the choice."""
        too_often = policy.sample_us is not None and policy.sample_us < LEAST_PERIOD_US
        return replace(policy, sample_us=LEAST_PERIOD_US) if too_often else policy

    def sources(self, declaration: GeneratorDeclaration, members: Members | None = None) -> tuple[Label, ...]:
        """The generators it is made from."""
        return tuple(self.label(term.label, members) for term in _terms(declaration.made))

    def making(self, declaration: GeneratorDeclaration, declared: Declared, members: Members | None = None) -> Made:
        """The process of a generator, not yet attached.

        Raises:
            TextError: it cannot be made here.
        """
        made = declaration.made
        match made:
            case FromSource(name):
                prototype = self._instance.factory.find(name)
                sort = self._instance.sort(self._declared_sort(name, declared))
                if isinstance(prototype, SourcePrototype) and (process := process_of(prototype)) is not None:
                    return Made(sort, process, unit=name)
                if name in self._instance.parts.withdrawn:
                    return Made(sort, None, unit=name, lacks=True)
                return Made(sort, None, name, unit=name)
            case Refining(name, terms):
                unit = self._instance.factory.find(name)
                if not isinstance(unit, UnitPrototype):
                    return Made(Sort(""), None, unit=name, lacks=True)
                inputs = [self.input(term, members) for term in terms]
                named = self._unit_sort(unit, declared, made) if unit.of_any_sort else unit.sort
                return Made(self._instance.sort(named), process_of(unit, inputs), unit=name)
            case States(terms, policy):
                inputs = [self.input(term, members) for term in terms]
                try:
                    synchronised, when = state_policy(policy, [each.policy for each in inputs])
                    return Made(Sort("state", is_open=True), StateStream(exactly(policy, inputs), synchronised, when))
                except PolicyError as wrong:
                    raise located(made, str(wrong), wrong.repair) from None
            case Select(term, variable, domain) | Merge(term, variable, domain):
                return Made(
                    self._sort_of(term.label, declared),
                    Mediation(
                        self.input(domain, members),
                        lambda member: self.input(term, {**(members or {}), variable: member}),
                        single=isinstance(made, Select),
                    ),
                )
            case Link():
                raise located(made, "links of objects are not run here yet: they come with anchoring", LEFT_OUT)

    # What can be said beforehand

    def check(
        self, new: Iterable[Declaration], wanted: Specification, declared: Declared, text: str, file: str
    ) -> list[TextError]:
        """What cannot run although it is well-formed: units nobody implements, periods nobody keeps, limits."""
        errors: list[TextError] = []
        if len(wanted) > MAX_DECLARATIONS:
            return [too_many(len(wanted), file)]
        definitions = Definitions(wanted)
        for each in new:
            try:
                self._check(each, definitions, declared, text, file)
            except WrongNumberOfInputs:
                continue  # that is told where units are looked at
            except TextErrors as wrong:
                errors += wrong.errors
            except TextError as wrong:
                errors.append(in_text(wrong, text, file))
            if len(errors) >= MAX_ERRORS:
                break
        return errors

    def _check(
        self, declaration: Declaration, definitions: Definitions, declared: Declared, text: str, file: str
    ) -> None:
        match declaration:
            case GeneratorDeclaration():
                self._check_made(declaration, declared)
            case ForEach(variable, domain, body):
                self._check_policy(domain, domain.policy)
                self._check_made(body, declared, {variable: variable})
            case UnitDeclaration(sort, name, inputs):
                unit = self._instance.factory.find(name)
                if isinstance(unit, UnitPrototype) and not unit.fits(sort, inputs):
                    takes = ", ".join(unit.inputs)
                    raise located(
                        declaration, f"{name} is implemented with other sorts", f"compunit {unit.sort} {name}({takes})"
                    )
            case SourceDeclaration(sort, name):
                source = self._instance.factory.find(name)
                if isinstance(source, SourcePrototype) and source.sort != sort:
                    raise located(
                        declaration, f"{name} is implemented with another sort", f"source {source.sort} {name}"
                    )
            case Define():
                definitions.check(declaration)
            case MonitorDeclaration():
                definitions.resolved(declaration.formula, self._instance.unit, text, file)
                self._check_policy(declaration, declaration.policy, of_states=True)
                max_delay_us = declaration.policy.max_delay_us
                try:
                    check_delay_before(
                        declaration.policy.delay_before_us, MAX_DELAY_US if max_delay_us is None else max_delay_us
                    )
                except PolicyError as wrong:
                    raise located(declaration, str(wrong), wrong.repair) from None
            case StreamDeclaration(_, term) | Export(_, term) | Import(_, _, term):
                self._check_policy(term, term.policy)
            case ChronicleFile():
                self._check_chronicles(declaration)

    def _check_chronicles(self, declaration: ChronicleFile) -> None:
        if declaration.content is None:
            raise located(
                declaration, f"{declaration.path} was not read", "chronicles go with the file that names them"
            )
        if not declaration.content.chronicles:
            raise located(declaration, f"{declaration.path} declares no chronicle", "chronicle name[?x] { ... }")
        if declaration.policy != Policy(max_delay_us=declaration.policy.max_delay_us):
            raise located(declaration, "chronicles know max delay only", "with max delay 500")
        try:
            Recogniser.of(declaration.content)
        except ChronicleError as wrong:
            raise located(declaration, f"{declaration.path}: {wrong}") from None

    def _check_made(
        self, declaration: GeneratorDeclaration, declared: Declared, members: Members | None = None
    ) -> None:
        self.making(declaration, declared, members)
        made = declaration.made
        if isinstance(made, States):
            self._check_policy(made, made.policy, of_states=True)
        for term in _terms(made):
            self._check_policy(term, term.policy)

    def _check_policy(self, node: Node, policy: Policy, *, of_states: bool = False) -> None:
        """Periods that are kept, and constraints that mean something here (Def. 7.8.4: of states)."""
        if policy.delay_before_us is not None and not of_states:
            asked = replace(policy, delay_before_us=None)
            raise located(
                node,
                "`delay before approximation` is a constraint of states, and says nothing of another stream",
                f"with {asked}" if asked != Policy() else "nothing: leave it out",
            )
        if self._instance.admission == "longer":
            return
        if policy.sample_us is not None and policy.sample_us < LEAST_PERIOD_US:
            raise located(
                node,
                f"a sample every {print_duration(policy.sample_us)} cannot be served",
                f"at least {print_duration(LEAST_PERIOD_US)}",
            )

    def _declared_sort(self, source: str, declared: Declared) -> str:
        found = declared.maker(source)
        if isinstance(found, SourceDeclaration):
            return found.sort
        prototype = self._instance.factory.find(source)
        return "" if prototype is None else prototype.sort

    def _unit_sort(self, unit: UnitPrototype, declared: Declared, place: Node) -> str:
        """Of a unit for streams of any sort, as it is declared."""
        found = declared.maker(unit.name)
        if isinstance(found, UnitDeclaration):
            return found.sort
        takes = ", ".join(each.removeprefix("?") for each in unit.inputs)
        repair = f"compunit {unit.sort.removeprefix('?')} {unit.name}({takes})"
        raise located(place, f"{unit.name} is for streams of any sort and not declared: say of which", repair)

    def _sort_of(self, label: Label, declared: Declared) -> Sort:
        """The sort of what a label of a member is made of: that of any of its makers."""
        for made in declared.of_feature(label.feature):
            body = made.body
            if isinstance(body, GeneratorDeclaration) and not isinstance(body.made, Select | Merge):
                return self.making(body, declared).sort
        return Sort(label.feature, is_open=True)


def too_many(declarations: int, file: str) -> TextError:
    """The error for a specification that is too large."""
    return TextError(
        f"{declarations} declarations; an instance holds at most {MAX_DECLARATIONS}", file=file, repair="declare less"
    )


def check_offer(prototype: Prototype, specification: Specification) -> None:
    """Refuse what is offered under a name that is declared with other sorts; raises SortError."""
    for each in specification:
        match each:
            case UnitDeclaration(sort, name, inputs) if name == prototype.name:
                fits = isinstance(prototype, UnitPrototype) and prototype.fits(sort, inputs)
            case SourceDeclaration(sort, name) if name == prototype.name:
                fits = isinstance(prototype, SourcePrototype) and prototype.sort == sort
            case _:
                continue
        if not fits:
            said = print_declaration(each)
            raise SortError(f"{prototype.name} is declared as `{said}`, which what is offered is not")


def _terms(made: Making) -> tuple[StreamTerm, ...]:
    match made:
        case Refining(_, terms) | States(terms):
            return terms
        case Select(term, _, domain) | Merge(term, _, domain):
            return (term, domain)
        case Link(source):
            return (StreamTerm(source),)
    return ()


def located(node: Node, message: str, repair: str = "") -> TextError:
    """An error at a node of the syntax tree, whose text is not known here."""
    return TextError.at(node.place, message, repair=repair)
