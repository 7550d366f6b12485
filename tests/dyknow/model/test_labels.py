import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import Label, TextError
from tests.strategies import labels


@pytest.mark.parametrize(
    ("text", "feature", "objects"),
    [
        ("altitude", "altitude", ()), ("pos[uav1]", "pos", ("uav1",)), (" xy_dist [ 0 ,1 ] ", "xy_dist", ("0", "1")),
        ("cars.link[car1]", "cars.link", ("car1",)), ("heli-position[self]", "heli-position", ("self",)),
        ("on_road[from]", "on_road", ("from",)), ("state", "state", ()), ("x[007]", "x", ("007",)),
    ],
)  # fmt: skip
def test_labels_are_read_as_people_write_them(text: str, feature: str, objects: tuple[str, ...]) -> None:
    assert Label.parse(text) == Label(feature, objects)


@given(labels)
def test_printed_labels_read_back(label: Label) -> None:
    assert Label.parse(str(label)) == label
    assert hash(Label.parse(str(label))) == hash(label)


@pytest.mark.parametrize(
    ("text", "column"),
    [
        ("", 1), ("1pos", 1), ("pos[", 5), ("pos[]", 5), ("pos[a", 6), ("pos[a]b", 7), ("pos[a,]", 7), ("pos[a b]", 5), ("po s[a]", 1),
        ("pos[1.5]", 5), ("a.b.c", 1), ("pos-[a]", 1), ("not[a]", 1), ("pos[until]", 5), ("sample", 1), ("pos[a\x00]", 5), ("pos[[a]]", 5),
    ],
)  # fmt: skip
def test_what_is_no_label_is_refused_with_its_column(text: str, column: int) -> None:
    with pytest.raises(TextError) as refused:
        Label.parse(text)
    assert refused.value.column == column


@given(st.text(max_size=40) | st.text("[],.-ab1 \n", max_size=40))
def test_any_text_is_a_label_or_a_text_error(text: str) -> None:
    try:
        label = Label.parse(text)
    except TextError as refused:
        assert refused.column >= 1 <= refused.line
    else:
        assert Label.parse(str(label)) == label


def test_a_long_text_is_refused_before_it_is_read() -> None:
    with pytest.raises(TextError, match="512"):
        Label.parse("a" * 1_000_000)
