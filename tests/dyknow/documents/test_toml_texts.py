"""TOML from anyone: long numbers and keys are refused where they stand, and digits in texts and comments are not."""

import tomllib
from itertools import product

import pytest

from dyknow.documents.toml_texts import MOST_DIGITS, tables_of

DIGITS = "7" * MOST_DIGITS
NUMBERS = [
    DIGITS,
    f"-{DIGITS}",
    f"0x{DIGITS}",
    f"0b{'1' * MOST_DIGITS}",
    f"1.{DIGITS}",
    f"1e{DIGITS}",
    "1_" * MOST_DIGITS,
]


BEFORE = [
    "",
    "b = \"it's\" # don't\n",
    "b = '\"'\nc = '''\n''''' \n",
    'b = """\\""" """\n',
    'b = """x"""" \n',
    "b = '''x''''\n",
]
"""TOML that is right, with quotes and signs of comments where they mean nothing."""


@pytest.mark.parametrize(
    "number", NUMBERS, ids=["whole", "signed", "hexadecimal", "binary", "fraction", "exponent", "_"]
)
@pytest.mark.parametrize("before", BEFORE)
def test_a_number_of_thousands_of_digits_is_refused_at_its_line_and_column(number: str, before: str) -> None:
    text = f"{before}[a]\nx = [1, {number}]\n"
    tomllib.loads(before)
    line = before.count("\n") + 2
    columns = range(9, 12)  # after a sign, or a point
    with pytest.raises(tomllib.TOMLDecodeError, match=rf"a number of {MOST_DIGITS} digits or more") as refused:
        tables_of(text)
    assert any(f"(at line {line}, column {column})" in str(refused.value) for column in columns)


@pytest.mark.parametrize(
    "text", [f'"{DIGITS}"', f"'{DIGITS}'", f'"""\n{DIGITS}\n"""', f"'''\n{DIGITS}\n'''", f"1 # {DIGITS}"]
)
def test_digits_of_a_text_or_of_a_comment_are_no_number(text: str) -> None:
    assert tables_of(f"a = {text}") == tomllib.loads(f"a = {text}")


@pytest.mark.parametrize(("digits", "key"), product([1, 100, MOST_DIGITS - 1], ["a", '"it\'s"', "a.b"]))
def test_a_number_below_the_limit_is_read(digits: int, key: str) -> None:
    text = f"{key} = 1{'0' * (digits - 1)}"
    assert tables_of(text) == tomllib.loads(text)
