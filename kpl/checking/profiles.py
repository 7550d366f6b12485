"""Formulas of named profiles, and what names mean to formulas over units."""

from collections.abc import Mapping
from dataclasses import replace

from dyknow.kpl.checking.formulas import FeatureType, Vocabulary, read_formula
from dyknow.kpl.checking.symbols import Constant
from dyknow.model.errors import SourceText
from dyknow.model.instants import parse_duration
from dyknow.reasoning.features.derivation import FEATURES
from dyknow.reasoning.formulas.tree import Duration, Formula
from dyknow.reasoning.monitoring.profiles import AIRCRAFT, Profile, Threshold


def unit_vocabulary(unit: str, constants: Mapping[str, Constant] | None = None) -> Vocabulary:
    """The meaning of names on the platform `unit`: the derived features, the domain `units`, and `self`."""
    features = {name: FeatureType(feature.arity, feature.sort) for name, feature in FEATURES.items()}
    return Vocabulary(features, domains=("units",), constants={**(constants or {}), "self": unit})


def profile_formula(profile: Profile, unit: str) -> Formula:
    """The formula of a profile for the platform `unit`, its thresholds put in; it may be about `traffic`, too: aircraft that are no members.

    Raises:
        TextError: if the text of the profile is wrong.
    """
    constants = {name: _constant(value) for name, value in profile.thresholds.items()}
    vocabulary = replace(unit_vocabulary(unit, constants), domains=("units", AIRCRAFT))
    return read_formula(SourceText(profile.formula, profile.name), vocabulary)


def _constant(value: Threshold) -> Constant:
    return Duration(parse_duration(value)) if isinstance(value, str) else value
