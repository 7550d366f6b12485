"""Formulas that somebody asks about while an instance runs: the same names mean the same as in its specification."""

from typing import TYPE_CHECKING

from kpl.changes import together
from kpl.complaints import Complaints
from kpl.definitions import Definitions
from kpl.parsing import parse_formula, raise_all
from kpl.specification import MonitorDeclaration
from kpl.specification_checking import check_change
from kpl.suspicions import Makers
from reasoning.derivation import FEATURES
from reasoning.formulas import Feature, Formula, walk

if TYPE_CHECKING:
    from kpl.instance import Instance


def features_of(formula: Formula) -> frozenset[str]:
    """The names of the features it speaks of."""
    return frozenset(node.name for node in walk(formula) if isinstance(node, Feature))


def read_over(instance: "Instance", text: str) -> Formula:
    """A formula over the streams of an instance, or over features derived in its federation, what it defines put in.

    Raises:
        TextError: it is none.
        TextErrors: with everything that is wrong with it, streams that nobody makes, too.
    """
    asked, known = MonitorDeclaration(text, parse_formula(text)), instance.known(instance.specification)
    declared, definitions = instance.parts.specified, Definitions(instance.specification)
    by_name = {*known.figures, *FEATURES, *(name for name, _ in definitions.features), *definitions.constants}
    declared.add(asked)
    try:
        errors = check_change(declared, (), (asked,), known, text)
        makers = Makers(declared, frozenset(known.labels), by_name)
        raise_all(together(errors, makers.unread(asked.formula, Complaints(text, ""))))
    finally:
        declared.discard(asked)
    return definitions.resolved(asked.formula, instance.unit, text)
