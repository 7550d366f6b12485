"""From generator declarations to processes, with names of members and of the unit put in."""

from collections.abc import Callable, Iterable, Mapping
from copy import copy
from dataclasses import replace
from functools import partial
from typing import NamedTuple, TypeAlias
from weakref import WeakValueDictionary

from dyknow import Label, Policy, PolicyError, Sort
from dyknow.kpl.checking.definitions import Definitions
from dyknow.kpl.checking.domains import members_label
from dyknow.kpl.checking.streams import Streams, origin_of
from dyknow.kpl.checking.symbols import SELF, SymbolTable
from dyknow.kpl.linking.beliefs import BELIEF_SORT, belief_stream
from dyknow.kpl.linking.declarations import (
    LinkageKey,
    Linked,
    check_percepts,
    declared_links,
    link_specifications,
    linkage_of,
    most_branches,
    percept_labels,
)  # fmt: skip
from dyknow.kpl.linking.roads import check_on_road
from dyknow.kpl.linking.streams import LinkStream, PerceptInput, SharedLinkage
from dyknow.kpl.linking.units import LinkedUnit, linked_unit
from dyknow.kpl.linking.wants import Wants, check_want
from dyknow.kpl.running.changes import in_text
from dyknow.kpl.running.chronicle_streams import check_chronicles
from dyknow.kpl.running.formula_states import MAX_DELAY_US
from dyknow.kpl.running.ports import Admission
from dyknow.kpl.syntax import specification as spec
from dyknow.kpl.syntax.listing import print_declaration
from dyknow.model.errors import (
    PolicyNotSupported,
    SortError,
    TextError,
    TextErrors,
    WrongNumberOfInputs,
    file_of,
)
from dyknow.model.instants import US_PER_MS, print_duration
from dyknow.model.values import is_kind_of
from dyknow.navigation import LocalFrame
from dyknow.network.factory import Prototypes, process_of
from dyknow.network.mediation import Failover, Mediation
from dyknow.network.process import Input, Process
from dyknow.network.prototypes import Prototype, SourcePrototype, UnitPrototype
from dyknow.reasoning.formulas.tree import Node
from dyknow.states.state_streams import StateStreamProcess, check_delay_before, exactly, state_policy

Members: TypeAlias = Mapping[str, str]
"""The objects that variables stand for."""
LEAST_PERIOD_US = US_PER_MS
MAX_DECLARATIONS = 10_000
MAX_ERRORS = 100
"""Most errors that are looked for."""


class CompiledGenerator(NamedTuple):
    """The result of compiling a generator declaration.

    Attributes:
        process: None: samples are pushed, or it has no producer yet.
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
    """Makes processes for one instance.

    Attributes:
        symbols: the declarations.
        withdrawn: sources whose makers may come back: their samples are not pushed meanwhile.
        wants: objects that are looked for.
    """

    def __init__(
        self,
        unit: str,
        prototypes: Prototypes,
        symbols: SymbolTable,
        sort: Callable[[str], Sort],
        admission: Admission = "refuse",
    ) -> None:
        self.unit, self.admission, self.symbols = unit, admission, symbols
        self.withdrawn = set[str]()
        self.wants = Wants()
        self._prototypes, self._sort = prototypes, sort
        self._linkages: WeakValueDictionary[tuple[LinkageKey, tuple[PerceptInput, ...]], SharedLinkage] = (
            WeakValueDictionary()
        )

    def over(self, symbols: SymbolTable) -> "Compiler":
        """The same for other declarations, to check them."""
        other = copy(self)
        other.symbols = symbols
        return other

    def label(self, label: Label, members: Members | None = None) -> Label:
        """The label with members for variables, and the unit for `self`."""
        meant = {SELF: self.unit, **(members or {})}
        return Label(label.feature, tuple(meant.get(one, one) for one in label.objects))

    def term(self, term: spec.StreamTerm, members: Members | None = None) -> spec.StreamTerm:
        return spec.StreamTerm(self.label(term.label, members), self._served(term.policy), place=term.place)

    def input(self, term: spec.StreamTerm, members: Members | None = None) -> Input:
        return Input(self.label(term.label, members), self._served(term.policy))

    def domain(self, term: spec.StreamTerm, members: Members | None = None) -> Input:
        """The stream that names the members of a domain."""
        label, policy = self.input(term, members)
        return Input(members_label(label, self.symbols), policy)

    def _served(self, policy: Policy) -> Policy:
        """The policy, or with the shortest period that is served if that is the choice."""
        too_often = policy.sample_us is not None and policy.sample_us < LEAST_PERIOD_US
        return replace(policy, sample_us=LEAST_PERIOD_US) if too_often else policy

    def sources(self, declaration: spec.GeneratorDeclaration, members: Members | None = None) -> tuple[Label, ...]:
        """The generators it is made from."""
        return tuple(self.label(term.label, members) for term in spec.terms_of(declaration.made))

    def making(self, declaration: spec.GeneratorDeclaration, members: Members | None = None) -> CompiledGenerator:
        """The process of a generator, not yet attached.

        Raises:
            TextError: it cannot be made here.
        """
        made = declaration.made
        match made:
            case spec.FromSource(name):
                prototype = self._prototypes.find(name)
                sort = self._shape(self._declared_sort(name), prototype)
                if isinstance(prototype, SourcePrototype) and (process := process_of(prototype)) is not None:
                    return CompiledGenerator(sort, process, unit=name)
                if name in self.withdrawn:
                    return CompiledGenerator(sort, None, unit=name, lacks=True)
                return CompiledGenerator(sort, None, name, unit=name)
            case spec.Refinement(name, terms, policy):
                unit = self._prototypes.find(name)
                if not isinstance(unit, UnitPrototype):
                    return CompiledGenerator(Sort(""), None, unit=name, lacks=True)
                inputs = [self.input(term, members) for term in terms]
                named = self._unit_sort(unit, made) if unit.of_any_sort else unit.sort
                try:
                    process = process_of(unit, inputs, None if policy == Policy() else self._served(policy))
                except PolicyNotSupported as wrong:
                    raise located(made, str(wrong), f"{name}(...), and the policy where it is taken") from None
                return CompiledGenerator(self._shape(named, unit), process, unit=name)
            case spec.StateStream(terms, policy):
                inputs = [self.input(term, members) for term in terms]
                try:
                    synchronised, when = state_policy(policy, [each.policy for each in inputs])
                    return CompiledGenerator(
                        Sort("state", is_open=True),
                        StateStreamProcess(exactly(policy, inputs), synchronised, when, policy.max_age_us),
                    )
                except PolicyError as wrong:
                    raise located(made, str(wrong), wrong.repair) from None
            case spec.FirstOf(terms):
                inputs = [self.input(term, members) for term in terms]
                return CompiledGenerator(self._sort_of(terms[0].label), Failover(inputs))
            case spec.Select(term, variable, domain) | spec.Merge(term, variable, domain):
                return CompiledGenerator(
                    self._sort_of(term.label),
                    Mediation(
                        self.domain(domain, members),
                        lambda member: self.input(term, {**(members or {}), variable: member}),
                        single=isinstance(made, spec.Select),
                    ),
                )
            case spec.Link() | spec.Composite():
                return self._linking(declaration.label, made)
            case spec.Belief():
                sort = Streams(self.symbols).record(declaration.label) or BELIEF_SORT
                stream = belief_stream(made, self.unit, self.label, self._sort_of, sort, origin_of(self.symbols))
                return CompiledGenerator(sort, stream)

    def _linking(self, label: Label, made: Linked) -> CompiledGenerator:
        """The stream of linked objects of one type, by all declarations that are chained with it."""
        key = linkage_of(label, made, self.symbols)
        links = tuple((self.label(each), replace(one, source=self.label(one.source))) for each, one in key.links)
        key, labels = key._replace(links=links), percept_labels(links)
        inputs = tuple(PerceptInput(Input(each, Policy()), self._sort_of(each)) for each in labels)
        for taken, sort in inputs:
            check_percepts(made, taken.label, sort, key.origin)
        shared = self._linkages.get((key, inputs))
        if shared is None:
            frame = None if key.origin is None else LocalFrame(*key.origin, 0.0)
            specifications = link_specifications(key, partial(self._linked_unit, frame))
            if key.roads is None:
                check_on_road(links, [each.sort for each in inputs])
            shared = SharedLinkage(specifications, inputs, frame, self.wants, declared_links(key.links), self.label)
            self._linkages[key, inputs] = shared
        made_sort = Streams(self.symbols).objects(label)
        if made_sort is None:
            raise located(
                made,
                f"what {label} is made of are no states of objects: their sort is not declared, has no symbol, or each link has another",
                "sort car(symbol in text, x_m in m, y_m in m, vx_m_s in m/s, vy_m_s in m/s, end in bool)",
            )
        return CompiledGenerator(
            made_sort,
            LinkStream(str(self.label(label)), shared, made_sort, most_branches(self.label(label), key)),
            unit="",
        )

    def _linked_unit(self, frame: LocalFrame | None, label: Label, made: spec.Link) -> LinkedUnit:
        """The unit of a user in a link."""
        streams = Streams(self.symbols)
        below = streams.objects(made.source) or self._sort_of(made.source)
        return linked_unit(self._prototypes.find(made.unit), made, below, streams.objects(label), frame)

    # Checks beforehand

    def check(self, new: Iterable[spec.Declaration], wanted: spec.Specification, text: str) -> list[TextError]:
        """Errors of well-formed declarations that cannot run: no implementation, impossible periods, limits."""
        errors: list[TextError] = []
        if len(wanted) > MAX_DECLARATIONS:
            return [too_many(len(wanted), text)]
        definitions = Definitions(self.symbols)
        for each in new:
            try:
                self._check(each, definitions, text)
            except WrongNumberOfInputs:
                continue  # that is told where units are looked at
            except TextErrors as wrong:
                errors += wrong.errors
            except TextError as wrong:
                errors.append(in_text(wrong, text))
            if len(errors) >= MAX_ERRORS:
                break
        return errors

    def _check(self, declaration: spec.Declaration, definitions: Definitions, text: str) -> None:
        match declaration:
            case spec.GeneratorDeclaration():
                self._check_made(declaration)
            case spec.ForEach(variables, domain, body):
                self._check_policy(domain, domain.policy)
                if isinstance(body, spec.GeneratorDeclaration):
                    self._check_made(body, {each: each for each in variables})
                else:
                    self._check(spec.monitor_of(declaration) or body, definitions, text)
            case spec.UnitDeclaration(sort, name, inputs):
                unit = self._prototypes.find(name)
                if isinstance(unit, UnitPrototype) and not unit.fits(sort, inputs):
                    takes = ", ".join(unit.inputs)
                    raise located(
                        declaration, f"{name} is implemented with other sorts", f"compunit {unit.sort} {name}({takes})"
                    )
                self._check_sorts(declaration, name)
            case spec.SourceDeclaration(sort, name):
                source = self._prototypes.find(name)
                if isinstance(source, SourcePrototype) and source.sort != sort:
                    raise located(
                        declaration, f"{name} is implemented with another sort", f"source {source.sort} {name}"
                    )
                self._check_sorts(declaration, name)
            case spec.Define():
                definitions.check(declaration)
            case spec.MonitorDeclaration():
                definitions.resolved(declaration.formula, self.unit, text)
                if declaration.policy.change in {"all updated", "all changed"}:
                    raise located(declaration, "states of a monitor are sampled", "with sample every 100")
                self._check_policy(declaration, declaration.policy, of_states=True)
                max_delay_us = declaration.policy.max_delay_us
                try:
                    check_delay_before(
                        declaration.policy.delay_before_us, MAX_DELAY_US if max_delay_us is None else max_delay_us
                    )
                except PolicyError as wrong:
                    raise located(declaration, str(wrong), wrong.repair) from None
            case spec.WantDeclaration():
                check_want(declaration, self.symbols, text)
                definitions.resolved(declaration.description, self.unit, text)
            case spec.StreamDeclaration(_, term) | spec.Export(_, term) | spec.Import(_, _, term):
                self._check_policy(term, term.policy)
            case spec.ChronicleDeclaration():
                check_chronicles(declaration)

    def _check_made(self, declaration: spec.GeneratorDeclaration, members: Members | None = None) -> None:
        self.making(declaration, members)
        made = declaration.made
        name = made.unit if isinstance(made, spec.Refinement) else getattr(made, "source", "")
        if name and self.symbols.maker(name) is None:
            self._check_sorts(declaration, name)
        if isinstance(made, spec.StateStream):
            self._check_policy(made, made.policy, of_states=True)
        elif isinstance(made, spec.Refinement):
            self._check_policy(made, made.policy)
        for term in spec.terms_of(made):
            self._check_policy(term, term.policy)

    def _check_sorts(self, declaration: spec.Declaration, name: str) -> None:
        """Check that the sorts declared by the module match the specification's."""
        prototype = self._prototypes.find(name)
        for shape in () if prototype is None else prototype.checked_sorts:
            known = self.symbols.shape(shape.name)
            if known is not None and not is_kind_of(known, shape):
                raise located(
                    declaration,
                    f"the sort {shape.name} is {known} here; {name} is implemented with {shape}",
                    f"sort {shape}",
                )

    def _check_policy(self, node: Node, policy: Policy, *, of_states: bool = False) -> None:
        """Periods that are kept, and constraints that mean something here (Def. 7.8.4: of states)."""
        if policy.of_states and not of_states:
            asked = replace(
                policy, delay_before_us=None, max_age_us=None, change="sample" if policy.sample_us else "any update"
            )
            raise located(
                node,
                f"`{policy.of_states}` is a constraint of states, and means nothing for another stream",
                f"with {asked}" if asked != Policy() else "nothing: leave it out",
            )
        if self.admission == "longer":
            return
        if policy.sample_us is not None and policy.sample_us < LEAST_PERIOD_US:
            raise located(
                node,
                f"a sample every {print_duration(policy.sample_us)} cannot be served",
                f"at least {print_duration(LEAST_PERIOD_US)}",
            )

    def _shape(self, sort: str, maker: Prototype | None) -> Sort:
        """The values of a sort: as declared, else as its maker says."""
        shapes = () if maker is None else maker.checked_sorts
        made = next((each for each in shapes if each.name == sort), None)
        return self.symbols.shape(sort) or made or self._sort(sort)

    def _declared_sort(self, source: str) -> str:
        declared = self.symbols.maker(source)
        if isinstance(declared, spec.SourceDeclaration):
            return declared.sort
        prototype = self._prototypes.find(source)
        return "" if prototype is None else prototype.sort

    def _unit_sort(self, unit: UnitPrototype, place: Node) -> str:
        """Of a unit for streams of any sort, as it is declared."""
        declared = self.symbols.maker(unit.name)
        if isinstance(declared, spec.UnitDeclaration):
            return declared.sort
        takes = ", ".join(each.removeprefix("?") for each in unit.inputs)
        repair = f"compunit {unit.sort.removeprefix('?')} {unit.name}({takes})"
        raise located(place, f"{unit.name} is for streams of any sort and not declared: name its sorts", repair)

    def _sort_of(self, label: Label) -> Sort:
        """The sort of a member's stream: that of any of its makers, or that of the semantic label."""
        for symbol in self.symbols.of_feature(label.feature):
            made = symbol.declaration
            body = made.body if isinstance(made, spec.ForEach) else made
            if isinstance(body, spec.GeneratorDeclaration) and not isinstance(
                body.made, spec.Select | spec.Merge | spec.FirstOf
            ):
                return self.making(body).sort
            if isinstance(body, spec.Import) and (imported := self.symbols.semantic(body.semantic)) is not None:
                return imported.sort
        semantic = self.symbols.semantic(label.feature)
        return Sort(label.feature, is_open=True) if semantic is None else semantic.sort


def too_many(declarations: int, text: str) -> TextError:
    """The error for a specification that is too large."""
    return TextError(
        f"{declarations} declarations; an instance holds at most {MAX_DECLARATIONS}",
        file=file_of(text),
        repair="declare less",
    )


def check_offer(prototype: Prototype, symbols: SymbolTable) -> None:
    """Refuse what is offered under a name that is declared with other sorts; raises SortError."""
    for shape in prototype.checked_sorts:
        known = symbols.shape(shape.name)
        if known is not None and known != shape:
            raise SortError(f"the sort {shape.name} is {known} here; {prototype.name} is offered with {shape}")
    declared = symbols.maker(prototype.name)
    match declared:
        case spec.UnitDeclaration(sort, _, inputs):
            fits = isinstance(prototype, UnitPrototype) and prototype.fits(sort, inputs)
        case spec.SourceDeclaration(sort):
            fits = isinstance(prototype, SourcePrototype) and prototype.sort == sort
        case None:
            return
    if not fits:
        said = print_declaration(declared)
        raise SortError(f"{prototype.name} is declared as `{said}`, which what is offered is not")


def located(node: Node, message: str, repair: str = "") -> TextError:
    """An error at a node of the syntax tree, whose text is not known here."""
    return TextError.at(node.place, message, repair=repair)
