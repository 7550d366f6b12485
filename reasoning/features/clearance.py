"""How far apart two aircraft are when `always phi` about them holds in a state whatever else is the case there.

Most pairs are far apart most of the time. Then one distance tells what phi is, and nothing else need be computed. Beyond
every distance that phi speaks of, two courses either come closest later than every time that phi speaks of, or are still
far apart then, since a distance shrinks by the relative speed times that time at most. A phi that holds in both cases,
all other features unknown, holds. Two beyond the distance of well clear are not on the way into it within T seconds of
modified tau unless they are nearer than that distance plus the relative speed times T.
"""

import math
from typing import Final, NamedTuple

from dyknow.reasoning.features.well_clear import AMONG_SMALL, LOOKAHEAD_S, Thresholds
from dyknow.reasoning.formulas.evaluation import TRUE, EvaluationCompiler, Moment
from dyknow.reasoning.formulas.tree import (
    Always,
    And,
    Compare,
    Const,
    Duration,
    Feature,
    Formula,
    Implies,
    Not,
    Or,
    walk,
)

FAR_M: Final = 1e9
"""Features of two aircraft farther apart than this may not be numbers."""
_SLACK_M: Final = 1.0
_DISTANCES: Final = {"xy_dist", "dist_3d"}
_KEEPING_CLEAR: Final = {"well_clear": 1.0, "time_to_violation": LOOKAHEAD_S * 1e6}
"""The values of two that are far apart."""
_CASES: Final = (_DISTANCES | {"cpa_time"}, _DISTANCES | {"cpa_xy"})
_UNDERSTOOD: Final = (Not, And, Or, Implies, Compare, Feature, Const, Duration)


class Clearance(NamedTuple):
    """phi holds if the horizontal distance is more than `radius_m` plus `horizon_s` times the relative speed."""

    radius_m: float
    horizon_s: float


def clearance(formula: Formula, volume: Thresholds = AMONG_SMALL) -> Clearance | None:
    """Of `always phi`, phi comparing features of one pair with numbers; None: there is none, or it is unknown.

    `volume`: the thresholds of well clear.
    """
    if not isinstance(formula, Always) or formula.lo_us != 0 or formula.hi_us is not None:
        return None
    phi = formula.operand
    bounds: dict[str, list[float]] = {"": [0.0]}
    features: dict[str, Feature] = {}
    for node in walk(phi):
        if not isinstance(node, _UNDERSTOOD):
            return None
        if isinstance(node, Feature):
            features[node.label] = node
        elif isinstance(node, Compare):
            bound = _number(node.right)
            if bound is None or not isinstance(node.left, Feature):
                return None
            bounds.setdefault(node.left.name, []).append(bound)
    if len({feature.objects for feature in features.values()}) != 1:
        return None
    test = EvaluationCompiler().test(phi)
    for far in _CASES:
        known = dict.fromkeys(far, math.inf) | _KEEPING_CLEAR
        if test(*Moment(0, {label: known[one.name] for label, one in features.items() if one.name in known})) != TRUE:
            return None
    distances = [bound for name in (*_DISTANCES, "cpa_xy", "") for bound in bounds.get(name, ())]
    horizon_s = max(0.0, *bounds.get("cpa_time", (0.0,))) / 1e6
    if any(one.name in _KEEPING_CLEAR for one in features.values()):
        ahead_s = min(LOOKAHEAD_S, max(0.0, *bounds.get("time_to_violation", (0.0,))) / 1e6)
        distances.append(volume.d_m)
        horizon_s = max(horizon_s, ahead_s + volume.tau_s)
    return Clearance(max(distances) + _SLACK_M, horizon_s)


def _number(term: Formula) -> float | None:
    if isinstance(term, Duration):
        return float(term.us)
    if isinstance(term, Const) and isinstance(term.value, int | float) and not isinstance(term.value, bool):
        return float(term.value)
    return None
