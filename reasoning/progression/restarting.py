"""A formula that is restarted at every state, as the phi of `always phi` when its alarm is watched (F8).

The remainder of a start is a residual: True, False, None, or something that `step` takes through the next state. All
residuals of one formula are stepped through every state, and those of states in a row can be conjoined.
"""

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any, Final, Protocol

from dyknow.reasoning.formulas.evaluation import TRUTHS, EvaluationCompiler, Moment, NoValuePolicy, Test, Truth
from dyknow.reasoning.formulas.skeletons import TakenApart, take_apart
from dyknow.reasoning.formulas.tree import (
    Domains,
    Exists,
    Forall,
    Formula,
    Not,
    domain_members,
    instantiate,
    is_temporal,
)
from dyknow.reasoning.progression.automaton import (
    Automaton,
    AutomatonState,
    Progressor,
    TruthAssignment,
    automaton,
    moved,
)
from dyknow.reasoning.progression.clauses import DECIDED, FALSE, LIMIT_PRODUCT, TRUE, UNKNOWN, Clauses, Grown, conjoin
from dyknow.reasoning.progression.explaining import Explainer, Explanation

FEW_MEMBERS: Final = 16
CLAUSES_OF: Final = {True: TRUE, False: FALSE, None: UNKNOWN}
TRUTH_OF: Final = {clauses: truth for truth, clauses in CLAUSES_OF.items()}


class Startable(Protocol):
    """A formula that can be started at any state."""

    def read(self, moment: Moment) -> Any:
        """The input of `start` and `step` from a state; to be called once for each, in order."""

    def start(self, reading: Any) -> Any:
        """The remainder after the state in which the formula starts."""

    def step(self, residual: Any, reading: Any) -> Any:
        """The remainder of a pending residual after one more state."""

    def conjoin(self, residuals: Sequence[Any]) -> Any:
        """Both, or all, of them."""

    def explain(self, left: Any, reading: Any, moment: Moment) -> tuple[Explanation, ...]:
        """Why `left`, or the start if that is None, became false at this state."""


def restartable(
    formula: Formula,
    domains: Domains,
    period_us: int | None = None,
    no_value: NoValuePolicy = "undecided",
    compiler: EvaluationCompiler | None = None,
) -> Startable:
    """On the automaton of its skeleton if that is fixed; `compiler` bounds the size of this and others."""
    if not is_temporal(formula):
        return OneState(formula, compiler or EvaluationCompiler(domains, no_value))
    found = take_apart(formula, domains, compiler or EvaluationCompiler(domains, no_value))
    reading = EvaluationCompiler(domains, no_value)
    if found.growing or found.is_deep:
        return OnClauses(found, reading, progressor_of(found, domains, period_us, no_value, compiler))
    return OnAutomaton(found, reading, automaton(found.skeleton, period_us))


def progressor_of(
    taken_apart: TakenApart,
    domains: Domains,
    period_us: int | None,
    no_value: NoValuePolicy,
    compiler: EvaluationCompiler | None,
) -> Progressor:
    """The progressor of a formula without an automaton: it grows with its domains, or is too deep to distribute."""
    compiler = compiler or EvaluationCompiler(domains, no_value)

    def instance(formula: Formula) -> Startable:
        return restartable(formula, domains, period_us, no_value, compiler)

    growing = [GrowingQuantifier(*one, instance, compiler) for one in taken_apart.growing]
    return Progressor(taken_apart.skeleton, period_us, growing, 1 if taken_apart.is_deep else LIMIT_PRODUCT)


def is_pending(residual: object) -> bool:
    """Whether further states decide it."""
    return residual is not None and residual is not True and residual is not False


class OneState:
    """A formula about one state: its residuals are truth values."""

    def __init__(self, formula: Formula, compiler: EvaluationCompiler) -> None:
        self._formula, self._compiler = formula, compiler
        self._test = compiler.test(formula)

    def read(self, moment: Moment) -> Moment:
        return moment

    def start(self, reading: Moment) -> Truth:
        return TRUTHS[self._test(*reading)]

    def step(self, residual: Any, _reading: Any) -> Any:
        return residual

    def conjoin(self, residuals: Sequence[Truth]) -> Truth:
        return False if False in residuals else None if None in residuals else True

    def explain(self, left: Any, _reading: Moment, moment: Moment) -> tuple[Explanation, ...]:
        if left is not None:
            return ()
        found, progressor, read = self._parts
        assignment = progressor.assignment(read(*moment))
        return Explainer(found, progressor, self._compiler.again(), None, assignment, moment).reasons(truth=False)

    @cached_property
    def _parts(self) -> tuple[TakenApart, Progressor, Test]:
        """The formula as it is explained, compiled at the first alarm."""
        compiler = self._compiler.again()
        found = take_apart(self._formula, compiler.domains, compiler)
        return found, Progressor(found.skeleton, None), compiler.assignment(found.atoms)


class GrowingQuantifier:
    """A growing quantifier over a temporal body (F6): members that appear are added, those that leave are dropped.

    Args:
        formula: the quantifier, and whether it stands negated.
        instance: makes the body of one member.
        compiler: counts the nodes of all instances.
    """

    def __init__(
        self,
        formula: Forall | Exists,
        negated: bool,
        instance: Callable[[Formula], Startable],
        compiler: EvaluationCompiler,
    ) -> None:
        self._universal = isinstance(formula, Forall) is not negated
        self._body = Not(formula.body) if negated else formula.body
        self._variable, self._domain = formula.variable, formula.domain
        self._instance, self._compiler = instance, compiler
        self._instances: dict[str, tuple[Startable, int]] = {}
        self._valid_us: int | None = None
        self._readings: dict[str, Any] = {}

    def step(self, number: int, before: tuple[tuple[str, Any], ...], moment: Moment) -> Clauses:
        """The remainder after one more state; nothing before: it starts. Doubt leaves with the member it is about."""
        known, after = dict(before), {}
        for member in self._members(moment):
            instance, reading = self._read(member, moment)
            if member not in known:
                after[member] = instance.start(reading)
            else:
                left = known[member]
                after[member] = instance.step(left, reading) if is_pending(left) else left
        if any(left is (not self._universal) for left in after.values()):
            return FALSE if self._universal else TRUE
        if after and all(left is self._universal for left in after.values()):
            return TRUE if self._universal else FALSE
        grown: Any = Grown(number, tuple(after.items()))
        return frozenset((frozenset((grown,)),))

    def _members(self, moment: Moment) -> tuple[str, ...]:
        """Members at this state; when most of those that were met have left, they are forgotten."""
        if moment.valid_us != self._valid_us:
            self._valid_us, self._readings = moment.valid_us, {}
        members = domain_members(self._domain, moment.domains)
        if len(self._instances) > 2 * len(members) + FEW_MEMBERS:
            for gone in self._instances.keys() - set(members):
                self._compiler.nodes_left += self._instances.pop(gone)[1]
        return members

    def _read(self, member: str, moment: Moment) -> tuple[Startable, Any]:
        """The instance of a member, and its reading of this state; each is read once a state."""
        if member not in self._instances:
            before = self._compiler.nodes_left
            instance = self._instance(instantiate(self._body, self._variable, member))
            self._instances[member] = instance, before - self._compiler.nodes_left
        instance = self._instances[member][0]
        if member not in self._readings:
            self._readings[member] = instance.read(moment)
        return instance, self._readings[member]


class OnClauses:
    """By clauses with absolute windows, for formulas that have no automaton."""

    def __init__(self, taken_apart: TakenApart, compiler: EvaluationCompiler, progressor: Progressor) -> None:
        self._read, self._progressor = compiler.assignment(taken_apart.atoms), progressor

    def read(self, moment: Moment) -> tuple[TruthAssignment, int]:
        return self._progressor.assignment(self._read(*moment), moment), moment.valid_us

    def start(self, reading: tuple[TruthAssignment, int]) -> Clauses | bool | None:
        assignment, valid_us = reading
        return _truth_or(moved(self._progressor.start(assignment), valid_us))

    def step(self, residual: Clauses, reading: tuple[TruthAssignment, int]) -> Clauses | bool | None:
        assignment, valid_us = reading
        return _truth_or(self._progressor.step(residual, assignment, valid_us, 0))

    def conjoin(self, residuals: Sequence[Clauses | bool | None]) -> Clauses | bool | None:
        return _truth_or(conjoin(one if isinstance(one, frozenset) else CLAUSES_OF[one] for one in residuals))

    def explain(self, _left: Any, _reading: Any, _moment: Moment) -> tuple[Explanation, ...]:
        """Nothing: the readings are not kept."""
        return ()


def _truth_or(clauses: Clauses) -> Clauses | bool | None:
    return TRUTH_OF[clauses] if clauses in DECIDED else clauses


class OnAutomaton:
    """By the states of an automaton."""

    def __init__(self, taken_apart: TakenApart, compiler: EvaluationCompiler, shared: Automaton) -> None:
        self._taken_apart, self._compiler = taken_apart, compiler
        self._read, self._automaton = compiler.assignment(taken_apart.atoms), shared
        self._valid_us: int | None = None

    def read(self, moment: Moment) -> tuple[int, int, int | None]:
        """(truth assignment, gap, reading); no reading if the automaton does not know the gap."""
        valid_us = moment.valid_us
        assignment = self._read(*moment)
        gap_us = 0 if self._valid_us is None else valid_us - self._valid_us
        self._valid_us = valid_us
        offset = self._automaton.gap(gap_us) if gap_us else 0
        return assignment, gap_us, None if offset is None else offset + assignment

    def start(self, reading: tuple[int, int, int | None]) -> AutomatonState | bool | None:
        return self._automaton.start(reading[0]).left

    def step(self, residual: AutomatonState, reading: tuple[int, int, int | None]) -> AutomatonState | bool | None:
        assignment, gap_us, number = reading
        if number is None:
            return self._automaton.pass_by(residual, assignment, gap_us).left
        found = residual.after.get(number)
        return self._automaton.step(residual, number).left if found is None else found

    def conjoin(self, residuals: Sequence[AutomatonState | bool | None]) -> AutomatonState | bool | None:
        known = self._automaton
        truths = {True: known.true, False: known.false, None: known.unknown}
        return known.conjoin(one if isinstance(one, AutomatonState) else truths[one] for one in residuals).left

    def explain(
        self, left: AutomatonState | None, reading: tuple[int, int, int | None], moment: Moment
    ) -> tuple[Explanation, ...]:
        assignment, gap_us, _ = reading
        progressor = self._automaton.progressor
        before = None if left is None else moved(left.clauses, moment.valid_us - gap_us)
        compiler, there = self._compiler.again(), progressor.assignment(assignment)
        return Explainer(self._taken_apart, progressor, compiler, before, there, moment).reasons(truth=False)
