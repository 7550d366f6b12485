"""Of sixty typical mistakes nearly all are marked in their line, with a repair that is accepted when it is done."""

from dyknow.model.errors import TextError
from tests.kpl.checking.never_valued import BASE, findings_of
from tests.kpl.checking.test_repairs import is_other, repaired
from tests.kpl.checking.typical_mistakes import TYPICAL

FIRST = BASE.count("\n") + 1
MOST = 4
LINT = "one wrong sample"
"""Of a right formula that may be written better."""


def wrong_in(text: str) -> list[TextError]:
    """What is wrong, at its lines in this text, counted from 1."""
    errors, warnings = findings_of(text)
    found = [each for each in errors or warnings if LINT not in each.message]
    return [each.but(line=each.line - FIRST + 1, text=text) for each in found]


def mended(text: str) -> str | None:
    """The text with one repair after the other done until nothing is wrong; None if one of them mends nothing."""
    for _ in range(MOST):
        errors = wrong_in(text)
        if not errors:
            return text
        if errors[0].line < 1:
            return None
        ways = [(each, wrong_in(each)) for each in repaired(text, errors[0])]
        fewer = (each for each, left in ways if len(left) < len(errors))
        found = next(fewer, None) or next((each for each, left in ways if is_other(left, errors)), None)
        if found is None:
            return None
        text = found
    return None


def test_of_sixty_typical_mistakes_fifty_five_are_marked_and_mended_by_what_is_told(record_testsuite_property) -> None:
    assert len(TYPICAL) == 60
    assert len(set(TYPICAL)) == 60
    marked = [text for text, line in TYPICAL if line + 1 in {each.line for each in wrong_in(text)[:1]}]
    done = [text for text in marked if mended(text) is not None]
    record_testsuite_property("marked in their line, of 60", len(marked))
    record_testsuite_property("mended by their repair, of 60", len(done))
    assert len(marked) >= 58
    assert len(done) >= 55, [text for text, _ in TYPICAL if text not in done]


def test_a_misspelt_word_of_the_language_is_mended_in_the_statement_itself() -> None:
    assert wrong_in("monitor m = allways lower < 5")[0].repair == "monitor m = always lower < 5"
    assert wrong_in("stream out = level with max dealy 100")[0].repair == "stream out = level with max delay 100"
    assert wrong_in("strmgen out = Haf(level)\nstream later = out")[0].repair == "Half(level)"
