"""Queries about formulas while an instance runs: the same names mean the same as in its specification."""

from typing import TYPE_CHECKING

from dyknow.kpl.checking.definitions import Definitions
from dyknow.kpl.checking.error_collector import DeclarationErrors
from dyknow.kpl.checking.specifications import check_change
from dyknow.kpl.checking.streams import Streams
from dyknow.kpl.checking.warnings import Makers
from dyknow.kpl.running.changes import together
from dyknow.kpl.syntax.parsing import parse_formula, raise_all
from dyknow.kpl.syntax.specification import MonitorDeclaration
from dyknow.reasoning.formulas.tree import Feature, Formula, walk

if TYPE_CHECKING:
    from dyknow.kpl.running.instance import Instance


def features_of(instance: "Instance", formula: Formula) -> tuple[frozenset[str], frozenset[str]]:
    """Which features a formula speaks of: those derived from streams of units, and streams of the instance.

    A stream may be called like a derived feature; it is meant, unless its values are records, which nothing compares.
    """
    features = [node for node in walk(formula) if isinstance(node, Feature)]
    derived = Streams(instance.current_symbols()).derived
    own = frozenset(each.name for each in features if each.attribute is not None or each.name not in derived)
    return frozenset(each.name for each in features) - own, own


def read_over(instance: "Instance", text: str, parsed: Formula | None = None) -> Formula:
    """A formula over the streams of an instance, or over features derived in its federation, what it defines put in.

    `parsed` is what `parse_formula` made of the text, if that has been done.

    Raises:
        TextError: it is none.
        TextErrors: every error in it, streams without a producer included.
    """
    asked, symbols = MonitorDeclaration(text, parsed or parse_formula(text)), instance.current_symbols()
    definitions, derived = Definitions(symbols), Streams(symbols).derived
    symbols.add(asked)
    try:
        errors = check_change(symbols, (), (asked,), text)
        unread = Makers(symbols, derived).unread(asked.formula, DeclarationErrors(text))
        raise_all(together(errors, unread))
    finally:
        symbols.discard(asked)
    return definitions.resolved(asked.formula, instance.unit, text)
