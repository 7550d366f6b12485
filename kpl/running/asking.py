"""Queries about formulas while an instance runs: the same names mean the same as in its specification."""

from typing import TYPE_CHECKING

from kpl.checking.definitions import Definitions
from kpl.checking.error_collector import DeclarationErrors
from kpl.checking.known_streams import Streams
from kpl.checking.specifications import check_change
from kpl.checking.warnings import Makers
from kpl.running.changes import together
from kpl.syntax.parsing import parse_formula, raise_all
from kpl.syntax.specification import MonitorDeclaration
from reasoning.formulas.tree import Feature, Formula, walk

if TYPE_CHECKING:
    from kpl.running.instance import Instance


def features_of(instance: "Instance", formula: Formula) -> tuple[frozenset[str], frozenset[str]]:
    """Which features a formula speaks of: those derived from streams of units, and streams of the instance.

    A stream may be called like a derived feature; it is meant, unless its values are records, which nothing compares.
    """
    features = [node for node in walk(formula) if isinstance(node, Feature)]
    derived = Streams(instance.parts.specified, instance.known(instance.specification)).derived
    own = frozenset(each.name for each in features if each.attribute is not None or each.name not in derived)
    return frozenset(each.name for each in features) - own, own


def read_over(instance: "Instance", text: str) -> Formula:
    """A formula over the streams of an instance, or over features derived in its federation, what it defines put in.

    Raises:
        TextError: it is none.
        TextErrors: with everything that is wrong with it, streams without a producer, too.
    """
    asked, known = MonitorDeclaration(text, parse_formula(text)), instance.known(instance.specification)
    declared, definitions = instance.parts.specified, Definitions(instance.specification)
    by_name = {
        *known.figures,
        *Streams(declared, known).derived,
        *(name for name, _ in definitions.features),
        *definitions.constants,
    }
    declared.add(asked)
    try:
        errors = check_change(declared, (), (asked,), known, text)
        makers = Makers(declared, frozenset(known.labels), by_name)
        raise_all(together(errors, makers.unread(asked.formula, DeclarationErrors(text, ""))))
    finally:
        declared.discard(asked)
    return definitions.resolved(asked.formula, instance.unit, text)
