"""Random formulas over p, q, r and x, and random states for them."""

from hypothesis import strategies as st

from dyknow.reasoning.formulas.tree import (
    Always,
    And,
    Compare,
    Const,
    Eventually,
    Feature,
    Implies,
    Not,
    Or,
    Until,
    Variable,
)

UNIT_US = 100_000
OPERATORS = ("<", "<=", "=", "!=", ">=", ">")

propositions = st.sampled_from([Feature("p"), Feature("q"), Feature("r")])
comparisons = st.builds(Compare, st.sampled_from(OPERATORS), st.just(Feature("x")), st.integers(0, 3).map(Const))
atoms = st.one_of(propositions, propositions, comparisons, st.booleans().map(Const))


@st.composite
def intervals(draw, bounded=False):
    lo = draw(st.integers(0, 3))
    hi = draw(st.integers(lo, lo + 4) if bounded else st.none() | st.integers(lo, lo + 4))
    return lo * UNIT_US, None if hi is None else hi * UNIT_US


def connectives(inside):
    pairs = st.lists(inside, min_size=2, max_size=3).map(tuple)
    return st.one_of(inside.map(Not), pairs.map(And), pairs.map(Or), st.builds(Implies, inside, inside))


def temporals(inside):
    return st.one_of(
        st.builds(lambda one, at: Always(one, *at), inside, intervals()),
        st.builds(lambda one, at: Eventually(one, *at), inside, intervals()),
        st.builds(lambda a, b, at: Until(a, b, *at), inside, inside, intervals()),
    )


state_formulas = st.recursive(atoms, connectives, max_leaves=6)
formulas = st.recursive(atoms, lambda inside: connectives(inside) | temporals(inside), max_leaves=6)

variable_atoms = st.builds(Feature, st.sampled_from(["s", "t"]), st.sampled_from([(Variable("v"),), ("a",)]))
bodies = st.recursive(
    variable_atoms | propositions, lambda inside: connectives(inside) | temporals(inside), max_leaves=4
)
LABELS = ("p", "q", "r", "s[a]", "s[b]", "s[c]", "t[a]", "t[b]", "t[c]")


@st.composite
def traces(draw, max_size=9, gaps=False, missing=False):
    """[(time, values), ...]: at every period, or with gaps; complete, or with values missing."""
    steps = draw(st.lists(st.integers(1, 3) if gaps else st.just(1), min_size=1, max_size=max_size))
    boolean = st.booleans() | st.none() if missing else st.booleans()
    number = st.integers(0, 3) | st.none() if missing else st.integers(0, 3)
    states, at_us = [], draw(st.integers(0, 5)) * UNIT_US
    for step in steps:
        values = {label: draw(boolean) for label in LABELS} | {"x": draw(number)}
        states.append((at_us, {label: value for label, value in values.items() if value is not None}))
        at_us += step * UNIT_US
    return states
