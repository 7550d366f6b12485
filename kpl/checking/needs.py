"""The streams that declarations need: their inputs, and the streams in their formulas."""

from collections.abc import Iterator
from typing import Final, NamedTuple

from dyknow.kpl.syntax import specification as spec
from dyknow.model.labels import Label
from dyknow.reasoning.formulas import tree

NOTHING: Final = frozenset[str]()


class Need(NamedTuple):
    """A stream that is needed; the variables in its label stand for any object."""

    term: spec.StreamTerm
    variables: frozenset[str] = NOTHING


def needs_of(made: spec.Making) -> Iterator[Need]:
    """The streams that something is made from."""
    match made:
        case spec.Refinement() | spec.StateStream() | spec.FirstOf() | spec.Belief():
            yield from (Need(term) for term in spec.terms_of(made))
        case spec.Link(source) | spec.Composite(source):
            yield Need(spec.StreamTerm(source, place=made.place))
        case spec.Select(term, variable, domain) | spec.Merge(term, variable, domain):
            yield Need(domain)
            yield Need(term, frozenset({variable}))


def conditions_of(made: spec.Making) -> tuple[tree.Formula, ...]:
    """The formulas of a link or of composites; attributes of the states of both ends are read by them, too."""
    match made:
        case spec.Link(establish=first, reestablish=second, maintain=third):
            return first, second, third
        case spec.Composite(together=together, stays=stays):
            return together, stays
    return ()


def reads_of(*formulas: tree.Formula) -> tuple[Need, ...]:
    """The streams that formulas speak of, and their domains."""
    features = (node for each in formulas for node in tree.walk(each) if isinstance(node, tree.Feature))
    domains = ((Label(name), NOTHING) for each in formulas for name in domains_of(each))
    return tuple(Need(spec.StreamTerm(label), variables) for label, variables in (*map(label_of, features), *domains))


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
    variables = frozenset(one.name for one in feature.objects if isinstance(one, tree.Variable))
    return Label(feature.stem, tuple(one if isinstance(one, str) else one.name for one in feature.objects)), variables
