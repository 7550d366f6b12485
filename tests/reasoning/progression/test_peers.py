"""Where the languages overlap, two other monitors say what ours say: rtamt, and reelay, which looks back only.

Both step through samples and know no time of their own; so one step is one period here. rtamt answers late by the
horizon of a formula; reelay is shown the trace backwards, where until is since, or a formula moved into the past. An
interval [0:0] means one without end to reelay, so it is left out for it.
"""

import os
from typing import NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow.kpl import read_formula
from tests.reasoning.meaning import State
from tests.reasoning.ways import WAYS

reelay = pytest.importorskip("reelay", reason="reelay has no wheel for this machine")
rtamt = pytest.importorskip("rtamt", reason="rtamt's parser does not run on this Python")

FULL = bool(os.environ.get("DYKNOW_FULL"))
SOME = settings(max_examples=1_000 if FULL else 25)
STEP_MS = 100
ATOMS = {"p": ("p", "{p: true}", "(p >= 0.5)"), "q": ("q", "{q: true}", "(q >= 0.5)"),
         "high": ("x >= 2", "{x >= 2}", "(x >= 1.5)")}  # fmt: skip
PAST = {"always": "historically", "eventually": "once", "until": "since"}


class Op(NamedTuple):
    """An operator with its interval in steps; `hi` None is no end."""

    name: str
    parts: tuple = ()
    lo: int = 0
    hi: int | None = None

    @property
    def horizon(self):
        """How many steps later a bounded formula is decided."""
        return (self.hi or 0) + max((part.horizon for part in self.parts), default=0)

    def ours(self):
        parts = [f"({part.ours()})" for part in self.parts]
        if self.name in PAST:
            end = "oo" if self.hi is None else f"{self.hi * STEP_MS}ms"
            return _placed(self.name, parts, f"[{self.lo * STEP_MS}ms, {end}]")
        return _placed(self.name, parts) if parts else ATOMS[self.name][0]

    def rtamt(self):
        parts = [f"({part.rtamt()})" for part in self.parts]
        if self.name in PAST:
            return _placed(self.name, parts, f"[{self.lo}:{self.hi}]")
        return _placed(self.name, parts) if parts else ATOMS[self.name][2]

    def backwards(self):
        """For reelay, over the trace from its end: what was to come has been."""
        parts = [f"({part.backwards()})" for part in self.parts]
        if self.name in PAST and self.hi == 0:
            return parts[-1]
        if self.name in PAST:
            return _placed(PAST[self.name], parts, f"[{self.lo}:{'' if self.hi is None else self.hi}]")
        return _placed(self.name, parts) if parts else ATOMS[self.name][1]

    def shifted(self, back):
        """For reelay: whether the formula held `back` steps ago, at least its horizon."""
        if self.name == "until":
            return f"({' or '.join(way.shifted(back) for way in self._ways())})"
        if self.name in PAST:
            inside, width = self.parts[0].shifted(back - self.hi), self.hi - self.lo
            return f"({PAST[self.name]}[0:{width}]({inside}))" if width else inside
        if not self.parts:
            return f"(once[{back}:{back}]{ATOMS[self.name][1]})" if back else ATOMS[self.name][1]
        return f"({_placed(self.name, [part.shifted(back) for part in self.parts])})"

    def _ways(self):
        """until as always up to a step, and then its right side."""
        left, right = self.parts
        for at in range(self.lo, self.hi + 1):
            reached = Op("eventually", (right,), at, at)
            yield Op("and", (Op("always", (left,), 0, at - 1), reached)) if at else reached


def _placed(name, parts, interval=""):
    return f"{name}{interval} {parts[0]}" if len(parts) == 1 else f"{parts[0]} {name}{interval} {parts[1]}"


def formulas(bounded, most=4):
    @st.composite
    def intervals(draw):
        lo = draw(st.integers(0, 2))
        return {"lo": lo, "hi": draw(st.integers(lo, lo + 3) if bounded else st.none() | st.integers(lo, lo + 3))}

    def inside(parts):
        return st.one_of(
            st.builds(lambda one: Op("not", (one,)), parts),
            st.builds(lambda name, *both: Op(name, both), st.sampled_from(["and", "or"]), parts, parts),
            st.builds(lambda name, one, at: Op(name, (one,), **at), st.sampled_from(["always", "eventually"]), parts, intervals()),
            st.builds(lambda left, right, at: Op("until", (left, right), **at), parts, parts, intervals()),
        )  # fmt: skip

    return st.recursive(st.sampled_from(sorted(ATOMS)).map(Op), inside, max_leaves=most)


SAMPLES = st.lists(
    st.fixed_dictionaries({"p": st.booleans(), "q": st.booleans(), "x": st.integers(0, 3)}), min_size=1, max_size=14
)


def verdicts(way, formula, samples):
    """Ours, after every sample, of a formula activated at the first."""
    states = [State(at * STEP_MS * 1_000, sample) for at, sample in enumerate(samples)]
    return WAYS[way](read_formula(formula.ours()), states, STEP_MS * 1_000)


@given(formulas(bounded=False), SAMPLES)
@SOME
def test_reelay_over_the_trace_backwards_contradicts_no_verdict(formula, samples):
    monitor = reelay.discrete_timed_monitor(pattern=formula.backwards(), condense=False)
    held = [monitor.update(sample)["value"] for sample in reversed(samples)][::-1]
    for way in WAYS:
        for start, one in enumerate(held):
            assert verdicts(way, formula, samples[start:])[-1] in {"undecided", str(one).lower()}


@given(formulas(bounded=True, most=3), SAMPLES)
@SOME
def test_reelay_looking_back_by_the_horizon_says_what_we_said_by_then(formula, samples):
    monitor = reelay.discrete_timed_monitor(pattern=formula.shifted(formula.horizon), condense=False)
    late = [monitor.update(sample)["value"] for sample in samples]
    for way in WAYS:
        for at in range(formula.horizon, len(samples)):
            held = verdicts(way, formula, samples[at - formula.horizon : at + 1])[-1]
            assert held == str(late[at]).lower()


def names(formula):
    """Of all operators and atoms, as often as they stand in it."""
    return [formula.name, *(name for part in formula.parts for name in names(part))]


def is_answered_at_the_horizon(formula):
    """Online, rtamt 0.4.10 answers later where there is an until, one atom stands in two places, or horizons differ."""
    found = names(formula)
    return "until" not in found and all(found.count(atom) <= 1 for atom in ATOMS) and is_even(formula)


def is_even(formula):
    """Whether what an operator joins is decided at one time."""
    horizons = {part.horizon for part in formula.parts}
    return len(horizons) <= 1 and all(map(is_even, formula.parts))


def specified(formula):
    monitor = rtamt.StlDiscreteTimeSpecification()
    for name in ("p", "q", "x", "out"):
        monitor.declare_var(name, "float")
    monitor.spec = f"out = {formula.rtamt()}"
    monitor.parse()
    return monitor


@given(formulas(bounded=True, most=3).filter(is_answered_at_the_horizon), SAMPLES)
@SOME
def test_rtamt_says_after_the_horizon_what_we_said_by_then(formula, samples):
    monitor = specified(formula)
    monitor.pastify()
    margins = [
        monitor.update(at, [(name, float(value)) for name, value in sample.items()])
        for at, sample in enumerate(samples)
    ]
    for way in WAYS:
        for at in range(formula.horizon, len(samples)):
            held = verdicts(way, formula, samples[at - formula.horizon : at + 1])[-1]
            assert held == str(margins[at] > 0).lower()


@given(formulas(bounded=True), SAMPLES.filter(lambda samples: len(samples) > 1))
@SOME
def test_rtamt_over_the_whole_trace_contradicts_no_verdict(formula, samples):
    columns = {name: [float(sample[name]) for sample in samples] for name in ("p", "q", "x")}
    margins = specified(formula).evaluate({"time": list(range(len(samples))), **columns})
    for way in WAYS:
        for start, (_, margin) in enumerate(margins):
            assert verdicts(way, formula, samples[start:])[-1] in {"undecided", str(margin > 0).lower()}
