"""The inputs of families, chronicles and quantified formulas as they are declared, also while there is no member.

Their nodes and edges are those of the declaration: `offset[a, b]` takes `car_pair[a, b]`, and the chronicles of a file take
the streams whose attributes change.
"""

from collections.abc import Collection, Iterator

from dyknow import Label
from dyknow.kpl.checking.needs import domains_of
from dyknow.kpl.running.instance import Instance
from dyknow.kpl.syntax import specification as spec


def units_of_families(instance: Instance) -> dict[str, str]:
    """The unit that makes the streams of each family."""
    made = {str(body.label): body.made for body in _families(instance)}
    return {label: making.unit for label, making in made.items() if isinstance(making, spec.Refinement)}


def of_members(instance: Instance, nodes: Collection[str]) -> Iterator[tuple[str, str]]:
    """(source, target) by the names of the nodes that there are."""
    for body in _families(instance):
        for term in spec.terms_of(body.made):
            source = _node_of(term.label, instance, nodes)
            if source is not None:
                yield source, str(body.label)
    for path, chronicles in instance.chronicles.items():
        for name, _ in sorted(chronicles.watch.recogniser.attributes):
            source = _node_of(Label(name), instance, nodes)
            if source is not None:
                yield source, path
    for declaration in instance.specification:
        if isinstance(declaration, spec.MonitorDeclaration) and declaration.name in nodes:
            for domain in domains_of(declaration.formula):
                if domain in nodes:
                    yield domain, declaration.name


def _families(instance: Instance) -> Iterator[spec.GeneratorDeclaration]:
    for each in instance.specification:
        if isinstance(each, spec.ForEach) and isinstance(each.body, spec.GeneratorDeclaration):
            yield each.body


def _node_of(label: Label, instance: Instance, nodes: Collection[str]) -> str | None:
    """Itself, the family of its feature, or the stream of objects that it is a part of."""
    if str(label) in nodes:
        return str(label)
    stem = label.feature.partition(".")[0]
    for feature in (label.feature, stem):
        for family in instance.families.members:
            if family.feature == feature:
                return str(family)
    return stem if stem in nodes else None
