"""Documents of both notations are read by one reader: values with defaults, errors with place, cause and remedy."""

import pytest

from dyknow.documents.documents import json_document, toml_document
from dyknow.documents.places import toml_lines
from dyknow.documents.tables import DocumentTable
from dyknow.model.errors import TextError, TextErrors

TEXT = """# a comment with name = 3
name = "n"
[tables.one]
share = 2.0
"odd key" = 1
[[rows]]
count = 1
[[rows]]
count = 2.5
[rows.deep]
kind = "cat"
"""


def test_toml_notes_all_errors_with_the_lines_of_their_keys() -> None:
    document = toml_document(TEXT, "a.toml", "name")
    root = DocumentTable(document)
    assert root.text("name", None) == "n"
    one = root.tables("tables")["one"]
    assert one.number("share", 0.5, 0.0, 1.0) == 0.5
    rows = root.list("rows")
    assert [each.whole("count", 7, 0, 9) for each in rows] == [1, 7]
    assert rows[1].table("deep").text("kind", "car", ("car", "cart")) == "car"
    assert root.flag("on") is False
    one.end()
    with pytest.raises(TextErrors) as wrong:
        document.end()
    assert [(each.line, each.column, each.message) for each in wrong.value.errors] == [
        (4, 1, "tables.one.share: a number from 0 to 1 is expected, got 2.0"),
        (5, 2, "tables.one.odd key: unknown key. Known: share."),
        (9, 1, "rows[1].count: a whole number from 0 to 9 is expected, got 2.5"),
        (11, 1, "rows[1].deep.kind: one of car, cart is expected, got \"cat\". Did you mean 'cart'?"),
    ]
    assert [each.repair for each in wrong.value.errors][2:] == ["count = 7", 'kind = "car"']


def test_json_raises_the_first_error_at_its_value() -> None:
    root = DocumentTable(json_document('{"a": {"b":\n [true, 3]}}', "a.json", "{}"))
    with pytest.raises(TextError) as wrong:
        root.table("a").number("b", 1.0)
    assert (wrong.value.line, wrong.value.column, wrong.value.repair) == (2, 2, '"b": 1.0')
    with pytest.raises(TextError, match=r"c is missing") as missing:
        root.table("c", '"c": {}')
    assert missing.value.repair == '"c": {}'
    assert root.ignored() == ()


def test_a_path_that_is_not_found_is_at_the_nearest_table_around_it() -> None:
    assert toml_lines(TEXT, [("tables", "one", "nothing"), ("rows", 1, "count"), ("nothing",)]) == [3, 9, 1]


@pytest.mark.parametrize(("text", "place"), [("a = ", (1, 5)), ("a = 1\nb = [", (2, 6)), ("[a\n", (1, 3))])
def test_what_is_no_toml_says_where(text: str, place: tuple[int, int]) -> None:
    with pytest.raises(TextErrors) as wrong:
        toml_document(text, "a.toml", "a = 1")
    assert (wrong.value.line, wrong.value.column, wrong.value.repair) == (*place, "a = 1")
