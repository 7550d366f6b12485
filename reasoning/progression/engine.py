"""The engine of formulas: one interface, several ways to progress (thesis 7.5.2, 7.10).

    progression = make_progression(formula, period_us=100_000)     # the engine chooses the way
    progression = make_progression(formula, period_us, way="object")
    progression.progress(valid_us, values, domains, events)
    progression.verdict, progression.way, progression.kept

All ways give the same verdict at the same state:

* `object`: one formula at a time on an automaton that all formulas of its skeleton share (`automaton.py`).
* `deadlines`: windows with absolute ends and nothing remembered, for irregular sampling, for growing quantifiers over
  temporal bodies, and for more than `LIMIT_CLAUSES` temporal operators inside one another; also what `object`
  turns into when the automaton has more than `LIMIT_STATES` states, or when gaps between states turn out irregular: the
  automaton knows `LIMIT_GAPS` different ones, and a progression meets more than `LIMIT_GAPS` others.

Chosen are `object` if the period of the states is known, else `deadlines`.
"""

from collections.abc import Collection, Mapping
from copy import copy
from types import MappingProxyType
from typing import Literal, NamedTuple, Protocol, TypeAlias

from dyknow.model.sample import Value
from dyknow.reasoning.formulas.evaluation import EvaluationCompiler, Moment, NoValuePolicy, Test
from dyknow.reasoning.formulas.skeletons import TakenApart, take_apart
from dyknow.reasoning.formulas.tree import Domains, Exists, Forall, Formula, Since, required_labels, walk
from dyknow.reasoning.progression.automaton import (
    LIMIT_GAPS,
    Automaton,
    AutomatonState,
    Progressor,
    TruthAssignment,
    Verdict,
    automaton,
    moved,
)
from dyknow.reasoning.progression.changes import Changes, lacking
from dyknow.reasoning.progression.clauses import Clauses, size
from dyknow.reasoning.progression.explaining import Explainer, Explanation
from dyknow.reasoning.progression.restarting import progressor_of

Way: TypeAlias = Literal["object", "deadlines"]
_NOTHING: Mapping[str, int] = MappingProxyType({})
_NO_DOMAINS: Domains = MappingProxyType({})


class Progressing(Protocol):
    """A formula on its way through states, whichever way."""

    @property
    def formula(self) -> Formula: ...

    @property
    def verdict(self) -> Verdict: ...

    @property
    def is_doubtful(self) -> bool:
        """Whether it is undecided for ever, by an atom without a value."""

    @property
    def valid_us(self) -> int | None:
        """The time of its newest state; None before the first."""

    @property
    def way(self) -> Way:
        """The way it goes now."""

    @property
    def kept(self) -> int:
        """How many obligations are left."""

    def again(self) -> "Progressing":
        """Another one of the formula, before its first state; this one has had none either."""

    def explain(self) -> tuple[Explanation, ...]:
        """The reasons of its truth or falsehood; nothing while it is undecided, or grows with its domains."""

    def progress(
        self,
        valid_us: int,
        values: Mapping[str, Value],
        domains: Domains | None = None,
        events: Collection[str] = (),
    ) -> None:
        """Take one state, as `FastProgression.progress` does."""


def make_progression(
    formula: Formula,
    period_us: int | None = None,
    no_value: NoValuePolicy = "undecided",
    way: Way | None = None,
) -> Progressing:
    """Something that progresses the formula.

    Args:
        formula: checked; times are microseconds.
        period_us: the sample period of the states if it is known: then no state lies closer to another.
        no_value: the truth of an atom over `no_value`; `skip` leaves out states in which a feature has no value.
        way: None lets the engine choose.
    """
    return FastProgression(
        formula, period_us, no_value, deadlines=way == "deadlines" or (way is None and not period_us)
    )


class Decision(NamedTuple):
    """The state that decided, and the remainder before it: windows relative to the epoch. None left: it was the first."""

    left: Clauses | None
    assignment: TruthAssignment
    moment: Moment


class FastProgression:
    """One formula on its automaton, or with absolute deadlines.

    Attributes:
        taken_apart: the formula's atoms and skeleton; None before the first state, and if it has no fixed skeleton.
        decision: the remainder and the state that decided it, once it is decided.
    """

    def __init__(
        self,
        formula: Formula,
        period_us: int | None = None,
        no_value: NoValuePolicy = "undecided",
        *,
        deadlines: bool = False,
    ) -> None:
        self.formula = formula
        self.taken_apart: TakenApart | None = None
        self.decision: Decision | None = None
        self.period_us, self._no_value = period_us, no_value
        self._by_deadlines = deadlines
        self._changes = Changes(formula) if any(isinstance(node, Since) for node in walk(formula)) else None
        self._compiler = EvaluationCompiler()
        self._progressor: Progressor | None = None
        self._read: Test = _unread
        self._automaton: Automaton | None = None
        self._clauses: Clauses | None = None
        self._state: AutomatonState = _BEGINNING
        self._valid_us = 0
        self._started = self._is_ready = False
        self._quick_us: int | None = None
        self._odd_gaps = 0

    def again(self) -> "FastProgression":
        """Another one of the formula, before its first state; this one has had none either.

        Both share the atoms and the skeleton, unless these follow from domains or changes.
        """
        if not self._is_ready:
            if any(isinstance(node, Since | Forall | Exists) for node in walk(self.formula)):
                return FastProgression(self.formula, self.period_us, self._no_value, deadlines=self._by_deadlines)
            self._activate(_NO_DOMAINS)
            self._is_ready = True
        return copy(self)

    @property
    def verdict(self) -> Verdict:
        return self._state.verdict

    @property
    def is_doubtful(self) -> bool:
        """Whether it is undecided for ever, by an atom without a value."""
        return self._state.left is None

    @property
    def valid_us(self) -> int | None:
        return self._valid_us if self._started else None

    @property
    def way(self) -> Way:
        return "deadlines" if self._by_deadlines else "object"

    @property
    def kept(self) -> int:
        return size(self._state.clauses)

    @property
    def left(self) -> Clauses | None:
        """The obligations that are left, relative to the newest state; None before the first, and if it grows."""
        if not self._started or (self.taken_apart is not None and self.taken_apart.growing):
            return None
        return self._state.clauses if self._clauses is None else moved(self._clauses, -self._valid_us)

    def explain(self) -> tuple[Explanation, ...]:
        """The reasons of its truth or falsehood; nothing while it is undecided, or grows with its domains."""
        decision, apart, progressor = self.decision, self.taken_apart, self._progressor
        if decision is None or apart is None or progressor is None or apart.growing or self.verdict == "undecided":
            return ()
        explainer = Explainer(apart, progressor, self._compiler.again(), *decision)
        return explainer.reasons(truth=self.verdict == "true")

    def progress(
        self,
        valid_us: int,
        values: Mapping[str, Value],
        domains: Domains | None = None,
        events: Collection[str] = (),
    ) -> None:
        """Take one state; `values` by label, missing or `NO_VALUE` where there is none.

        Raises:
            ValueError: if the state is not later than the one before.
            UnknownLabel: if a quantifier ranges over a domain that `domains` lacks.
            TextError: if the formula expands beyond all limits over its domains.
        """
        if valid_us - self._valid_us != self._quick_us:
            self._progress(valid_us, values, domains or _NO_DOMAINS, events)
            return
        reading = self._read(valid_us, values, domains or _NO_DOMAINS, events, _NOTHING)
        state = self._state
        after = state.after.get(reading)
        if after is None:
            after = self._meet(state, reading, Moment(valid_us, values, domains or _NO_DOMAINS, events))
        self._state, self._valid_us = after, valid_us

    def _progress(self, valid_us: int, values: Mapping[str, Value], domains: Domains, events: Collection[str]) -> None:
        """Any state: the first, after another gap than the period, with changes to follow or features to skip."""
        if self._started and valid_us <= self._valid_us:
            raise ValueError(f"states go forward in time: {valid_us} us after {self._valid_us} us")
        if self._no_value == "skip" and lacking(required_labels(self.formula, domains), values):
            return
        if not (self._started or self._is_ready):
            self._activate(domains)
        if not self._state.is_decided:
            changed_us = _NOTHING if self._changes is None else self._changes.after(valid_us, values)
            moment = Moment(valid_us, values, domains, events, changed_us)
            self._state = self._stepped(self._read(*moment), moment)
        self._started, self._valid_us = True, valid_us

    def _activate(self, domains: Domains) -> None:
        compiler = self._compiler = EvaluationCompiler(domains, self._no_value)
        found = self.taken_apart = take_apart(self.formula, domains, compiler)
        self._read = compiler.again().assignment(found.atoms)
        if found.growing or found.is_deep:
            self._progressor = progressor_of(found, domains, self.period_us, self._no_value, compiler)
            self._turn_to_deadlines()
            return
        self._automaton = automaton(found.skeleton, self.period_us)
        self._progressor = self._automaton.progressor
        self._state = self._automaton.beginning
        if not self._by_deadlines and self._no_value != "skip" and self._changes is None:
            self._quick_us = self.period_us

    def _stepped(self, assignment: int, moment: Moment) -> AutomatonState:
        """The state after one more reading, whatever the gap."""
        if not self._by_deadlines:
            assert self._automaton is not None  # noqa: S101 - tells the type checker what activation made sure of
            gap_us = moment.valid_us - self._valid_us
            offset = self._automaton.gap(gap_us) if self._started else 0
            if offset is not None:
                return self._meet(self._state, offset + assignment, moment)
            if self._odd_gaps < LIMIT_GAPS:
                self._odd_gaps += 1
                after = self._automaton.pass_by(self._state, assignment, gap_us)
                return self._decided(self._state, after, assignment, moment)
            self._turn_to_deadlines()
        return self._by_deadline(assignment, moment)

    def _meet(self, state: AutomatonState, reading: int, moment: Moment) -> AutomatonState:
        """A transition that is new, or decides."""
        if state.is_decided:
            return state
        known = self._automaton
        assert known is not None  # noqa: S101 - tells the type checker what activation made sure of
        found = state.after.get(reading)
        if found is not None:
            return found
        if known.is_full and reading not in state.ends:
            self._turn_to_deadlines()
            return self._by_deadline(reading % known.assignments, moment)
        return self._decided(state, known.step(state, reading), reading % known.assignments, moment)

    def _decided(self, state: AutomatonState, found: AutomatonState, assignment: int, moment: Moment) -> AutomatonState:
        """Keep what decided the formula, if that did."""
        if found.is_decided and self._automaton is not None:
            left = moved(state.clauses, self._valid_us) if self._started else None
            self.decision = Decision(left, self._automaton.progressor.assignment(assignment), moment)
        return found

    def _turn_to_deadlines(self) -> None:
        self._by_deadlines, self._quick_us = True, None
        if self._started:
            self._clauses = moved(self._state.clauses, self._valid_us)

    def _by_deadline(self, number: int, moment: Moment) -> AutomatonState:
        assert self._progressor is not None  # noqa: S101 - tells the type checker what activation made sure of
        progressor, left = self._progressor, self._clauses
        assignment = progressor.assignment(number, moment)
        if left is None:
            found = moved(progressor.start(assignment), moment.valid_us)
        else:
            found = progressor.step(left, assignment, moment.valid_us, 0)
        self._clauses = found
        state = AutomatonState(found, -1)
        if state.is_decided:
            self.decision = Decision(left, assignment, moment)
        return state


def _unread(*_: object) -> int:
    raise AssertionError("a formula is read after its activation")


_BEGINNING = AutomatonState(frozenset(), -1)
_BEGINNING.verdict, _BEGINNING.is_decided, _BEGINNING.left = "undecided", False, _BEGINNING
