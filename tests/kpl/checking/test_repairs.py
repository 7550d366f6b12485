"""The repair that an error names, done in the text, is accepted: in place of what is marked, of the line, or before it."""

from collections.abc import Iterator

import pytest

from dyknow.model.errors import TextError, TextErrors
from tests.kpl.checking.test_wrong_specifications import BEFORE, WRONG
from tests.kpl.instances import Running

MENDED = [case for case in WRONG if case.get("mended")]
"""Wrong specifications that their repairs mend; those of the others are examples of what may be meant."""
MOST = 6


def errors_of(text: str) -> list[TextError]:
    try:
        Running().add(text)
    except TextErrors as wrong:
        return list(wrong.errors)
    except TextError as wrong:
        return [wrong]
    return []


def repaired(text: str, error: TextError) -> Iterator[str]:
    """The text with the repair of one error done, in each way in which a reader may do it."""
    lines, at, left = text.split("\n"), error.line - 1, error.column - 1
    if error.repair.startswith("nothing: "):
        ways = [[lines[at][:left] + lines[at][left + error.width :]]]
    else:
        first, rest, after = lines[at][:left], lines[at][left + error.width :], lines[at][left:]
        ways = [
            [first + error.repair + rest],
            [error.repair],
            [error.repair, lines[at]],
            [f"{first}{error.repair} {after}"],
            [f"{first} {error.repair}"],
        ]
        if error.repair.endswith(" where it ends"):
            ways = [[lines[at] + error.repair[0]]]
    for way in ways:
        yield "\n".join([*lines[:at], *way, *lines[at + 1 :]])


def is_other(now: list[TextError], before: list[TextError]) -> bool:
    """Whether the error that was repaired is gone, and another has come to light behind it."""
    return len(now) == len(before) == 1 and now[0].message != before[0].message


def mended(text: str) -> str | None:
    """The text with one repair after the other done until nothing is wrong; None if one of them mends nothing."""
    for _ in range(MOST):
        errors = errors_of(text)
        if not errors:
            return text
        ways = [(each, errors_of(each)) for each in repaired(text, errors[0])]
        fewer = (each for each, left in ways if len(left) < len(errors))
        found = next(fewer, None) or next((each for each, left in ways if is_other(left, errors)), None)
        if found is None:
            return None
        text = found
    return None


def test_there_are_a_hundred() -> None:
    assert len(MENDED) >= 100


@pytest.mark.parametrize("case", MENDED, ids=[case["text"][:60] for case in MENDED])
def test_what_is_repaired_as_it_is_told_is_accepted(case) -> None:
    text = f"{BEFORE}{case['text']}\n"
    assert errors_of(text)
    assert mended(text) is not None
