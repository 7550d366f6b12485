"""Whether the remainder of a formula holds if the newest state persists for ever (thesis 7.4.2: a plan that has ended).

Over states that are all alike a temporal operator is about its operand alone: `always` and `eventually` are the same.
"""

from dyknow.reasoning.formulas.skeletons import Skeleton
from dyknow.reasoning.progression.automaton import Progressor, TruthAssignment
from dyknow.reasoning.progression.clauses import OPEN, UNKNOWN_NUMBER, Block, Clauses


def holds_if_all_persists(clauses: Clauses, progressor: Progressor, assignment: TruthAssignment) -> bool:
    """The truth of a remainder over endless repetitions of the state with this truth assignment; undecided is false."""
    return all(any(_holds(one, progressor, assignment) for one in clause) for clause in clauses)


def _holds(one: object, progressor: Progressor, assignment: TruthAssignment) -> bool:
    if isinstance(one, Block):
        return holds_if_all_persists(one.clauses, progressor, assignment)
    if not isinstance(one, tuple) or one[0] == UNKNOWN_NUMBER:
        return False
    return _is_true(progressor.skeleton, progressor.node_of(one[0]), assignment, is_open=one[1] == OPEN)


def _is_true(skeleton: Skeleton, at: int, assignment: TruthAssignment, *, is_open: bool = False) -> bool:
    """The truth of a node; `is_open` if its window has begun before, whatever its lower bound."""
    kind, parts, lo_us, _ = skeleton.nodes[at]
    is_open = is_open or not lo_us
    if kind == "atom":
        return assignment.digits[parts[0]] == 1 - parts[1]
    if kind == "constant":
        return bool(parts[0])
    truths = [_is_true(skeleton, one, assignment) for one in parts]
    if kind == "or":
        return any(truths)
    if kind == "until":
        return truths[1] and (truths[0] or is_open)
    if kind == "release":
        return truths[1] or (truths[0] and not is_open)
    return all(truths)
