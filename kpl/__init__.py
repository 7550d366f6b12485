from kpl.checking import Constant, FeatureType, Vocabulary, check, read_formula
from kpl.parsing import parse_formula
from kpl.printing import print_formula
from kpl.profiles import profile_formula, unit_vocabulary

__all__ = [
    "Constant",
    "FeatureType",
    "Vocabulary",
    "check",
    "parse_formula",
    "print_formula",
    "profile_formula",
    "read_formula",
    "unit_vocabulary",
]
