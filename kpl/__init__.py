from kpl.checking import Constant, FeatureType, Vocabulary, check, read_formula
from kpl.chronicle_printing import print_chronicles
from kpl.chronicles import parse_chronicles, read_chronicles
from kpl.instance import ConfigurationEntry, Instance
from kpl.known import Known
from kpl.listing import print_declaration, print_specification
from kpl.parsing import parse_formula
from kpl.printing import print_formula
from kpl.profiles import profile_formula, unit_vocabulary
from kpl.remarks import Remark, remarks
from kpl.specification import Declaration, Specification
from kpl.specification_checking import Findings, check_specification
from kpl.statements import Reading, parse_specification, read_specification
from kpl.surroundings import Federation, Hooks

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
    "Reading",
    "Remark",
    "Specification",
    "Vocabulary",
    "check",
    "check_specification",
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
    "remarks",
    "unit_vocabulary",
]
