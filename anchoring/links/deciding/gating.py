"""Which distance a condition implies, so that pairs farther apart need no evaluation.

A bound is derived from the formula, and only where leaving out the far states changes no verdict:

* `eventually[lo, hi] phi`, where a far state makes phi false at once, or a disjunction of such: far states are nothing
  but time that passes. If phi looks at further states, that holds until the first near state only.
* a formula that a far state makes false at once: a pair that starts far apart has ended.
"""

from math import inf, nextafter
from typing import NamedTuple

from dyknow.anchoring.links.specification import DISTANCES, FROM, THRESHOLD, TO
from dyknow.reasoning.formulas import tree
from dyknow.reasoning.formulas.tree import Formula


class Gate(NamedTuple):
    """The consequences of a condition for distant objects.

    Attributes:
        bound_m: a state farther apart, or as far, is a far one.
        keeps_all: after the first near state no state may be left out.
        window_us: after this time without a near state the condition is false; None: it never is.
    """

    bound_m: float
    keeps_all: bool
    window_us: int | None


def gate_of(formula: Formula, most_m: float) -> Gate | None:
    """The gate of a condition; None: it implies no distance. `most_m` is the largest value of `thresh`."""
    if isinstance(formula, tree.Or):
        gates = [gate_of(part, most_m) for part in formula.parts]
        if not all(gates):
            return None
        known = [gate for gate in gates if gate is not None]
        windows = [gate.window_us for gate in known]
        return Gate(
            max(gate.bound_m for gate in known),
            any(gate.keeps_all for gate in known),
            None if None in windows else max(window for window in windows if window is not None),
        )
    if isinstance(formula, tree.Eventually) and isinstance(formula.lo_us, int):
        bound_m = _at_once(formula.operand, most_m)
        hi_us = formula.hi_us
        if bound_m is None or not isinstance(hi_us, int | None):
            return None
        return Gate(bound_m, tree.is_temporal(formula.operand), hi_us)
    bound_m = _at_once(formula, most_m)
    return None if bound_m is None else Gate(bound_m, keeps_all=True, window_us=0)


def _at_once(formula: Formula, most_m: float) -> float | None:
    """The distance from which on the formula is false at once, whatever follows; None: there is none."""
    match formula:
        case tree.Compare(operator, left, right):
            return _compared(operator, left, right, most_m)
        case tree.And(parts):
            bounds = [bound for part in parts if (bound := _at_once(part, most_m)) is not None]
            return min(bounds, default=None)
        case tree.Or(parts):
            bounds = [bound for part in parts if (bound := _at_once(part, most_m)) is not None]
            return max(bounds) if len(bounds) == len(parts) else None
        case tree.Always(operand, 0):
            return _at_once(operand, most_m)
    return None


def _compared(operator: str, left: Formula, right: Formula, most_m: float) -> float | None:
    if operator in {">", ">="}:
        operator, left, right = {">": "<", ">=": "<="}[operator], right, left
    if operator not in {"<", "<="} or not _is_distance(left):
        return None
    match right:
        case tree.Const(value) if isinstance(value, int | float) and not isinstance(value, bool):
            bound_m = float(value)
        case tree.Feature(name, ()) if name == THRESHOLD:
            bound_m = most_m
        case _:
            return None
    return bound_m if operator == "<" else nextafter(bound_m, inf)


def _is_distance(term: Formula) -> bool:
    return isinstance(term, tree.Feature) and term.name in DISTANCES and set(term.objects) == {FROM, TO}
