"""Formulas and chronicles over states of streams: progression, monitoring, recognition."""

from dyknow.reasoning.features.clearance import Clearance, clearance
from dyknow.reasoning.features.derivation import FEATURES, Derivation, DerivedFeature, FeatureInput, needed_labels
from dyknow.reasoning.features.proximity import Approach, closest_approach, fence_margin_m, offset_m
from dyknow.reasoning.formulas.evaluation import NoValuePolicy
from dyknow.reasoning.formulas.tree import (
    Domain,
    Formula,
    domain_members,
    instantiate,
    label_text,
    required_labels,
    split_growing,
)
from dyknow.reasoning.monitoring.alarms import (
    NEITHER_CAN_AVOID,
    NONCONFORMING,
    OF_SEPARATION,
    SILENT_IN_THE_AIR,
    AlarmEvent,
)
from dyknow.reasoning.monitoring.inputs import Freshness
from dyknow.reasoning.monitoring.margins import Margin, Margins
from dyknow.reasoning.monitoring.monitors import Monitor, Shown
from dyknow.reasoning.monitoring.profiles import Profile, builtin_profiles, parse_profiles
from dyknow.reasoning.monitoring.traces import Outcome, Trace, TraceState, follow_trace, read_trace, trace_domains
from dyknow.reasoning.progression.automaton import Verdict
from dyknow.reasoning.progression.engine import Progressing, Way, make_progression
from dyknow.reasoning.progression.explaining import Explanation
from dyknow.reasoning.progression.remaining import remaining

__all__ = [
    "FEATURES",
    "NEITHER_CAN_AVOID",
    "NONCONFORMING",
    "OF_SEPARATION",
    "SILENT_IN_THE_AIR",
    "AlarmEvent",
    "Approach",
    "Clearance",
    "Derivation",
    "DerivedFeature",
    "Domain",
    "Explanation",
    "FeatureInput",
    "Formula",
    "Freshness",
    "Margin",
    "Margins",
    "Monitor",
    "NoValuePolicy",
    "Outcome",
    "Profile",
    "Progressing",
    "Shown",
    "Trace",
    "TraceState",
    "Verdict",
    "Way",
    "builtin_profiles",
    "clearance",
    "closest_approach",
    "domain_members",
    "fence_margin_m",
    "follow_trace",
    "instantiate",
    "label_text",
    "make_progression",
    "needed_labels",
    "offset_m",
    "parse_profiles",
    "read_trace",
    "remaining",
    "required_labels",
    "split_growing",
    "trace_domains",
]
