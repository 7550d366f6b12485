"""Rounds of questions, and the pauses before a recipient is asked again, over drawn answers, silences and departures."""

from hypothesis import given
from hypothesis import strategies as st

from dyknow.federation.messages.rounds import Retries, Round

UNITS = st.sampled_from(["1", "2", "3", "4"])
EVENTS = st.lists(st.tuples(st.sampled_from(["ask", "answered", "answered", "answered"]), UNITS), max_size=20)


@given(st.sets(UNITS), EVENTS)
def test_a_round_is_over_once_each_was_counted_once(at_first: set[str], events: list[tuple[str, str]]) -> None:
    """Whether it answers, is silent or leaves; some come late, some answer twice, and some who were not asked."""
    one, counted, asked = Round(sorted(at_first)), list[str](), list(at_first)
    for what, unit in events:
        if what == "ask" and unit not in one.awaited:
            one.ask(unit)
            asked.append(unit)
        elif what == "answered" and one.answered(unit):
            counted.append(unit)
    assert sorted([*counted, *one.awaited]) == sorted(asked)


def test_recipients_are_awaited_in_the_order_of_the_questions() -> None:
    one = Round(["2", "1"])
    one.ask("0")
    assert [*one.awaited] == ["2", "1", "0"]
    assert [one.answered(unit) for unit in ("1", "1", "7")] == [True, False, False]


class Reference:
    """The pauses by the book: all requests since it was new, and how many since it did as asked."""

    def __init__(self) -> None:
        self.asked_us: list[int] = []
        self.in_a_row = 0

    def pause_us(self, most_us: int) -> int:
        return min(most_us, 100 * 2 ** max(0, self.in_a_row - 2))


@given(st.lists(st.tuples(st.sampled_from(["ask", "ask", "settle", "gone"]), UNITS, st.integers(0, 1000)), max_size=25))
def test_pauses_double_until_a_recipient_does_as_asked_and_one_that_is_back_is_new(
    events: list[tuple[str, str, int]],
) -> None:
    retries, book, now_us = Retries[str](100, 400), dict[str, Reference](), 0
    for what, unit, after_us in events:
        now_us += after_us
        of_unit = book.setdefault(unit, Reference())
        if what == "ask":
            retries.asked(unit, now_us)
            of_unit.asked_us.append(now_us)
            of_unit.in_a_row += 1
        elif what == "settle":
            retries.settle(unit)
            of_unit.in_a_row = min(of_unit.in_a_row, 1)
        else:
            retries.forget(unit)
            del book[unit]
        for each, known in book.items():
            for patience in (1, 3):
                due_us = known.asked_us[-1] + patience * known.pause_us(400) if known.asked_us else 0
                assert retries.is_due(each, now_us, patience) is (now_us >= due_us)


def test_without_a_longest_pause_all_are_equal() -> None:
    retries = Retries[str](100)
    for at_us in (0, 100, 200, 300):
        assert retries.is_due("1", at_us)
        retries.asked("1", at_us)
        assert not retries.is_due("1", at_us + 99)
