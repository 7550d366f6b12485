"""Progression of a shape (Def. 7.5.3), and the automaton that remembers it.

What is left of a formula after a state is a conjunction of clauses (`clauses.py`) whose windows are relative to that
state. It is a state of an automaton; a letter is the truth of all atoms in the next state together with the time that
has passed. Transitions are worked out when they are met first, and kept: formulas of one shape and period share them.
"""

from collections.abc import Iterable
from functools import lru_cache
from typing import Any, Final, NamedTuple

from reasoning.clauses import (
    DECIDED,
    DOUBT,
    FALSE,
    FOREVER,
    LIMIT_PRODUCT,
    OPEN,
    TRUE,
    UNKNOWN,
    Block,
    Clauses,
    Obligation,
    alone,
    conjoin,
    disjoin,
    size,
)
from reasoning.progression import Verdict
from reasoning.shapes import Part, Shape

LIMIT_LEFT: Final = 100_000
"""So many obligations may be left of one formula: always and eventually in turn, nested without a bound, know no end."""
LIMIT_STATES: Final = 4096
"""An automaton keeps no more states than this; beyond, what is left is worked out anew at each state."""
LIMIT_TRANSITIONS: Final = 8 * LIMIT_STATES
_TRUTHS: Final = (FALSE, TRUE, UNKNOWN)
"""By the digit of a letter: 0 false, 1 true, 2 without a value."""
_NEGATED: Final = (TRUE, FALSE, UNKNOWN)


class Letter:
    """One letter over `atoms` atoms: the digit of each, and what is worked out for it."""

    __slots__ = ("digits", "started")

    def __init__(self, number: int, atoms: int) -> None:
        digits = []
        for _ in range(atoms):
            number, digit = divmod(number, 3)
            digits.append(digit)
        self.digits = tuple(digits)
        self.started: dict[int, Clauses] = {}


class Progressor:
    """Definition 7.5.3 for one shape.

    Args:
        period_us: no state lies closer to another than this (F3); None if nothing is known.
    """

    def __init__(self, shape: Shape, period_us: int | None) -> None:
        self.shape, self._period_us = shape, period_us
        self._step_us = period_us or 1
        self._root = len(shape.nodes) - 1
        self._operators: dict[int, Part] = {}
        self._numbers: dict[int, int] = {}
        self._letters: dict[int, Letter] = {}
        for at, node in enumerate(shape.nodes):
            if node.kind in {"always", "eventually", "until", "release"}:
                number = 2 * len(self._operators) + (node.kind in {"always", "release"})
                self._operators[number], self._numbers[at] = node, number

    def node_of(self, number: int) -> int:
        """The node of an obligation's operator."""
        return next(at for at, known in self._numbers.items() if known == number)

    def letter(self, number: int) -> Letter:
        """The letter with this number; those met last are kept with what is worked out for them."""
        found = self._letters.get(number)
        if found is None:
            if len(self._letters) >= LIMIT_STATES:
                self._letters.clear()
            found = self._letters[number] = Letter(number, self.shape.atoms)
        return found

    def start(self, letter: Letter, node: int | None = None) -> Clauses:
        """What is left of a node after the state in which it starts, relative to that state."""
        at = self._root if node is None else node
        found = letter.started.get(at)
        if found is None:
            found = letter.started[at] = self._start(self.shape.nodes[at], at, letter)
        return found

    def _start(self, node: Part, at: int, letter: Letter) -> Clauses:
        if node.kind == "atom":
            atom, negated = node.parts
            return (_NEGATED if negated else _TRUTHS)[letter.digits[atom]]
        if node.kind == "constant":
            return TRUE if node.parts[0] else FALSE
        if node.kind == "and":
            return conjoin([self.start(letter, one) for one in node.parts])
        if node.kind == "or":
            return disjoin([self.start(letter, one) for one in node.parts])
        ends_us = FOREVER if node.hi_us is None else node.hi_us
        return self._window((self._numbers[at], node.lo_us or OPEN, ends_us), letter, 0, 0)

    def step(self, clauses: Clauses, letter: Letter, now_us: int, base_us: int) -> Clauses:
        """What is left after one more state; of more than `LIMIT_LEFT` obligations nothing will be known.

        Args:
            clauses: windows relative to some instant.
            letter: of the state.
            now_us: its time, relative to the same instant.
            base_us: what the windows of the result are to be relative to, likewise.
        """
        found = self._step(clauses, letter, now_us, base_us)
        return found if size(found) <= LIMIT_LEFT else UNKNOWN

    def _step(self, clauses: Clauses, letter: Letter, now_us: int, base_us: int) -> Clauses:
        left: dict[Any, Clauses] = {}
        for clause in clauses:
            for one in clause:
                if one not in left:
                    left[one] = self.after(one, letter, now_us, base_us)
        if len(clauses) == 1:
            (clause,) = clauses
            return disjoin([left[one] for one in clause])
        limit = LIMIT_PRODUCT // len(clauses)
        return conjoin([disjoin([left[one] for one in clause], limit) for clause in clauses])

    def after(self, one: Obligation | Block, letter: Letter, now_us: int, base_us: int) -> Clauses:
        """What is left of one obligation or block after one more state, as `step`."""
        if isinstance(one, Block):
            return self._step(one.clauses, letter, now_us, base_us)
        return UNKNOWN if one[0] == DOUBT else self._window(one, letter, now_us, base_us)

    def _window(self, one: Obligation, letter: Letter, now_us: int, base_us: int) -> Clauses:
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
            return self._with_left(node, universal, rest, letter, now_us - base_us) if until else rest
        found = self._started(node.parts[-1], letter, now_us - base_us)
        if closes or found == (FALSE if universal else TRUE):
            return found
        rest = alone(number, OPEN, rest_us)
        if until:
            rest = self._with_left(node, universal, rest, letter, now_us - base_us)
        return conjoin((found, rest)) if universal else disjoin((found, rest))

    def _with_left(self, node: Part, universal: int, rest: Clauses, letter: Letter, ahead_us: int) -> Clauses:
        """Until needs its left side as well; release, its dual, needs the rest only without it."""
        left = self._started(node.parts[0], letter, ahead_us)
        return disjoin((left, rest)) if universal else conjoin((left, rest))

    def _started(self, node: int, letter: Letter, ahead_us: int) -> Clauses:
        found = self.start(letter, node)
        return moved(found, ahead_us) if ahead_us else found


def moved(clauses: Clauses, by_us: int) -> Clauses:
    """The same windows seen from an instant `by_us` earlier."""
    return frozenset([frozenset([_moved(one, by_us) for one in clause]) for clause in clauses])


def _moved(one: Any, by_us: int) -> Any:
    if isinstance(one, Block):
        return Block(moved(one.clauses, by_us))
    number, from_us, to_us = one
    return (
        number,
        from_us if from_us == OPEN else from_us + by_us,
        to_us if to_us == FOREVER else to_us + by_us,
    )


class State:
    """What is left, as a state of an automaton; equal if as much is left.

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
        self.left: State | bool | None = _TRUTH[clauses] if self.is_decided else self
        self.after: dict[int, State] = {}
        self.ends: dict[int, State] = {}

    def __eq__(self, other: object) -> bool:
        return self is other or (isinstance(other, State) and self.clauses == other.clauses)

    def __hash__(self) -> int:
        return hash(self.clauses)


_TRUTH: Final = {TRUE: True, FALSE: False, UNKNOWN: None}


class Figures(NamedTuple):
    """How large an automaton has grown: states, transitions, obligations in the largest state."""

    states: int
    transitions: int
    largest: int


class Automaton:
    """The states of one shape and period, made as they are met.

    A reading is a letter plus `letters` times the number of the gap: of the time since the state before, 0 for the
    period. State 0 is false, 1 true, 2 undecided for ever, 3 the formula before its first state.

    Attributes:
        letters: how many letters there are.
        is_full: no more is kept; what is not known is worked out anew each time.
    """

    def __init__(self, shape: Shape, period_us: int | None) -> None:
        self.progressor = Progressor(shape, period_us)
        self.letters: int = 3**shape.atoms
        self.states: list[State] = []
        self._known: dict[Clauses, State] = {}
        self._started: dict[int, State] = {}
        self._conjoined: dict[tuple[int, ...], State] = {}
        self._gaps: dict[int, int] = {}
        self._gap_of: dict[int, int] = {}
        self._transitions = 0
        if period_us:
            self.gap(period_us)
        self.false, self.true, self.unknown = map(self.state, _TRUTHS)
        self.beginning = State(TRUE, 3)
        self.beginning.verdict, self.beginning.is_decided, self.beginning.left = "undecided", False, self.beginning
        self.states.append(self.beginning)

    def state(self, clauses: Clauses) -> State:
        """The state that keeps these clauses; one of its own if the automaton is full."""
        found = self._known.get(clauses)
        if found is None:
            if self.is_full:
                return State(clauses, -1)
            found = self._known[clauses] = State(clauses, len(self.states))
            self.states.append(found)
        return found

    @property
    def is_full(self) -> bool:
        return len(self.states) > LIMIT_STATES or self._transitions > LIMIT_TRANSITIONS

    @property
    def figures(self) -> Figures:
        return Figures(len(self.states), self._transitions, max(size(state.clauses) for state in self.states))

    def gap(self, gap_us: int) -> int | None:
        """What a reading adds to its letter for the time since the state before; None if there are too many."""
        number = self._gaps.get(gap_us)
        if number is None:
            if len(self._gaps) >= LIMIT_GAPS:
                return None
            number = self._gaps[gap_us] = len(self._gaps)
            self._gap_of[number] = gap_us
        return number * self.letters

    def start(self, letter: int) -> State:
        """After the state in which the formula starts."""
        found = self._started.get(letter)
        if found is None:
            found = self.state(self.progressor.start(self.progressor.letter(letter)))
            if not self.is_full:
                self._started[letter] = found
        return found

    def step(self, state: State, reading: int) -> State:
        """After one more state; `state.after.get(reading)` is faster where it has one."""
        if state.is_decided:
            return state
        found = state.after.get(reading) or state.ends.get(reading)
        if found is None:
            gap, letter = divmod(reading, self.letters)
            found = self.start(letter) if state is self.beginning else self.pass_by(state, letter, self._gap_of[gap])
            if not self.is_full:
                (state.ends if found.is_decided else state.after)[reading] = found
                self._transitions += 1
        return found

    def pass_by(self, state: State, letter: int, gap_us: int) -> State:
        """After one more state, worked out anew: the gap is none that the automaton knows."""
        if state.is_decided:
            return state
        return self.state(self.progressor.step(state.clauses, self.progressor.letter(letter), gap_us, gap_us))

    def conjoin(self, states: Iterable[State]) -> State:
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
def automaton(shape: Shape, period_us: int | None) -> Automaton:
    """The automaton that all formulas of this shape share."""
    return Automaton(shape, period_us)
