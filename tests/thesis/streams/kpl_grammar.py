"""The productions of 4.4.3 and the forms of Definitions 4.4.4 to 4.4.15 and 7.8.4 to 7.8.6, one strategy each.

Each draws the words of a sentence and what they mean. Times are milliseconds, as in the thesis.
"""

from typing import Any, TypeAlias

from hypothesis import strategies as st

from dyknow import Label, Policy
from dyknow.kpl.syntax.specification import (
    Declaration,
    FromSource,
    GeneratorDeclaration,
    Refinement,
    SourceDeclaration,
    StateStream,
    StreamDeclaration,
    StreamTerm,
    UnitDeclaration,
)

Words: TypeAlias = list[str]
KEYWORDS = [
    "any",
    "approximation",
    "change",
    "compunit",
    "delay",
    "every",
    "from",
    "max",
    "monotone",
    "most",
    "no",
    "oo",
    "order",
    "recent",
    "sample",
    "source",
    "stream",
    "strict",
    "strmgen",
    "to",
    "update",
    "use",
    "with",
]
"""Definition 4.4.2."""

names = st.sampled_from(["pos", "speed", "car1", "uav-1", "x_2", "SpeedEst", "_s", "before", "state1"])
objects = st.sampled_from(["car1", "car2", "0", "17", "uav-1"])
time_symbols = st.integers(0, 500)


def separated(parts: list[Words]) -> Words:
    return [word for i, part in enumerate(parts) for word in ([",", *part] if i else part)]


@st.composite
def labels(draw: st.DrawFn) -> tuple[Words, Label]:
    """LABEL: FEATURE_SYMBOL ("[" OBJECT_SYMBOL ("," OBJECT_SYMBOL)* "]")?"""
    feature, found = draw(names), draw(st.lists(objects, max_size=3))
    brackets = ["[", *separated([[one] for one in found]), "]"] if found else []
    return [feature, *brackets], Label(feature, tuple(found))


@st.composite
def changes(draw: st.DrawFn) -> tuple[Words, dict[str, Any]]:
    """Definition 4.4.9."""
    form = draw(st.sampled_from(["any update", "any change", "sample every"]))
    if form != "sample every":
        return form.split(), {"change": form}
    period = draw(st.integers(1, 500))
    return [*form.split(), str(period)], {"change": "sample", "sample_us": period * 1_000}


@st.composite
def delays(draw: st.DrawFn) -> tuple[Words, dict[str, Any]]:
    """Definition 4.4.10."""
    limit = draw(st.just("oo") | time_symbols)
    return ["max", "delay", str(limit)], {"max_delay_us": None if limit == "oo" else limit * 1_000}


@st.composite
def durations(draw: st.DrawFn) -> tuple[Words, dict[str, Any]]:
    """Definition 4.4.11."""
    form = draw(st.sampled_from(["from", "to", "from to"]))
    begin, length = draw(time_symbols), draw(st.just("oo") | time_symbols)
    found: dict[str, Any] = {}
    words: Words = []
    if "from" in form:
        words += ["from", str(begin)]
        found["from_us"] = begin * 1_000
    if "to" in form:
        end = length if length == "oo" else begin + length
        words += ["to", str(end)]
        found["to_us"] = None if end == "oo" else end * 1_000
    return words, found


@st.composite
def orders(draw: st.DrawFn) -> tuple[Words, dict[str, Any]]:
    """Definition 4.4.12."""
    order = draw(st.sampled_from(["any", "monotone", "strict"]))
    return [order, "order"], {"order": order}


@st.composite
def approximations(draw: st.DrawFn, complete: bool) -> tuple[Words, dict[str, Any]]:
    """Definition 4.4.13: `use most recent` only where the rest of the policy is complete."""
    if complete and draw(st.booleans()):
        return ["use", "most", "recent"], {"approximation": "most recent"}
    return ["no", "approximation"], {"approximation": "none", "exact": True}


@st.composite
def delays_before(draw: st.DrawFn) -> tuple[Words, dict[str, Any]]:
    """Definition 7.8.5."""
    patience = draw(time_symbols)
    return ["delay", "before", "approximation", str(patience)], {"delay_before_us": patience * 1_000}


@st.composite
def policies(draw: st.DrawFn, of_states: bool = False) -> tuple[Words, Policy]:
    """Definition 4.4.8, each kind of constraint once at most, in any order; 7.8.4 adds one kind."""
    kinds = [changes(), delays(), durations(), orders(), *([delays_before()] if of_states else [])]
    parts = [draw(kind) for kind in kinds if draw(st.booleans())]
    meant = {name: value for _, found in parts for name, value in found.items()}
    complete = None not in (meant.get("sample_us"), meant.get("max_delay_us"), meant.get("from_us"))
    if draw(st.booleans()):
        parts.append(draw(approximations(complete)))
        meant |= parts[-1][1]
    return separated([words for words, _ in draw(st.permutations(parts))]), Policy(**meant)


@st.composite
def terms(draw: st.DrawFn) -> tuple[Words, StreamTerm]:
    """Definition 4.4.14."""
    words, label = draw(labels())
    constraints, policy = draw(policies())
    return [*words, *(["with", *constraints] if constraints else [])], StreamTerm(label, policy)


@st.composite
def source_declarations(draw: st.DrawFn) -> tuple[Words, Declaration]:
    """Definition 4.4.4."""
    sort, name = draw(names), draw(names)
    return ["source", sort, name], SourceDeclaration(sort, name)


@st.composite
def unit_declarations(draw: st.DrawFn) -> tuple[Words, Declaration]:
    """Definition 4.4.5."""
    sort, name, inputs = draw(names), draw(names), draw(st.lists(names, min_size=1, max_size=3))
    words = ["compunit", sort, name, "(", *separated([[one] for one in inputs]), ")"]
    return words, UnitDeclaration(sort, name, tuple(inputs))


@st.composite
def generator_declarations(draw: st.DrawFn) -> tuple[Words, Declaration]:
    """Definitions 4.4.7 and 7.8.6."""
    words, label = draw(labels())
    made = draw(st.sampled_from(["source", "unit", "state"]))
    if made == "source":
        name = draw(names)
        return ["strmgen", *words, "=", name], GeneratorDeclaration(label, FromSource(name))
    parts = draw(st.lists(terms(), min_size=1, max_size=2))
    arguments, inputs = ["(", *separated([part for part, _ in parts]), ")"], tuple(term for _, term in parts)
    if made == "unit":
        name = draw(names)
        return ["strmgen", *words, "=", name, *arguments], GeneratorDeclaration(label, Refinement(name, inputs))
    constraints, policy = draw(policies(of_states=True))
    with_policy = ["with", *constraints] if constraints else []
    return (
        ["strmgen", *words, "=", "state", *arguments, *with_policy],
        GeneratorDeclaration(label, StateStream(inputs, policy)),
    )


@st.composite
def stream_declarations(draw: st.DrawFn) -> tuple[Words, Declaration]:
    """Definition 4.4.15."""
    name, (words, term) = draw(names), draw(terms())
    return ["stream", name, "=", *words], StreamDeclaration(name, term)


declarations = st.one_of(source_declarations(), unit_declarations(), generator_declarations(), stream_declarations())


@st.composite
def specifications(draw: st.DrawFn) -> tuple[str, tuple[Declaration, ...]]:
    """Definition 4.4.3: one declaration or more; words are separated by any blanks."""
    parts = draw(st.lists(declarations, min_size=1, max_size=2))
    blank = draw(st.sampled_from([" ", "\n", "\t ", " # a comment\n"]))
    return blank.join(word for words, _ in parts for word in words), tuple(meant for _, meant in parts)
