"""Random KPL specifications, such as the parser could have made."""

from dataclasses import fields, is_dataclass, replace

from hypothesis import strategies as st

from dyknow.kpl.checking.specifications import check_symbols
from dyknow.kpl.checking.symbols import SymbolTable
from dyknow.kpl.syntax.link_options import LinkOptions
from dyknow.kpl.syntax.specification import (
    ChronicleDeclaration,
    Composite,
    Define,
    Export,
    ForEach,
    FromSource,
    GeneratorDeclaration,
    Import,
    Link,
    Merge,
    MonitorDeclaration,
    Refinement,
    Select,
    SourceDeclaration,
    StateStream,
    StreamDeclaration,
    StreamTerm,
    UnitDeclaration,
    WantDeclaration,
)
from dyknow.model.labels import Label
from dyknow.policies.policy import Policy
from dyknow.reasoning.formulas.tree import Domain, Feature, Variable
from tests.kpl.strategies import formulas, names, numbered

TYPED_ONLY = ["link", "composite", "state", "select", "merge"]


def check_specification(every, known=None, text=""):
    """What an instance that holds nothing finds when it is given these declarations."""
    return check_symbols(SymbolTable(every, known), every, text)


made_of = names.filter(lambda name: name not in TYPED_ONLY)
features = names | st.builds("{}.{}".format, names, names)
labels = st.builds(Label, features, st.lists(names | numbered, max_size=3).map(tuple))
milliseconds = st.integers(0, 10**6).map(lambda found: found * 1_000)
microseconds = st.integers(1, 10**7)
delays = st.none() | milliseconds | microseconds
durations = st.none() | milliseconds
either = st.booleans()
changes, orders = st.sampled_from(["any update", "any change"]), st.sampled_from(["any", "monotone", "strict"])
approximations = {kinds: st.sampled_from(kinds) for kinds in (("none", "linear"), ("none", "linear", "most recent"))}
certainties, deviations = st.none() | st.floats(0, 1), st.none() | st.floats(0, 1e9)
importances = st.sampled_from([1.0, 2.0, 0.125])


@st.composite
def policies(draw):
    """What the thesis' constraints and ours can say together."""
    found = {"max_delay_us": draw(delays)}
    if draw(either):
        found["from_us"] = draw(milliseconds)
        lasts_us = draw(durations)
        found["to_us"] = None if lasts_us is None else found["from_us"] + lasts_us
    elif draw(either):
        found["to_us"] = draw(milliseconds)
    if draw(either):
        found |= {"change": "sample", "sample_us": draw(microseconds)}
        is_bounded = found.get("from_us") is not None and found["max_delay_us"] is not None
        kinds = ("none", "linear", "most recent") if is_bounded else ("none", "linear")
        found["approximation"] = draw(approximations[kinds])
    else:
        found["change"] = draw(changes)
        found["order"] = draw(orders)
    found["min_certainty"] = draw(certainties)
    found["max_deviation"] = draw(deviations)
    found["importance"] = draw(importances)
    return Policy(**found)


terms = st.builds(StreamTerm, labels, st.just(Policy()) | policies())
many_terms = st.lists(terms, min_size=1, max_size=3).map(tuple)
plain = formulas(2)


def with_ends(node):
    """`from` and `to` are the variables of a link condition."""
    if isinstance(node, tuple):
        return tuple(map(with_ends, node))
    if not is_dataclass(node):
        return node
    found = {each.name: with_ends(getattr(node, each.name)) for each in fields(node) if each.name != "place"}
    if isinstance(node, Feature):
        found["objects"] = tuple(Variable(one) if one in ("from", "to") else one for one in found["objects"])
    if isinstance(node, Domain):
        found["base"], *minus = (ends_of_set(one) for one in (found["base"], *found["minus"]))
        found["minus"] = tuple(minus)
    return replace(node, **found)


def ends_of_set(found):
    return (
        tuple(Variable(one) if one in ("from", "to") else one for one in found) if isinstance(found, tuple) else found
    )


linked = plain.map(with_ends)
link_options = st.builds(
    LinkOptions,
    forget=st.integers(10**5, 10**10),
    score=st.sampled_from(["likelihood", "distance"]),
    predict=st.sampled_from(["", "velocity", "individual", "roads"]),
    max_hyps=st.integers(1, 64),
    candidates=st.integers(1, 16),
    branches=st.integers(0, 16),
    exclusive=st.just("") | names,
    errors=st.sampled_from(["independent", "correlated"]),
)
making = (
    st.builds(FromSource, made_of)
    | st.builds(Refinement, made_of, many_terms)
    | st.builds(StateStream, many_terms, st.just(Policy()) | policies())
    | st.builds(Link, labels, names, linked, linked, linked, link_options)
    | st.builds(Composite, labels, linked, linked, st.integers(2, 1000))
    | st.builds(Select, terms, names, terms)
    | st.builds(Merge, terms, names, terms)
)
generators = st.builds(GeneratorDeclaration, labels, making)


parameter_lists = st.lists(names, max_size=2, unique=True)


@st.composite
def definitions(draw):
    parameters = draw(parameter_lists)
    feature = Feature(draw(names), tuple(parameters))
    return Define(feature, draw(formulas(2, frozenset(parameters))))


@st.composite
def wants(draw):
    symbol = draw(names)
    return WantDeclaration(symbol, draw(labels), draw(formulas(2, frozenset({symbol}))))


declarations = (
    st.builds(SourceDeclaration, names, names)
    | st.builds(UnitDeclaration, names, names, st.lists(names, min_size=1, max_size=3).map(tuple))
    | generators
    | st.builds(StreamDeclaration, names, terms)
    | st.builds(ForEach, st.lists(names, min_size=1, max_size=3, unique=True).map(tuple), terms, generators)
    | st.builds(Export, names, terms)
    | st.builds(Import, names, names | numbered, terms)
    | definitions()
    | wants()
    | st.builds(
        MonitorDeclaration,
        names,
        plain,
        st.just(Policy()) | policies(),
        st.sampled_from(["undecided", "skip", "true", "false"]),
        st.integers(1, 9),
    )
    | st.builds(
        ChronicleDeclaration,
        st.sampled_from(["overtake.chr", "a b/c.chr", ""]),
        st.just(Policy()) | policies(),
        st.none(),
        st.none() | st.integers(1, 10**9),
        st.booleans(),
    )
)
specifications = st.lists(declarations, max_size=6).map(tuple)
