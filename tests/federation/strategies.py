"""Hypothesis strategies for what acts say."""

from hypothesis import strategies as st

from dyknow.federation.messages.acts import Act, AgentName, Performative
from dyknow.federation.messages.sexpr import Expr, ExprValue, QuotedText
from dyknow.model.values import NO_VALUE

UNITS = st.sampled_from(["0", "1", "42", "uav1", "cc-4711", "a_b-c"])
AGENTS = st.builds(AgentName, st.sampled_from(["interface", "federation", "alarms"]), UNITS)
WORDS = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,12}", fullmatch=True)
NAMES = st.from_regex(r"[a-z][a-z0-9]{0,5}([-_][a-z0-9]{1,4}){0,2}", fullmatch=True).filter(
    lambda name: name not in {"sequence", "record"}
)
ANY_TEXT = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
COUNTS = st.integers(0, 2**62)
INSTANTS = st.integers(-(6 * 10**16), 6 * 10**16)
STAMPS = st.integers(0, 6 * 10**16)
ATOMS: st.SearchStrategy[ExprValue] = st.one_of(
    st.integers(-(2**63), 2**63 - 1),
    st.floats(allow_nan=False, allow_infinity=False),
    st.booleans(),
    WORDS,
    ANY_TEXT,
    st.sampled_from(
        [
            "true",
            "no_value",
            "12e45678",
            "-0",
            "1_0",
            "+5",
            "inf",
            "nan",
            "sequence",
            "a:",
            "heli-position",
            "pos[uav1]",
        ]
    ),
    ANY_TEXT.map(QuotedText),
    st.just(NO_VALUE),
)


def _wider(inner: st.SearchStrategy[ExprValue]) -> st.SearchStrategy[ExprValue]:
    return st.one_of(
        st.lists(inner, max_size=4).map(tuple),
        st.dictionaries(ANY_TEXT.filter(bool), inner, max_size=3),
        st.builds(Expr, NAMES, st.dictionaries(NAMES, inner, max_size=3)),
    )


VALUES = st.recursive(ATOMS, _wider, max_leaves=12)
EXPRESSIONS = st.builds(Expr, NAMES, st.dictionaries(NAMES, VALUES, max_size=4))
ACTS = st.builds(
    Act,
    st.sampled_from(Performative),
    AGENTS,
    AGENTS | st.just(AgentName("alarms", "all")),
    st.none() | EXPRESSIONS,
    *[st.none() | WORDS] * 4,
    st.none() | STAMPS,
    *[st.none() | WORDS] * 3,
    st.none() | AGENTS,
    COUNTS,
    COUNTS,
    STAMPS,
    st.lists(COUNTS, max_size=3).map(tuple),
    st.binary(max_size=40),
    st.just(b""),
)
