"""Progression of a skeleton (Def. 7.5.3), and the automaton that remembers it.

The remainder of a formula after a state is a conjunction of clauses (`clauses.py`) whose windows are relative to that
state. It is a state of an automaton; its input is the truth assignment of the next state together with the time that
has passed. Transitions are worked out when they are met first, and kept: formulas of one skeleton and period share them.
"""

from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Any, Final, Literal, NamedTuple, Protocol, TypeAlias

from dyknow.reasoning.formulas.evaluation import Moment
from dyknow.reasoning.formulas.skeletons import Skeleton, SkeletonNode
from dyknow.reasoning.progression.clauses import (
    DECIDED,
    FALSE,
    FOREVER,
    LIMIT_PRODUCT,
    OPEN,
    TRUE,
    UNKNOWN,
    UNKNOWN_NUMBER,
    Block,
    Clauses,
    Grown,
    Obligation,
    alone,
    conjoin,
    disjoin,
    size,
)

Verdict: TypeAlias = Literal["true", "false", "undecided"]

LIMIT_LEFT: Final = 100_000
"""Most obligations of one remainder: always and eventually in turn, nested without a bound, know no end."""
LIMIT_STATES: Final = 4096
"""An automaton keeps no more states than this; beyond, remainders are worked out again at each state."""
LIMIT_TRANSITIONS: Final = 8 * LIMIT_STATES
_TRUTHS: Final = (FALSE, TRUE, UNKNOWN)
"""By the digit of a truth assignment: 0 false, 1 true, 2 without a value."""
_NEGATED: Final = (TRUE, FALSE, UNKNOWN)


class TruthAssignment:
    """One truth assignment of `atoms` atoms: the digit of each, and values computed for it.

    `moment` is the state itself, for growing quantifiers, which no automaton has.
    """

    __slots__ = ("digits", "moment", "started")

    def __init__(self, number: int, atoms: int, moment: Moment | None = None) -> None:
        self.moment = moment
        digits = []
        for _ in range(atoms):
            number, digit = divmod(number, 3)
            digits.append(digit)
        self.digits = tuple(digits)
        self.started: dict[int, Clauses] = {}


class Growing(Protocol):
    """A growing quantifier over a temporal body."""

    def step(self, number: int, before: tuple[tuple[str, Any], ...], moment: Moment) -> Clauses:
        """The remainder after one more state; nothing before: it starts."""


class Progressor:
    """Definition 7.5.3 for one skeleton.

    Args:
        period_us: no state lies closer to another than this (F3); None if nothing is known.
        growing: its growing quantifiers.
        limit: a disjunction that would be distributed into more clauses keeps blocks.
    """

    def __init__(
        self, skeleton: Skeleton, period_us: int | None, growing: Sequence[Growing] = (), limit: int = LIMIT_PRODUCT
    ) -> None:
        self.skeleton, self._period_us = skeleton, period_us
        self._growing, self._limit = growing, limit
        self._step_us = period_us or 1
        self._root = len(skeleton.nodes) - 1
        self._operators: dict[int, SkeletonNode] = {}
        self._numbers: dict[int, int] = {}
        self._assignments: dict[int, TruthAssignment] = {}
        for at, node in enumerate(skeleton.nodes):
            if node.kind in {"always", "eventually", "until", "release"}:
                number = 2 * len(self._operators) + (node.kind in {"always", "release"})
                self._operators[number], self._numbers[at] = node, number

    def node_of(self, number: int) -> int:
        """The node of an obligation's operator."""
        return next(at for at, known in self._numbers.items() if known == number)

    def assignment(self, number: int, moment: Moment | None = None) -> TruthAssignment:
        """The truth assignment with this number; the latest ones are kept with their computed values.

        With growing quantifiers it is that of one state, `moment`.
        """
        if self._growing:
            return TruthAssignment(number, self.skeleton.atoms, moment)
        found = self._assignments.get(number)
        if found is None:
            if len(self._assignments) >= LIMIT_STATES:
                self._assignments.clear()
            found = self._assignments[number] = TruthAssignment(number, self.skeleton.atoms)
        return found

    def start(self, assignment: TruthAssignment, node: int | None = None) -> Clauses:
        """The remainder of a node after the state in which it starts, relative to that state."""
        at = self._root if node is None else node
        found = assignment.started.get(at)
        if found is None:
            found = assignment.started[at] = self._start(self.skeleton.nodes[at], at, assignment)
        return found

    def _start(self, node: SkeletonNode, at: int, assignment: TruthAssignment) -> Clauses:
        if node.kind == "atom":
            atom, negated = node.parts
            return (_NEGATED if negated else _TRUTHS)[assignment.digits[atom]]
        if node.kind == "constant":
            return TRUE if node.parts[0] else FALSE
        if node.kind == "and":
            return conjoin([self.start(assignment, one) for one in node.parts])
        if node.kind == "or":
            return disjoin([self.start(assignment, one) for one in node.parts], self._limit)
        if node.kind == "growing":
            return self._grown(Grown(node.parts[0], ()), assignment)
        ends_us = FOREVER if node.hi_us is None else node.hi_us
        return self._window((self._numbers[at], node.lo_us or OPEN, ends_us), assignment, 0, 0)

    def step(self, clauses: Clauses, assignment: TruthAssignment, now_us: int, base_us: int) -> Clauses:
        """The remainder after one more state; of more than `LIMIT_LEFT` obligations nothing will be known.

        Args:
            clauses: windows relative to some instant.
            assignment: of the state.
            now_us: its time, relative to the same instant.
            base_us: the instant that the windows of the result are relative to, likewise.
        """
        found = self._step(clauses, assignment, now_us, base_us)
        return found if size(found) <= LIMIT_LEFT else UNKNOWN

    def _step(self, clauses: Clauses, assignment: TruthAssignment, now_us: int, base_us: int) -> Clauses:
        left: dict[Any, Clauses] = {}
        for clause in clauses:
            for one in clause:
                if one not in left:
                    left[one] = self.after(one, assignment, now_us, base_us)
        if len(clauses) == 1:
            (clause,) = clauses
            return disjoin([left[one] for one in clause], self._limit)
        limit = self._limit // len(clauses)
        return conjoin([disjoin([left[one] for one in clause], limit) for clause in clauses])

    def _grown(self, one: Grown, assignment: TruthAssignment) -> Clauses:
        assert assignment.moment is not None  # noqa: S101 - tells the type checker what `assignment()` ensures
        return self._growing[one.number].step(one.number, one.members, assignment.moment)

    def after(self, one: Any, assignment: TruthAssignment, now_us: int, base_us: int) -> Clauses:
        """The remainder of one obligation or block after one more state, as `step`."""
        if isinstance(one, Block):
            return self._step(one.clauses, assignment, now_us, base_us)
        if isinstance(one, Grown):
            return self._grown(one, assignment)
        return UNKNOWN if one[0] == UNKNOWN_NUMBER else self._window(one, assignment, now_us, base_us)

    def _window(self, one: Obligation, assignment: TruthAssignment, now_us: int, base_us: int) -> Clauses:
        number, from_us, to_us = one
        node = self._operators[number]
        universal = number & 1
        if to_us < now_us:
            return TRUE if universal else FALSE
        until = node.kind in {"until", "release"}
        closes = to_us < now_us + self._step_us if self._period_us else to_us <= now_us
        rest_us = FOREVER if to_us == FOREVER else to_us - base_us
        if from_us > now_us:
            if closes:
                return TRUE if universal else FALSE
            opens_us = OPEN if from_us <= now_us + self._step_us else from_us - base_us
            rest = alone(number, opens_us, rest_us)
            return self._with_left(node, universal, rest, assignment, now_us - base_us) if until else rest
        found = self._started(node.parts[-1], assignment, now_us - base_us)
        if closes or found == (FALSE if universal else TRUE):
            return found
        rest = alone(number, OPEN, rest_us)
        if until:
            rest = self._with_left(node, universal, rest, assignment, now_us - base_us)
        return conjoin((found, rest)) if universal else disjoin((found, rest), self._limit)

    def _with_left(
        self, node: SkeletonNode, universal: int, rest: Clauses, assignment: TruthAssignment, ahead_us: int
    ) -> Clauses:
        """Until needs its left side as well; release, its dual, needs the rest only without it."""
        left = self._started(node.parts[0], assignment, ahead_us)
        return disjoin((left, rest), self._limit) if universal else conjoin((left, rest))

    def _started(self, node: int, assignment: TruthAssignment, ahead_us: int) -> Clauses:
        found = self.start(assignment, node)
        return moved(found, ahead_us) if ahead_us else found


def moved(clauses: Clauses, by_us: int) -> Clauses:
    """The same windows seen from an instant `by_us` earlier."""
    return frozenset([frozenset([_moved(one, by_us) for one in clause]) for clause in clauses])


def _moved(one: Any, by_us: int) -> Any:
    if isinstance(one, Block):
        return Block(moved(one.clauses, by_us))
    if isinstance(one, Grown):
        return one
    number, from_us, to_us = one
    return (
        number,
        from_us if from_us == OPEN else from_us + by_us,
        to_us if to_us == FOREVER else to_us + by_us,
    )


class AutomatonState:
    """A remainder as a state of an automaton; equal for equal remainders.

    Attributes:
        number: of the automaton's states; -1 if it does not keep this one.
        after: states met after it, by reading, but for those that decide, which are in `ends`.
        left: True, False or None if it is decided, else the state itself: a residual as in `residuals.py`.
    """

    __slots__ = ("after", "clauses", "ends", "is_decided", "left", "number", "verdict")

    def __init__(self, clauses: Clauses, number: int) -> None:
        self.clauses, self.number = clauses, number
        self.verdict: Verdict = "true" if not clauses else "false" if clauses == FALSE else "undecided"
        self.is_decided = clauses in DECIDED
        self.left: AutomatonState | bool | None = _TRUTH[clauses] if self.is_decided else self
        self.after: dict[int, AutomatonState] = {}
        self.ends: dict[int, AutomatonState] = {}

    def __eq__(self, other: object) -> bool:
        return self is other or (isinstance(other, AutomatonState) and self.clauses == other.clauses)

    def __hash__(self) -> int:
        return hash(self.clauses)


_TRUTH: Final = {TRUE: True, FALSE: False, UNKNOWN: None}


class Figures(NamedTuple):
    """How large an automaton has grown: states, transitions, obligations in the largest state."""

    states: int
    transitions: int
    largest: int


class Automaton:
    """The states of one skeleton and period, made as they are met.

    A reading is a truth assignment plus `assignments` times the number of the gap: of the time since the state before, 0 for the
    period. State 0 is false, 1 true, 2 undecided for ever, 3 the formula before its first state.

    Attributes:
        assignments: how many truth assignments there are.
        is_full: no more states are kept; others are computed each time.
    """

    def __init__(self, skeleton: Skeleton, period_us: int | None) -> None:
        self.progressor = Progressor(skeleton, period_us)
        self.assignments: int = 3**skeleton.atoms
        self.states: list[AutomatonState] = []
        self._known: dict[Clauses, AutomatonState] = {}
        self._started: dict[int, AutomatonState] = {}
        self._conjoined: dict[tuple[int, ...], AutomatonState] = {}
        self._gaps: dict[int, int] = {}
        self._gap_of: dict[int, int] = {}
        self._transitions = 0
        if period_us:
            self.gap(period_us)
        self.false, self.true, self.unknown = map(self.state, _TRUTHS)
        self.beginning = AutomatonState(TRUE, 3)
        self.beginning.verdict, self.beginning.is_decided, self.beginning.left = "undecided", False, self.beginning
        self.states.append(self.beginning)

    def state(self, clauses: Clauses) -> AutomatonState:
        """The state that keeps these clauses; one of its own if the automaton is full."""
        found = self._known.get(clauses)
        if found is None:
            if self.is_full:
                return AutomatonState(clauses, -1)
            found = self._known[clauses] = AutomatonState(clauses, len(self.states))
            self.states.append(found)
        return found

    @property
    def is_full(self) -> bool:
        return len(self.states) > LIMIT_STATES or self._transitions > LIMIT_TRANSITIONS

    @property
    def figures(self) -> Figures:
        return Figures(len(self.states), self._transitions, max(size(state.clauses) for state in self.states))

    def gap(self, gap_us: int) -> int | None:
        """The offset of a reading for the time since the state before; None if there are too many."""
        number = self._gaps.get(gap_us)
        if number is None:
            if len(self._gaps) >= LIMIT_GAPS:
                return None
            number = self._gaps[gap_us] = len(self._gaps)
            self._gap_of[number] = gap_us
        return number * self.assignments

    def start(self, assignment: int) -> AutomatonState:
        """After the state in which the formula starts."""
        found = self._started.get(assignment)
        if found is None:
            found = self.state(self.progressor.start(self.progressor.assignment(assignment)))
            if not self.is_full:
                self._started[assignment] = found
        return found

    def step(self, state: AutomatonState, reading: int) -> AutomatonState:
        """After one more state; `state.after.get(reading)` is faster where it has one."""
        if state.is_decided:
            return state
        found = state.after.get(reading) or state.ends.get(reading)
        if found is None:
            gap, assignment = divmod(reading, self.assignments)
            found = (
                self.start(assignment)
                if state is self.beginning
                else self.pass_by(state, assignment, self._gap_of[gap])
            )
            if not self.is_full:
                (state.ends if found.is_decided else state.after)[reading] = found
                self._transitions += 1
        return found

    def pass_by(self, state: AutomatonState, assignment: int, gap_us: int) -> AutomatonState:
        """After one more state, without the memory: the gap is none that the automaton knows."""
        if state.is_decided:
            return state
        return self.state(self.progressor.step(state.clauses, self.progressor.assignment(assignment), gap_us, gap_us))

    def conjoin(self, states: Iterable[AutomatonState]) -> AutomatonState:
        """The state in which all of these are kept."""
        several = tuple(states)
        key = tuple(sorted({state.number for state in several}))
        found = self._conjoined.get(key)
        if found is None or key[0] < 0:
            found = self.state(conjoin([state.clauses for state in several]))
            if not self.is_full and key[0] >= 0:
                self._conjoined[key] = found
                self._transitions += 1
        return found


LIMIT_GAPS: Final = 16
"""An automaton knows no more different gaps between states than this; sampling with others is irregular."""


@lru_cache(maxsize=256)
def automaton(skeleton: Skeleton, period_us: int | None) -> Automaton:
    """The automaton that all formulas of this skeleton share."""
    return Automaton(skeleton, period_us)
