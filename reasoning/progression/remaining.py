"""The remainder of a formula after a state, as a formula again (thesis 7.5.2, 7.10): to be read, printed and compared.

After `always eventually[0, 1s] p` has met p false twice it is `eventually[0, 800ms] p and always eventually[0, 1s] p`:
relative to the next state, bounds clamped at zero, what follows from the rest left out.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Final

from dyknow.reasoning.formulas.skeletons import TakenApart
from dyknow.reasoning.formulas.tree import Always, And, Const, Eventually, Feature, Formula, Not, Or, Until
from dyknow.reasoning.progression.clauses import FOREVER, UNKNOWN_NUMBER, Block, Clause, Clauses, Literal
from dyknow.reasoning.progression.engine import FastProgression, Progressing

UNDECIDED: Final = Feature("no_value")
"""Stands for a formula that is undecided for ever: a feature that never has a value."""


def remaining(progression: Progressing) -> Formula | None:
    """The formula that must hold from the next state on for the whole to hold; None before the first state, and for
    what grows with its domains.

    Its times count from the next state if the period is known, else from the newest, which itself counts no more.
    """
    if not isinstance(progression, FastProgression) or progression.taken_apart is None or progression.left is None:
        return None
    return _Writer(progression.taken_apart, progression.period_us or 0).clauses(progression.left)


_OPERATORS: Final = ("always", "eventually", "until", "release")


class _Writer:
    def __init__(self, taken_apart: TakenApart, step_us: int) -> None:
        self._origins = taken_apart.origins
        self._operators = [at for at, node in enumerate(taken_apart.skeleton.nodes) if node.kind in _OPERATORS]
        self._step_us = step_us

    def clauses(self, clauses: Clauses) -> Formula:
        """Conjuncts that are over first come first, as the thesis writes them."""
        return _joined(And, [self._clause(one) for one in sorted(clauses, key=_end)], empty=True)

    def _clause(self, clause: Clause) -> Formula:
        return _joined(Or, [self._literal(one) for one in sorted(clause, key=_order)], empty=False)

    def _literal(self, one: Literal) -> Formula:
        if isinstance(one, Block):
            return self.clauses(one.clauses)
        number, from_us, to_us = one
        if number == UNKNOWN_NUMBER:
            return UNDECIDED
        hi_us = None if to_us == FOREVER else to_us - self._step_us
        return self._operator(self._operators[number // 2], max(0, from_us - self._step_us), hi_us)

    def _operator(self, at: int, lo_us: int, hi_us: int | None) -> Formula:
        """As it was written, with the bounds that are left."""
        formula, negated, _ = self._origins[at]
        assert isinstance(formula, Always | Eventually | Until)  # noqa: S101 - tells the type checker what a shape is
        left = replace(formula, lo_us=lo_us, hi_us=hi_us)
        return Not(left) if negated else left


def _joined(make: type[And | Or], parts: Sequence[Formula], *, empty: bool) -> Formula:
    if len(parts) == 1:
        return parts[0]
    return make(tuple(parts)) if parts else Const(empty)


def _end(clause: Clause) -> tuple[int, list[tuple[int, ...]]]:
    """When a clause is over at the latest, and its literals, so that the order is always the same."""
    ends = [
        max((_end(each)[0] for each in one.clauses), default=0) if isinstance(one, Block) else one[2] for one in clause
    ]
    return max(ends, default=0), sorted(map(_order, clause))


def _order(one: Literal) -> tuple[int, ...]:
    """Universal operators first, then by number and window; blocks come last."""
    if isinstance(one, Block):
        return (2, *_flat(one.clauses))
    return (1 - one[0] % 2, *one)


def _flat(clauses: Clauses) -> Iterable[int]:
    return (
        number for each in sorted(sorted(map(_order, clause)) for clause in clauses) for one in each for number in one
    )
