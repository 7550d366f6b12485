"""Progression of formulas through states (thesis 7.5.2, Def. 7.5.3), plain.

After each state the verdict is `true`, `false` or `undecided` (F4). Intervals select states by their time, and states
exist only where samples made them (F1); an operator is decided at the state whose time reaches its bound, with a known
sample period already at the last state that can lie inside (F3).

A growing quantifier (F6) takes its members from the domain as given with each state. Over a body about one state it
ranges over the members of that state. Over a temporal body members that appear while it is undecided are added,
evaluated from the state where they appear, and members that leave are dropped; without any member it waits.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from dyknow.model.errors import TextError
from dyknow.model.sample import Value
from dyknow.reasoning.formulas.evaluation import TRUTHS, EvaluationCompiler, Moment, NoValuePolicy, Test
from dyknow.reasoning.formulas.tree import (
    LIMIT_TEMPORAL,
    Always,
    And,
    Bound,
    Domain,
    Domains,
    Eventually,
    Exists,
    Forall,
    Formula,
    Implies,
    Not,
    Or,
    Until,
    deepest_temporal,
    domain_members,
    instantiate,
    is_temporal,
    required_labels,
    too_deep,
)
from dyknow.reasoning.progression.changes import Changes, lacking
from tests.reasoning.residuals import (
    Operator,
    Residual,
    UntilWindow,
    Window,
    conjoin,
    disjoin,
    is_pending,
    negate,
    obligations,
)

_FEW_MEMBERS = 16

Verdict: TypeAlias = Literal["true", "false", "undecided"]


def verdict_of(residual: Residual) -> Verdict:
    if residual is True:
        return "true"
    return "false" if residual is False else "undecided"


class Progression:
    """One formula on its way through states.

    Args:
        formula: checked; times are microseconds.
        period_us: the sample period of the states if it is known: then no state lies closer to another.
        no_value: what an atom over `no_value` counts as; `skip` leaves out states in which a feature has no value.
    """

    def __init__(self, formula: Formula, period_us: int | None = None, no_value: NoValuePolicy = "undecided") -> None:
        self.formula = formula
        self._period_us, self._no_value = period_us, no_value
        self._residual: Residual = None
        self._valid_us: int | None = None
        self._started = False
        self._changes = Changes(formula)

    way: Final = "plain"

    @property
    def verdict(self) -> Verdict:
        return verdict_of(self._residual)

    @property
    def is_doubtful(self) -> bool:
        """Whether it is undecided for ever, by an atom without a value."""
        return self._started and self._residual is None

    @property
    def kept(self) -> int:
        """How many obligations are left."""
        return obligations(self._residual)

    def explain(self) -> tuple[()]:
        """Nothing: the ways of the engine explain."""
        return ()

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
        if self._valid_us is not None and valid_us <= self._valid_us:
            raise ValueError(f"states go forward in time: {valid_us} us after {self._valid_us} us")
        domains = domains or {}
        if self._no_value == "skip" and lacking(required_labels(self.formula, domains), values):
            return
        self._valid_us = valid_us
        moment = Moment(valid_us, values, domains, events, self._changes.after(valid_us, values))
        if not self._started:
            self._residual = compile_operator(self.formula, domains, self._period_us, self._no_value).start(moment)
            self._started = True
        elif not (self._residual is None or self._residual is True or self._residual is False):
            self._residual = self._residual.step(moment)


def compile_operator(
    formula: Formula, domains: Domains, period_us: int | None = None, no_value: NoValuePolicy = "undecided"
) -> Operator:
    """The formula as something that starts at any state; one without temporal operators becomes an `Atom`.

    Raises:
        TextError: if it expands beyond all limits, or nests more than `LIMIT_TEMPORAL` temporal operators.
        UnknownLabel: if a quantifier ranges over a domain that `domains` lacks.
    """
    depth, place = deepest_temporal(formula)
    if depth > LIMIT_TEMPORAL:
        raise TextError.at(place, too_deep(depth), repair="say it with fewer of them")
    return _Builder(EvaluationCompiler(domains, no_value), period_us).build(formula)


class Atom:
    """A formula about one state: nothing is left of it after that."""

    __slots__ = ("start",)

    def __init__(self, test: Test) -> None:
        self.start: Callable[[Moment], Residual] = lambda moment: TRUTHS[test(*moment)]


@dataclass(frozen=True, slots=True, eq=False)
class _Not:
    operand: Operator

    def start(self, moment: Moment) -> Residual:
        return negate(self.operand.start(moment))


@dataclass(frozen=True, slots=True, eq=False)
class _And:
    parts: tuple[Operator, ...]

    def start(self, moment: Moment) -> Residual:
        return conjoin([part.start(moment) for part in self.parts])


@dataclass(frozen=True, slots=True, eq=False)
class _Or:
    parts: tuple[Operator, ...]

    def start(self, moment: Moment) -> Residual:
        return disjoin([part.start(moment) for part in self.parts])


@dataclass(frozen=True, slots=True, eq=False)
class _Interval:
    """[lo, hi] from the state where an operator starts."""

    lo_us: int
    hi_us: int | None
    period_us: int | None

    def closes(self, to_us: int | None, valid_us: int) -> bool:
        return to_us is not None and (valid_us + self.period_us > to_us if self.period_us else valid_us >= to_us)

    def absolute(self, start_us: int) -> tuple[int | None, int | None]:
        return start_us + self.lo_us if self.lo_us else None, None if self.hi_us is None else start_us + self.hi_us


@dataclass(frozen=True, slots=True, eq=False)
class _Windowed(_Interval):
    universal: bool
    operand: Operator

    def start(self, moment: Moment) -> Residual:
        return Window(self, *self.absolute(moment.valid_us)).step(moment)


@dataclass(frozen=True, slots=True, eq=False)
class _Until(_Interval):
    left: Operator
    right: Operator

    def start(self, moment: Moment) -> Residual:
        return UntilWindow(self, *self.absolute(moment.valid_us)).step(moment)


@dataclass(frozen=True, slots=True, eq=False)
class _Growing:
    """A growing quantifier over a temporal body; `instances` holds one operator per member met, and its nodes."""

    builder: "_Builder"
    universal: bool
    variable: str
    domain: Domain
    body: Formula
    instances: dict[str, tuple[Operator, int]]

    def instance(self, member: str) -> Operator:
        if member not in self.instances:
            self.instances[member] = self.builder.weighed(instantiate(self.body, self.variable, member))
        return self.instances[member][0]

    def members(self, moment: Moment) -> tuple[str, ...]:
        """The members that count now; when most of those that were met do not, they are forgotten."""
        members = domain_members(self.domain, moment.domains)
        if len(self.instances) > 2 * len(members) + _FEW_MEMBERS:
            for gone in self.instances.keys() - set(members):
                self.builder.forget(self.instances.pop(gone)[1])
        return members

    def start(self, moment: Moment) -> Residual:
        return _Grown(self, ()).step(moment)


@dataclass(frozen=True, slots=True)
class _Grown:
    """A growing quantifier under way: the remainder of each member it has met. Uncertainty leaves with its member."""

    operator: _Growing
    residuals: tuple[tuple[str, Residual], ...]

    @property
    def parts(self) -> tuple[Residual, ...]:
        return tuple(left for _, left in self.residuals)

    def step(self, moment: Moment) -> Residual:
        before, after = dict(self.residuals), {}
        for member in self.operator.members(moment):
            if member not in before:
                after[member] = self.operator.instance(member).start(moment)
            else:
                left = before[member]
                after[member] = left if left is None or left is True or left is False else left.step(moment)
        whole = (conjoin if self.operator.universal else disjoin)(after.values())
        dominated = whole is (not self.operator.universal)
        if dominated or (after and whole is not None and not any(is_pending(one) for one in after.values())):
            return whole
        return _Grown(self.operator, tuple(after.items()))


class _Builder:
    """Compiles inside out; whatever stays without temporal operators becomes one closure."""

    def __init__(self, compiler: EvaluationCompiler, period_us: int | None) -> None:
        self._compiler, self._period_us = compiler, period_us

    def weighed(self, formula: Formula) -> tuple[Operator, int]:
        """What is built of a formula, and how many nodes that took."""
        before = self._compiler.nodes_left
        operator = self.build(formula)
        return operator, before - self._compiler.nodes_left

    def forget(self, nodes: int) -> None:
        """Release a remainder of this number of nodes."""
        self._compiler.nodes_left += nodes

    def build(self, formula: Formula) -> Operator:
        if not is_temporal(formula):
            return Atom(self._compiler.test(formula))
        self._compiler.count()
        match formula:
            case Not(operand):
                return _Not(self.build(operand))
            case And(parts):
                return _And(self._each(parts))
            case Or(parts):
                return _Or(self._each(parts))
            case Implies(left, right):
                return _Or((_Not(self.build(left)), self.build(right)))
            case Until(left, right, lo_us, hi_us):
                return _Until(*self._interval(lo_us, hi_us), self.build(left), self.build(right))
            case Always(operand, lo_us, hi_us) | Eventually(operand, lo_us, hi_us):
                universal = isinstance(formula, Always)
                return _Windowed(*self._interval(lo_us, hi_us), universal, self.build(operand))
            case Forall(variable, domain, body, growing) | Exists(variable, domain, body, growing):
                universal = isinstance(formula, Forall)
                if growing:
                    return _Growing(self, universal, variable, domain, body, {})
                members = domain_members(domain, self._compiler.domains)
                instances = tuple([self.build(instantiate(body, variable, one)) for one in members])
                return _And(instances) if universal else _Or(instances)
        raise TextError.at(
            formula.place,
            "a temporal operator stands inside a comparison or a calculation",
            repair="compare values, and put the temporal operator around the comparison",
        )

    def _each(self, parts: tuple[Formula, ...]) -> tuple[Operator, ...]:
        return tuple([self.build(part) for part in parts])

    def _interval(self, lo_us: Bound, hi_us: Bound | None) -> tuple[int, int | None, int | None]:
        for bound in (lo_us, hi_us):
            if bound is not None and not isinstance(bound, int):
                raise TextError.at(bound.place, f"{bound.label} is no time")
        assert isinstance(lo_us, int)
        return lo_us, hi_us if isinstance(hi_us, int) else None, self._period_us


class Restarted:
    """A formula that is started again at each state, like `dyknow.reasoning.progression.restarting`."""

    def __init__(self, formula: Formula, period_us: int | None) -> None:
        self.start = compile_operator(formula, {}, period_us).start

    def read(self, moment: Moment) -> Moment:
        return moment

    def step(self, residual: Residual, moment: Moment) -> Residual:
        return residual.step(moment)

    def conjoin(self, residuals: list[Residual]) -> Residual:
        return conjoin(residuals)

    def explain(self, *_: object) -> tuple[()]:
        return ()
