from reasoning.alarms import AlarmEvent
from reasoning.clearance import Clearance, clearance
from reasoning.derivation import FEATURES, Derivation, DerivedFeature, Input, needed_labels
from reasoning.engine import Progressing, Way, make_progression
from reasoning.evaluation import NoValuePolicy
from reasoning.explaining import Reason
from reasoning.formulas import Domain, Formula, domain_members, instantiate, label_text, required_labels, split_growing
from reasoning.inputs import Freshness
from reasoning.margins import Margin, Margins
from reasoning.monitors import Monitor, Shown
from reasoning.profiles import Profile, builtin_profiles, parse_profiles
from reasoning.progression import Progression, Verdict
from reasoning.proximity import Approach, closest_approach, fence_margin_m, offset_m
from reasoning.remaining import remaining
from reasoning.traces import Outcome, Trace, TraceState, check_trace, follow_trace, read_trace, trace_domains

__all__ = [
    "FEATURES",
    "AlarmEvent",
    "Approach",
    "Clearance",
    "Derivation",
    "DerivedFeature",
    "Domain",
    "Formula",
    "Freshness",
    "Input",
    "Margin",
    "Margins",
    "Monitor",
    "NoValuePolicy",
    "Outcome",
    "Profile",
    "Progressing",
    "Progression",
    "Reason",
    "Shown",
    "Trace",
    "TraceState",
    "Verdict",
    "Way",
    "builtin_profiles",
    "check_trace",
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
