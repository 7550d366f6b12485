"""Warnings about a specification: streams without a subscriber or a producer, grids that need not meet."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from datetime import UTC, datetime

from dyknow.kpl.checking.error_collector import DeclarationErrors
from dyknow.kpl.checking.link_conditions import is_of_end
from dyknow.kpl.checking.lint import LintWarning, lint, withdrawn_and_back
from dyknow.kpl.checking.needs import NOTHING, conditions_of, domains_of, label_of
from dyknow.kpl.checking.streams import Streams
from dyknow.kpl.checking.symbols import DEFINITION, Symbol, SymbolTable, recognises, stem
from dyknow.kpl.syntax import specification as spec
from dyknow.model.errors import ChronicleError, TextError
from dyknow.model.instants import US_PER_S, print_duration, print_instant, print_span
from dyknow.model.labels import Label
from dyknow.model.values import Field
from dyknow.reasoning.chronicles import ChronicleFile as Chronicles
from dyknow.reasoning.chronicles import Recogniser
from dyknow.reasoning.features.derivation import FEATURES, needed_labels
from dyknow.reasoning.formulas.tree import Feature, Formula, Variable, label_text, walk


def warnings_of(every: Sequence[spec.Declaration], symbols: SymbolTable, errors: DeclarationErrors) -> list[TextError]:
    """Sources and units that nothing is made from, generators whose streams have no subscriber, features without a producer."""
    found: list[TextError] = []
    wanted, used, features = set[int](), set[str](), set[str]()
    for each in every:
        symbol = symbols.of(each)
        for need in symbol.needs:
            wanted.update(id(one) for one in symbols.makers(need.term.label, need.variables))
            features.update({need.term.label.feature} & FEATURES.keys())
        used.add(symbol.uses)
        if isinstance(symbol.made, spec.Link) and any(
            isinstance(below.made, spec.Link) for below in symbols.makers(symbol.made.source)
        ):
            wanted.add(id(symbol))  # links that are chained are one linkage: it predicts what is below
        formula = spec.monitor_of(each) or each
        if isinstance(formula, spec.Define | spec.MonitorDeclaration):
            features |= {node.name for node in walk(formula.formula) if isinstance(node, Feature)}
            features.update(domains_of(formula.formula))
        if isinstance(each, spec.ChronicleDeclaration) and each.content is not None:
            features |= {name.partition(".")[0] for name in _event_names(each.content)}
    features.update(needed_labels(features & FEATURES.keys()))
    makers = Makers(symbols, FEATURES)
    for each in every:
        made = symbols.of(each)
        if isinstance(each, spec.SourceDeclaration | spec.UnitDeclaration) and each.name not in used:
            found.append(errors.located(f"nothing is made from {each.name}", each, ""))
        if made.label.feature and id(made) not in wanted and stem(made.label) not in features:
            found.append(errors.located(f"{made.label} has no subscriber here", each, ""))
        declared = spec.monitor_of(each) or each
        for read in _formulas(each):
            found += makers.unread(read, errors)
        if isinstance(made.made, spec.Link):
            found += lint_errors(withdrawn_and_back(made.made), errors)
        if isinstance(declared, spec.MonitorDeclaration):
            found += lint_errors(lint(declared.formula, lambda feature: _is_raw(feature, symbols)), errors)
    for each in every:
        if isinstance(each, spec.ChronicleDeclaration) and each.content is not None:
            found += makers.eventless(each, each.content, errors)
    return [*found, *unoffered(map(symbols.of, every), symbols.known.units, errors), *stray_grids(every, errors)]


def lint_errors(lints: Iterable[LintWarning], errors: DeclarationErrors) -> list[TextError]:
    """Warnings about formulas, each at its place."""
    return [errors.located(one.message, one.node, one.repair) for one in lints]


def unoffered(every: Iterable[Symbol], offered: Collection[str], errors: DeclarationErrors) -> Iterator[TextError]:
    """Units that nothing implements, each at the first stream that is made from it, also of members that are yet to come."""
    waiting: dict[str, list[Symbol]] = {}
    for each in every:
        if isinstance(each.made, spec.Refinement) and each.uses not in offered:
            waiting.setdefault(each.uses, []).append(each)
    for name, made in waiting.items():
        labels = ", ".join(str(each.label) for each in made[:4])
        said = f"no module offers {name}: {labels} and what is made of it wait"
        yield errors.located(said, made[0].declaration, f"--units MODULE, which has a unit {name}")


def run_warnings(
    specification: Iterable[spec.Declaration], symbols: SymbolTable, text: str, now_us: int
) -> list[TextError]:
    """The warnings that also matter when a specification is only run, from now on: stray grids, features without a
    producer, durations that are over.
    """
    every, errors, makers = list(specification), DeclarationErrors(text), Makers(symbols, FEATURES)
    unread = (one for each in every for formula in _formulas(each) for one in makers.unread(formula, errors))
    return [*unread, *stray_grids(every, errors), *past_durations(every, errors, now_us)]


def _formulas(declaration: spec.Declaration) -> tuple[Formula, ...]:
    """The formulas of a declaration whose streams may have no producer."""
    declared, made = spec.monitor_of(declaration) or declaration, spec.making_of(declaration)
    if isinstance(declared, spec.Define | spec.MonitorDeclaration):
        return (declared.formula,)
    return () if made is None else conditions_of(made)


def past_durations(every: Iterable[spec.Declaration], errors: DeclarationErrors, now_us: int) -> Iterator[TextError]:
    """Durations that were over before they were declared: no sample that is yet to be valid lies in one."""
    for each in every:
        for node, policy in spec.policies_of(each):
            if policy.to_us is not None and policy.to_us < now_us:
                ended = datetime.fromtimestamp(policy.to_us // US_PER_S, UTC)
                said = (
                    f"`to {print_instant(policy.to_us)}` was {print_span(now_us - policy.to_us)} ago ({ended:%Y-%m-%d %H:%M:%S} "
                    "UTC; a number is ms since 1970): no new sample is valid before that, only what is remembered comes"
                )
                yield errors.located(said, node, "from now to +10s")


def stray_grids(every: Iterable[spec.Declaration], errors: DeclarationErrors) -> Iterator[TextError]:
    """Inputs of sampled states whose own grid is unknown before their first sample has come."""
    for each in every:
        made = spec.making_of(each)
        if not isinstance(made, spec.StateStream):
            continue
        policies = [term.policy for term in made.inputs]
        if made.policy.sample_us is None and (
            made.policy.change != "any update" or any(p.sample_us is None for p in policies)
        ):
            continue
        for term in made.inputs:
            period_us = term.policy.sample_us
            if period_us is not None and term.policy.from_us is None:
                instead = "no values" if made.policy.exact or term.policy.exact else "approximated values"
                said = (
                    f"{term.label} is sampled on a grid that its first sample anchors, the states on one that it need "
                    f"not meet: then they have {instead} of it"
                )
                yield errors.located(said, term, f"{term.label} with sample every {print_duration(period_us)}, from 0")


def _event_names(content: Chronicles) -> tuple[str, ...]:
    """Names of the events that the chronicles of a file speak of; none if they cannot be recognised."""
    try:
        return tuple(Recogniser.of(content).needed)
    except ChronicleError:
        return ()


def _is_raw(feature: Feature, symbols: SymbolTable) -> bool:
    """Whether a feature is made from a source as it is, so that its noise is in it."""
    label = Label(feature.name, tuple(map(str, feature.objects)))
    return any(isinstance(made.made, spec.FromSource) for made in symbols.makers(label))


class Makers:
    """Producers of a feature of given objects; figures, definitions and derived `features` count as made."""

    def __init__(self, symbols: SymbolTable, features: Collection[str]) -> None:
        self._symbols, self._streams = symbols, Streams(symbols)
        defined = (each.feature.name for each in symbols.of_kind(DEFINITION) if isinstance(each, spec.Define))
        self._by_name = {*symbols.known.figures, *features, *defined}
        self._features = {*map(stem, symbols.labels()), *self._by_name, spec.RECOGNISED}

    def unread(self, formula: Formula, errors: DeclarationErrors) -> Iterator[TextError]:
        """Of features of objects that nothing is called like; names without objects may be more than features.

        Features of one end of a link have been checked as conditions.
        """
        for node in walk(formula):
            if not isinstance(node, Feature) or not node.objects or is_of_end(label_of(node)[0]):
                continue
            if self._streams.is_about_objects(label_of(node)[0]):
                continue
            if node.name.partition(".")[0] not in self._features:
                name, names = node.name, [*self._features]
            elif not self._make(node):
                name, names = str(node.label), [*map(str, self._symbols.labels())]
            else:
                continue
            said = f"nothing here makes {name}, so that its value stays unknown"
            repair = errors.closest(name, names)
            if repair and name == node.name:
                repair = label_text(repair, node.objects)
            yield errors.located(said, node, repair)

    def eventless(
        self, declared: spec.ChronicleDeclaration, content: Chronicles, errors: DeclarationErrors
    ) -> Iterator[TextError]:
        """Of attributes and messages of chronicles that no stream brings."""
        for name in _event_names(content):
            if name in content.chronicles or self._brings(name):
                continue
            fields = [f"{stem(Label(name))}.{one.name}" for one in self._fields(stem(Label(name)))]
            near = errors.closest(name, [*fields, *self._features, *self._attributes()])
            said = f"nothing here makes {name}, and chronicles of {declared.path} speak of it"
            yield errors.located(said, declared, f"{near}, there" if near else f"strmgen {name}[...] = ...")

    def _brings(self, name: str) -> bool:
        """Whether some stream has what a chronicle calls so."""
        whole, _, attribute = name.partition(".")
        if self._streams.has_feature(name):
            return True
        if not self._streams.has_feature(whole):
            return name in self._by_name or (not attribute and name in self._attributes())
        fields = [one.name for one in self._fields(whole)]
        return bool(attribute) and (not fields or attribute in fields)

    def _fields(self, feature: str) -> tuple[Field, ...]:
        """Of the records of a feature, where all are known."""
        labels = ((each, NOTHING) for each in self._symbols.known.labels if each.feature == feature)
        made = ((each.label, each.variables) for each in self._symbols.of_feature(feature))
        records = [self._streams.record(label, variables) for label, variables in (*made, *labels)]
        return tuple(one for each in records if each is not None for one in each.fields) if all(records) else ()

    def _attributes(self) -> set[str]:
        return {one.name for sort in self._streams.object_streams.values() for one in sort.fields}

    def _make(self, feature: Feature) -> bool:
        label = label_of(feature)[0]
        if label.feature == spec.RECOGNISED and label.objects:
            return recognises(self._symbols, label)
        if feature.name in self._by_name or any(
            isinstance(one, Variable) or one in self._by_name for one in feature.objects
        ):
            return True
        label = Label(feature.name, tuple(map(str, feature.objects)))
        whole, known = Label(feature.name.partition(".")[0], label.objects), self._symbols.known.labels
        if "self" in label.objects and any(one.feature == whole.feature for one in known):
            return True  # of the own vehicle, whatever its platform is called
        return whole in known or any(True for _ in self._symbols.makers(label))
