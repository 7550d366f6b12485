"""Chronicle files: what is read, how it is printed, and what is told of mistakes."""

import pytest
from hypothesis import given

from dyknow.kpl.diagnostics.languages import language
from dyknow.kpl.syntax.chronicle_reading import ChronicleReader
from dyknow.kpl.syntax.chronicles import print_chronicles
from dyknow.kpl.syntax.grammar import parse_tree
from dyknow.model.errors import TextError
from dyknow.reasoning.chronicles.definition.model import ChronicleFile
from tests.kpl.chronicle_strategies import files


def read_only(text):
    """What a text says, whether or not it makes sense."""
    reader = ChronicleReader(text)
    found = [reader.declaration(tree).declaration for tree in parse_tree(text, "chronicles").children]
    assert reader.errors == []
    return ChronicleFile(tuple(found))


@given(files)
def test_printing_and_reading_back_gives_the_same(file):
    if file.declarations:
        assert read_only(print_chronicles(file)) == file


@pytest.mark.parametrize(
    ("mistake", "sample"),
    [(mistake, sample) for mistake in language("chronicles").mistakes for sample in mistake.samples],
)
def test_each_sample_mistake_teaches_its_message(mistake, sample):
    with pytest.raises(TextError) as told:
        parse_tree(sample, "chronicles")
    assert told.value.message == mistake.message
    assert told.value.repair in {mistake.repaired(line) for line in sample.splitlines()}
