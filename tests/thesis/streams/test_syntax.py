"""Section 4.4 and the forms of 7.8: every sentence of the grammar means what its definition says, and which fit together."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import Label, Policy, TextError
from dyknow.kpl import Known, parse_specification
from dyknow.kpl.syntax.specification import (
    Declaration,
    FromSource,
    GeneratorDeclaration,
    Refinement,
    SourceDeclaration,
    StreamDeclaration,
    StreamTerm,
    UnitDeclaration,
)
from dyknow.model.errors import TextErrors
from dyknow.model.labels import RESERVED
from tests.kpl.specifications import check_specification
from tests.strategies import definition
from tests.thesis.streams.kpl_grammar import KEYWORDS, labels, policies, specifications


@definition
@given(specifications())
def test_definitions_4_4_3_to_4_4_15_and_7_8_6_a_sentence_of_the_grammar_means_what_is_declared(
    sentence: tuple[str, tuple[Declaration, ...]],
) -> None:
    text, meant = sentence
    assert parse_specification(text) == meant


@definition
@given(labels())
def test_definition_4_4_6_label_terms(term: tuple[list[str], Label]) -> None:
    words, label = term
    assert Label.parse(" ".join(words)) == Label.parse("".join(words)) == label


@definition
@given(policies(of_states=True))
def test_definitions_4_4_8_to_4_4_13_7_8_4_and_7_8_5_policies_and_their_defaults(
    specified: tuple[list[str], Policy],
) -> None:
    words, policy = specified
    assert Policy.parse(" ".join(words)) == policy


@pytest.mark.parametrize("word", KEYWORDS)
def test_definition_4_4_2_a_keyword_is_no_symbol(word: str) -> None:
    assert word in RESERVED
    with pytest.raises(TextError):
        Label.parse(word)
    for text in (f"source {word} s", f"source pos {word}", f"strmgen {word} = s", f"stream {word} = pos"):
        with pytest.raises((TextError, TextErrors)):
            parse_specification(text)


SORTS, UNITS, FEATURES = st.sampled_from("vw"), st.sampled_from("cd"), [Label("f"), Label("g", ("o1",)), Label("h")]
own_terms = st.sampled_from(FEATURES).map(StreamTerm)
declared = st.lists(
    st.one_of(
        st.builds(SourceDeclaration, SORTS, st.sampled_from("st")),
        st.builds(UnitDeclaration, SORTS, UNITS, st.lists(SORTS, min_size=1, max_size=2).map(tuple)),
        st.builds(GeneratorDeclaration, st.sampled_from(FEATURES), st.builds(FromSource, st.sampled_from("st"))),
        st.builds(
            GeneratorDeclaration,
            st.sampled_from(FEATURES),
            st.builds(Refinement, UNITS, st.lists(own_terms, min_size=1, max_size=2).map(tuple)),
        ),
        st.builds(StreamDeclaration, st.sampled_from("nm"), own_terms),
    ),
    max_size=7,
).map(tuple)


def is_specification(found: tuple[Declaration, ...]) -> bool:
    """Definitions 4.4.1, 4.4.3, 4.4.7 and 4.4.15: symbols are unique and declared, arities and sorts are kept.

    A label denotes what its process makes (4.5.7, 4.5.8), so that no process can be its own input.
    """
    sources = [each for each in found if isinstance(each, SourceDeclaration)]
    units = [each for each in found if isinstance(each, UnitDeclaration)]
    generators = [each for each in found if isinstance(each, GeneratorDeclaration)]
    streams = [each for each in found if isinstance(each, StreamDeclaration)]
    for symbols in (
        [e.name for e in sources],
        [e.name for e in units],
        [e.name for e in streams],
        [e.label for e in generators],
    ):
        if len(symbols) != len(set(symbols)):
            return False
    sort_of: dict[Any, str] = {}
    left = list(generators)
    while left:
        ready = [each for each in left if all(term.label in sort_of for term in inputs_of(each))]
        if not ready:
            return False  # an input that nothing makes, or a cycle
        for each in ready:
            left.remove(each)
            maker = next((e for e in (*sources, *units) if is_made_by(each, e, sort_of)), None)
            if maker is None:
                return False
            sort_of[each.label] = maker.sort
    return all(each.term.label in sort_of for each in streams)


def inputs_of(declaration: GeneratorDeclaration) -> tuple[StreamTerm, ...]:
    return declaration.made.inputs if isinstance(declaration.made, Refinement) else ()


def is_made_by(declaration: GeneratorDeclaration, maker: Declaration, sort_of: dict[Any, str]) -> bool:
    made = declaration.made
    if isinstance(made, FromSource):
        return isinstance(maker, SourceDeclaration) and maker.name == made.source
    if not isinstance(made, Refinement) or not isinstance(maker, UnitDeclaration) or maker.name != made.unit:
        return False
    return maker.inputs == tuple(sort_of[term.label] for term in made.inputs)


@definition
@given(declared)
def test_definitions_4_4_1_4_4_7_and_4_4_15_what_is_declared_fits_together(found: tuple[Declaration, ...]) -> None:
    assert (not check_specification(found, Known()).errors) == is_specification(found)
