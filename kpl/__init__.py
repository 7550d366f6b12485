"""KPL, the thesis' knowledge processing language: reading, checking and running specifications."""

from dyknow.kpl.checking.formulas import FeatureType, Vocabulary, check, read_formula
from dyknow.kpl.checking.lint import LintWarning, lint
from dyknow.kpl.checking.profiles import profile_formula, unit_vocabulary
from dyknow.kpl.checking.specifications import Findings
from dyknow.kpl.checking.symbols import Constant, Known
from dyknow.kpl.running.instance import ConfigurationEntry, Instance
from dyknow.kpl.running.ports import Federation, Hooks
from dyknow.kpl.syntax.chronicles import parse_chronicles, print_chronicles, read_chronicles
from dyknow.kpl.syntax.listing import print_declaration, print_specification
from dyknow.kpl.syntax.parsing import parse_formula
from dyknow.kpl.syntax.printing import print_formula
from dyknow.kpl.syntax.specification import Declaration, Specification
from dyknow.kpl.syntax.statements import ReadSpecification, parse_specification, read_specification

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
