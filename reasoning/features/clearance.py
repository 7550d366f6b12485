"""How far apart two aircraft are when `always phi` about them holds in a state whatever else is the case there.

Most pairs are far apart most of the time. Then one distance tells what phi is, and nothing else need be computed. Beyond
every distance that phi speaks of, two courses either come closest later than every time that phi speaks of, or are still
far apart then, since a distance shrinks by the relative speed times that time at most. A phi that holds in both cases,
all other features unknown, holds.
"""

import math
from typing import Final, NamedTuple

from reasoning.formulas.evaluation import TRUE, EvaluationCompiler, Moment
from reasoning.formulas.tree import Always, And, Compare, Const, Duration, Feature, Formula, Implies, Not, Or, walk

FAR_M: Final = 1e9
"""Features of two aircraft farther apart than this may not be numbers."""
_SLACK_M: Final = 1.0
_DISTANCES: Final = {"xy_dist", "dist_3d"}
_CASES: Final = (_DISTANCES | {"cpa_time"}, _DISTANCES | {"cpa_xy"})
_UNDERSTOOD: Final = (Not, And, Or, Implies, Compare, Feature, Const, Duration)


class Clearance(NamedTuple):
    """phi holds if the horizontal distance is more than `radius_m` plus `horizon_s` times the relative speed."""

    radius_m: float
    horizon_s: float


def clearance(formula: Formula) -> Clearance | None:
    """Of `always phi`, phi comparing features of one pair with numbers; None: there is none, or it is unknown."""
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
        if test(*Moment(0, {label: math.inf for label, one in features.items() if one.name in far})) != TRUE:
            return None
    distances = [bound for name in (*_DISTANCES, "cpa_xy", "") for bound in bounds.get(name, ())]
    horizon_us = max(0.0, *bounds.get("cpa_time", (0.0,)))
    return Clearance(max(distances) + _SLACK_M, horizon_us / 1e6)


def _number(term: Formula) -> float | None:
    if isinstance(term, Duration):
        return float(term.us)
    if isinstance(term, Const) and isinstance(term.value, int | float) and not isinstance(term.value, bool):
        return float(term.value)
    return None
