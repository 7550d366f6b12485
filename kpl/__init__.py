"""KPL, the thesis' knowledge processing language: reading, checking and running specifications."""

from kpl.checking.formulas import FeatureType, Vocabulary, check, read_formula
from kpl.checking.lint import LintWarning, lint
from kpl.checking.profiles import profile_formula, unit_vocabulary
from kpl.checking.specifications import Findings
from kpl.checking.symbols import Constant, Known
from kpl.running.instance import ConfigurationEntry, Instance
from kpl.running.ports import Federation, Hooks
from kpl.syntax.chronicles import parse_chronicles, print_chronicles, read_chronicles
from kpl.syntax.listing import print_declaration, print_specification
from kpl.syntax.parsing import parse_formula
from kpl.syntax.printing import print_formula
from kpl.syntax.specification import Declaration, Specification
from kpl.syntax.statements import ReadSpecification, parse_specification, read_specification

__all__ = [
    "ConfigurationEntry",
    "Constant",
    "Declaration",
    "FeatureType",
    "Federation",
    "Findings",
    "Hooks",
    "Instance",
    "Known",
    "LintWarning",
    "ReadSpecification",
    "Specification",
    "Vocabulary",
    "check",
    "lint",
    "parse_chronicles",
    "parse_formula",
    "parse_specification",
    "print_chronicles",
    "print_declaration",
    "print_formula",
    "print_specification",
    "profile_formula",
    "read_chronicles",
    "read_formula",
    "read_specification",
    "unit_vocabulary",
]
