"""What is no error in a specification, and yet hardly meant: what nobody asks for, what nobody makes, grids that need not meet."""

from collections.abc import Collection, Iterable, Iterator, Sequence

from dyknow.errors import TextError
from dyknow.instants import print_duration
from dyknow.labels import Label
from kpl.chronicle_streams import event_names
from kpl.complaints import Complaints
from kpl.declared import CHRONICLE, RECOGNISED, Declared, needs_of, reads_of, stem, uses_of
from kpl.formula_states import domains_of
from kpl.remarks import remarks
from kpl.specification import (
    ChronicleFile,
    Declaration,
    Define,
    ForEach,
    FromSource,
    GeneratorDeclaration,
    MonitorDeclaration,
    SourceDeclaration,
    StateStream,
    UnitDeclaration,
)
from reasoning.derivation import FEATURES
from reasoning.formulas import Feature, Formula, Variable, walk


def suspicions(
    every: Sequence[Declaration],
    declared: Declared,
    known: Iterable[Label],
    figures: Collection[str],
    complaints: Complaints,
) -> list[TextError]:
    """Sources and units that nothing is made from, generators whose streams nobody asks for, features nobody makes."""
    found: list[TextError] = []
    wanted, used, features = set[int](), set[str](), set[str]()
    for each in every:
        for need in (*needs_of(each), *reads_of(each)):
            wanted.update(id(one) for one in declared.makers(need.term.label, need.variables))
        used.update(uses_of(each))
        if isinstance(each, Define | MonitorDeclaration):
            features |= {node.name for node in walk(each.formula) if isinstance(node, Feature)}
            features.update(domains_of(each.formula))
        if isinstance(each, ChronicleFile) and each.content is not None:
            features |= {name.partition(".")[0] for name in event_names(each.content)}
    defined = {each.feature.name for each in every if isinstance(each, Define)}
    makers = Makers(declared, frozenset(known), {*figures, *FEATURES, *defined})
    for each in every:
        made = declared.made.get(id(each))
        if isinstance(each, SourceDeclaration | UnitDeclaration) and each.name not in used:
            found.append(complaints.said(f"nothing is made from {each.name}", each, ""))
        if made is not None and id(made) not in wanted and stem(made.label) not in features:
            found.append(complaints.said(f"nobody here asks for {made.label}", each, ""))
        if isinstance(each, Define | MonitorDeclaration):
            found += makers.unread(each.formula, complaints)
        if isinstance(each, MonitorDeclaration):
            said_of = remarks(each.formula, lambda feature: _is_raw(feature, declared))
            found += [complaints.said(one.message, one.node, one.repair) for one in said_of]
    return [*found, *stray_grids(every, complaints)]


def grid_warnings(specification: Iterable[Declaration], text: str, file: str) -> list[TextError]:
    """What whoever runs a specification had better know, also without asking for all that is suspicious."""
    return list(stray_grids(specification, Complaints(text, file)))


def stray_grids(every: Iterable[Declaration], complaints: Complaints) -> Iterator[TextError]:
    """Inputs of sampled states whose own grid is known to nobody before their first sample has come."""
    for each in every:
        body = each.body if isinstance(each, ForEach) else each
        made = body.made if isinstance(body, GeneratorDeclaration) else None
        if not isinstance(made, StateStream):
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
                yield complaints.said(said, term, f"{term.label} with sample every {print_duration(period_us)}, from 0")


def _is_raw(feature: Feature, declared: Declared) -> bool:
    """Whether a feature is made from a source as it is, so that its noise is in it."""
    label = Label(feature.name, tuple(map(str, feature.objects)))
    bodies = (made.body for made in declared.makers(label))
    return any(isinstance(body, GeneratorDeclaration) and isinstance(body.made, FromSource) for body in bodies)


class Makers:
    """Who makes a feature of given objects; what is known `by_name` alone is made."""

    def __init__(self, declared: Declared, known: frozenset[Label], by_name: Collection[str]) -> None:
        self._declared, self._known, self._by_name = declared, known, by_name
        of_features = (*(made.label for made in declared.made.values()), *known)
        self._features = {*map(stem, of_features), *by_name, RECOGNISED}

    def unread(self, formula: Formula, complaints: Complaints) -> Iterator[TextError]:
        """Of features of objects that nothing is called like; names without objects may be more than features."""
        for node in walk(formula):
            if not isinstance(node, Feature) or not node.objects:
                continue
            if node.name not in self._features:
                name, names = node.name, [*self._features]
            elif not self._make(node):
                name, names = str(node.label), [str(made.label) for made in self._declared.made.values()]
            else:
                continue
            said = f"nothing here makes {name}, so that its value stays unknown"
            yield complaints.said(said, node, complaints.closest(name, names))

    def _make(self, feature: Feature) -> bool:
        if feature.name in self._by_name or any(
            isinstance(one, Variable) or one in self._by_name for one in feature.objects
        ):
            return True
        label = Label(feature.name, tuple(map(str, feature.objects)))
        if label.feature == RECOGNISED:
            return (CHRONICLE, label.objects[0]) in self._declared.named
        return label in self._known or any(True for _ in self._declared.makers(label))
