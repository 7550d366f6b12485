"""Each declaration that can never have a value is refused, or warned of, by the check of a specification: none is silent."""

from functools import cache

import pytest

from tests.kpl.checking.never_valued import BASE, findings_of, templates, wrong_ones

FIRST = BASE.count("\n") + 1


@cache
def said_of_right(text: str) -> frozenset[str]:
    errors, warnings = findings_of(text)
    assert not errors, (text, errors)
    return frozenset(each.message for each in warnings)


def test_what_they_are_drawn_from_is_right() -> None:
    assert findings_of("") == ([], [])
    assert len(templates()) > 60
    for each in templates():
        said_of_right(each.right())


@pytest.mark.parametrize(("count", "seed"), [(300, 1), pytest.param(3000, 2, marks=pytest.mark.full)])
def test_none_of_three_hundred_wrong_declarations_is_silent_and_nine_of_ten_are_marked_in_their_line(
    count: int, seed: int, record_testsuite_property
) -> None:
    silent, misplaced, all_of_them = [], [], 0
    for wrong in wrong_ones(count, seed):
        errors, warnings = findings_of(wrong.text)
        found = [each for each in (errors or warnings) if each.message not in said_of_right(wrong.right)]
        all_of_them += 1
        if not found:
            silent.append(wrong.text)
        elif FIRST + wrong.line not in {each.line for each in found}:
            misplaced.append((wrong.text, found[0].line - FIRST, found[0].message))
    record_testsuite_property(f"silent of {count}", len(silent))
    assert all_of_them == count
    assert silent == []
    assert len(misplaced) <= count // 10, misplaced
