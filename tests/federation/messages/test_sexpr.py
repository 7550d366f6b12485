import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.federation.messages.sexpr import MAX_DEPTH, Expr, ExprValue, QuotedText, print_value
from dyknow.model.errors import TextError
from dyknow.model.values import NO_VALUE
from tests.federation.expressions import parse_expr, parse_value
from tests.federation.strategies import EXPRESSIONS, VALUES


def same(one: ExprValue, other: ExprValue) -> bool:
    """Equal, and of equal types throughout: 1 is not 1.0 is not true. A symbol may come back as a quoted text."""
    if isinstance(one, Expr) and isinstance(other, Expr):
        return one.head == other.head and same(dict(one.arguments), dict(other.arguments))
    if isinstance(one, dict) and isinstance(other, dict):
        return list(one) == list(other) and all(same(one[name], other[name]) for name in one)
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, str) and isinstance(other, str):
        return one == other
    return type(one) is type(other) and repr(one) == repr(other)


@given(VALUES)
def test_a_value_that_is_printed_parses_back_exactly(value: ExprValue) -> None:
    printed = print_value(value)
    assert same(parse_value(printed), value)
    assert print_value(parse_value(printed)) == printed
    assert printed.isprintable(), "nothing that a terminal would obey"


@given(EXPRESSIONS, st.sampled_from([" ", "\n", "\t ", "\r\n   "]))
def test_blanks_and_line_ends_are_free(expr: Expr, blank: str) -> None:
    head, *named = [expr.head, *(f"{name}:{blank}{print_value(value)}" for name, value in expr.arguments.items())]
    assert parse_expr(f"{blank}({blank}{blank.join([head, *named])}{blank}){blank}") == expr


@given(st.text(max_size=60) | st.text('()"\\ab:1.-e \n', max_size=40))
def test_any_text_parses_or_is_refused_with_a_place(text: str) -> None:
    try:
        value = parse_value(text)
    except TextError as wrong:
        assert wrong.line >= 1
        assert wrong.column >= 1
    else:
        assert same(parse_value(print_value(value)), value)


def test_a_quoted_text_stays_a_text_and_a_symbol_a_symbol() -> None:
    assert type(parse_value('"hold"')) is QuotedText
    assert type(parse_value("hold")) is str
    assert print_value(QuotedText("hold")) == '"hold"'
    assert print_value("hold") == "hold"
    assert print_value("two words") == '"two words"'


def test_a_string_that_could_pass_for_something_else_is_quoted() -> None:
    for text in ["0", "1.5", "1e5", "12e45678", "true", "no_value", "", "a:", "(", "-x"]:
        assert print_value(text) == f'"{text}"'
        assert parse_value(print_value(text)) == text


@pytest.mark.parametrize(
    ("text", "line", "column"),
    [
        ("", 1, 1),
        ("(", 1, 2),
        ("(done", 1, 6),
        ("(done))", 1, 7),
        ("(done text:)", 1, 12),
        ("(done text: ", 1, 13),
        ("(done\n  text 5)", 2, 3),
        ("(done a: 1 a: 2)", 1, 12),
        ("(Done)", 1, 2),
        ("(5)", 1, 2),
        ("(record a b)", 1, 9),
        ("(record 5: 1)", 1, 9),
        ("(done a: 99999999999999999999)", 1, 10),
        ("(done a: 1e999)", 1, 10),
        ('(done a: "x)', 1, 10),
        ('(done a: "\\q")', 1, 10),
        ('(done a: "\\ud800")', 1, 10),
        ("(done a: b: )", 1, 10),
        ("(done a: *)", 1, 10),
        ("()", 1, 2),
    ],
)
def test_a_mistake_is_shown_where_it_is(text: str, line: int, column: int) -> None:
    with pytest.raises(TextError) as wrong:
        parse_expr(text)
    assert (wrong.value.line, wrong.value.column) == (line, column)


def test_nesting_is_bounded_in_both_directions() -> None:
    value: ExprValue = ()
    for _ in range(MAX_DEPTH - 1):
        value = (value,)
    assert parse_value(print_value(value)) == value
    with pytest.raises(ValueError, match="nested"):
        print_value((value,))
    with pytest.raises(TextError, match="nested"):
        parse_value("(sequence " * 5000)
    with pytest.raises(TextError, match="characters"):
        parse_value("a" * 70_000)


@pytest.mark.parametrize(
    "value",
    [
        float("nan"),
        float("inf"),
        2**63,
        Expr("sequence"),
        Expr("Done"),
        Expr("done", {"A": 1}),
        Expr("done", {"a": (float("nan"),)}),
    ],
)
def test_what_has_no_text_is_not_printed(value: ExprValue) -> None:
    with pytest.raises(ValueError, match=r"64 bits|cannot be encoded|not a name"):
        print_value(value)


def test_no_value_and_records_are_said_as_the_language_has_them() -> None:
    value = Expr("reading", {"value": {"latitude_deg": 58.5, "xy_dist[0, 1]": 3}, "variance": NO_VALUE})
    text = '(reading value: (record latitude_deg: 58.5 "xy_dist[0, 1]": 3) variance: no_value)'
    assert print_value(value) == text
    assert parse_value(text) == value
