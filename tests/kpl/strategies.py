"""Random formulas of the whole language, such as the parser could have made.

Strategies are made once: hypothesis looks at each anew that a draw makes, which takes longer than to draw from it.
"""

from functools import cache

from hypothesis import strategies as st

from dyknow.reasoning.formulas.tree import (
    Abs,
    Always,
    And,
    Arithmetic,
    Compare,
    Const,
    Domain,
    Duration,
    Eventually,
    Exists,
    Feature,
    Forall,
    Implies,
    Negate,
    Not,
    Now,
    Occurred,
    Or,
    Since,
    Until,
    Variable,
)

STATEMENT_WORDS = ["link", "state", "select", "for", "in", "growing", "since", "occurred", "value", "after", "min"]
NAMES = ["p", "q", "speed", "Z_9", "_x", "executing-detach-box", "x-1", "a-b_c", "u", "v", *STATEMENT_WORDS]
names = st.sampled_from(NAMES)
numbered = st.sampled_from(["0", "7", "42"])
times = st.integers(0, 10**9) | st.sampled_from([0, 1_000, 5_000_000, 60_000_000, 3_600_000_000])
fifths = st.integers(0, 4)


@st.composite
def intervals(draw):
    lo, hi = sorted((draw(times), draw(times)))
    return [(0, None), (lo, None), (lo, hi), (Feature("T"), hi), (lo, Feature("T"))][draw(fifths)]


@cache
def objects(bound):
    """Names that no variable around them hides, and the variables themselves."""
    free = (names | numbered | st.sampled_from(["from", "to"])).filter(lambda name: name not in bound)
    return free | st.sampled_from(sorted(bound)).map(Variable) if bound else free


@cache
def features(bound):
    some = st.lists(objects(bound), min_size=1, max_size=3).map(tuple)
    return (
        st.builds(Feature, names.filter(lambda name: name not in bound))
        | st.builds(Feature, names, some)
        | st.builds(Feature, names, some, names)
        | st.builds(Feature, names, st.just(()), names)
    )


@cache
def domains(bound):
    members = st.lists(objects(bound), max_size=3).map(tuple)
    one = names | members
    return st.builds(Domain, one, st.lists(one, max_size=2).map(tuple))


@cache
def terms(bound, depth):
    simple = st.one_of(
        (st.integers(0, 10**6) | st.floats(0, 1e12, allow_nan=False)).map(Const),
        st.integers(-50, -1).map(Const),
        times.map(Duration),
        features(bound),
        st.builds(Since, features(bound)),
        st.just(Now()),
        st.sampled_from(["", "AUTO", "# no comment", "é 1s"]).map(lambda text: Const(text, quoted=True)),
        *([st.sampled_from(sorted(bound)).map(Variable)] if bound else []),
    )
    if depth == 0:
        return simple
    inside = terms(bound, depth - 1)
    not_number = inside.filter(lambda one: not (isinstance(one, Const) and not isinstance(one.value, str)))
    return st.one_of(
        simple,
        st.builds(Arithmetic, st.sampled_from("+-*/"), inside, inside),
        st.builds(Negate, not_number),
        st.builds(Abs, inside),
    )


@cache
def formulas(depth=3, bound=frozenset()):
    atoms = st.one_of(
        features(bound),
        st.booleans().map(Const),
        st.builds(Occurred, features(bound)),
        st.builds(Compare, st.sampled_from(["<", "<=", "=", "!=", ">=", ">"]), terms(bound, 2), terms(bound, 1)),
    )
    return atoms if depth == 0 else atoms | st.deferred(lambda: _composed(depth - 1, bound))


@cache
def _composed(depth, bound):
    inside = formulas(depth, bound)
    several = st.lists(inside, min_size=2, max_size=3).map(tuple)
    return st.one_of(
        inside.map(Not),
        several.map(And),
        several.map(Or),
        st.builds(Implies, inside, inside),
        st.builds(lambda one, at: Always(one, *at), inside, intervals()),
        st.builds(lambda one, at: Eventually(one, *at), inside, intervals()),
        st.builds(lambda a, b, at: Until(a, b, *at), inside, inside, intervals()),
        st.builds(Compare, st.sampled_from(["=", "!="]), inside, inside),
        names.flatmap(
            lambda name: st.builds(
                lambda make, domain, body, growing: make(name, domain, body, growing),
                st.sampled_from([Forall, Exists]),
                domains(bound),
                formulas(depth, bound | {name}),
                st.booleans(),
            )
        ),
    )
