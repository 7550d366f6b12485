"""A formula that is started anew at every state, as the phi of `always phi` when its alarm is watched (F8).

What a start leaves is a residual: True, False, None, or something that `step` takes through the next state. All residuals
of one formula are stepped through every state, and those of states in a row can be conjoined.
"""

from collections.abc import Sequence
from typing import Any, Protocol

from reasoning.automaton import Automaton, Progressor, State, automaton, moved
from reasoning.evaluation import Compiler, Moment, NoValuePolicy
from reasoning.explaining import Explainer, Reason
from reasoning.formulas import Domains, Formula, is_temporal
from reasoning.letters import reader
from reasoning.progression import compile_operator
from reasoning.residuals import Operator, Residual, conjoin
from reasoning.shapes import Grows, TakenApart, take_apart


class Startable(Protocol):
    """A formula that can be started at any state."""

    def read(self, moment: Moment) -> Any:
        """What `start` and `step` need of a state; to be called once for each, in order."""

    def start(self, reading: Any) -> Any:
        """What is left after the state in which the formula starts."""

    def step(self, residual: Any, reading: Any) -> Any:
        """What is left of a pending residual after one more state."""

    def conjoin(self, residuals: Sequence[Any]) -> Any:
        """Both, or all, of them."""

    def explain(self, left: Any, reading: Any, moment: Moment) -> tuple[Reason, ...]:
        """Why `left`, or the start if that is None, became false at this state."""


def startable(
    formula: Formula, domains: Domains, period_us: int | None = None, no_value: NoValuePolicy = "undecided"
) -> Startable:
    """On the automaton of its shape; plain if it is about one state only, or grows over several."""
    if is_temporal(formula):
        compiler = Compiler(domains, no_value)
        try:
            found = take_apart(formula, domains, compiler)
        except Grows:
            pass
        else:
            return OnAutomaton(found, Compiler(domains, no_value), automaton(found.shape, period_us))
    return Plain(compile_operator(formula, domains, period_us, no_value), formula, domains, no_value)


class Plain:
    """By the residuals of plain progression."""

    def __init__(
        self, operator: Operator, formula: Formula, domains: Domains, no_value: NoValuePolicy = "undecided"
    ) -> None:
        self.start = operator.start
        self._formula, self._domains, self._no_value = formula, domains, no_value

    def read(self, moment: Moment) -> Moment:
        return moment

    def step(self, residual: Any, moment: Moment) -> Residual:
        found: Residual = residual.step(moment)
        return found

    def conjoin(self, residuals: Sequence[Residual]) -> Residual:
        return conjoin(residuals)

    def explain(self, left: Any, _reading: Moment, moment: Moment) -> tuple[Reason, ...]:
        if left is not None or is_temporal(self._formula):
            return ()
        compiler = Compiler(self._domains, self._no_value)
        found = take_apart(self._formula, compiler.domains, compiler)
        progressor = Progressor(found.shape, None)
        letter = progressor.letter(reader(found.atoms, compiler)(*moment))
        return Explainer(found, progressor, compiler, None, letter, moment).reasons(truth=False)


class OnAutomaton:
    """By the states of an automaton."""

    def __init__(self, taken_apart: TakenApart, compiler: Compiler, shared: Automaton) -> None:
        self._taken_apart, self._compiler = taken_apart, compiler
        self._read, self._automaton = reader(taken_apart.atoms, compiler), shared
        self._valid_us: int | None = None

    def read(self, moment: Moment) -> tuple[int, int, int | None]:
        """(letter, gap, reading); no reading if the automaton does not know the gap."""
        valid_us = moment.valid_us
        letter = self._read(*moment)
        gap_us = 0 if self._valid_us is None else valid_us - self._valid_us
        self._valid_us = valid_us
        offset = self._automaton.gap(gap_us) if gap_us else 0
        return letter, gap_us, None if offset is None else offset + letter

    def start(self, reading: tuple[int, int, int | None]) -> State | bool | None:
        return self._automaton.start(reading[0]).left

    def step(self, residual: State, reading: tuple[int, int, int | None]) -> State | bool | None:
        letter, gap_us, number = reading
        if number is None:
            return self._automaton.pass_by(residual, letter, gap_us).left
        found = residual.after.get(number)
        return self._automaton.step(residual, number).left if found is None else found

    def conjoin(self, residuals: Sequence[State | bool | None]) -> State | bool | None:
        known = self._automaton
        truths = {True: known.true, False: known.false, None: known.unknown}
        return known.conjoin(one if isinstance(one, State) else truths[one] for one in residuals).left

    def explain(self, left: State | None, reading: tuple[int, int, int | None], moment: Moment) -> tuple[Reason, ...]:
        letter, gap_us, _ = reading
        progressor = self._automaton.progressor
        before = None if left is None else moved(left.clauses, moment.valid_us - gap_us)
        compiler = Compiler(self._compiler.domains)
        explainer = Explainer(self._taken_apart, progressor, compiler, before, progressor.letter(letter), moment)
        return explainer.reasons(truth=False)
