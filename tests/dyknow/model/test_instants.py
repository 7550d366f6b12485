from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import TextError, parse_duration, print_duration, print_span
from dyknow.model.instants import MAX_DURATION_US


@pytest.mark.parametrize(
    ("text", "expected_us"),
    [
        ("200", 200_000), ("200ms", 200_000), ("2s", 2_000_000), ("7us", 7), ("1.5 min", 90_000_000), ("1h", 3_600_000_000),
        ("1e3us", 1_000), ("0.001", 1), (" 30.5 ", 30_500), ("0", 0), ("1E-3", 1),
    ],
)  # fmt: skip
def test_a_number_is_milliseconds_unless_it_says_so(text: str, expected_us: int) -> None:
    assert parse_duration(text) == expected_us


def test_the_default_unit_can_be_named() -> None:
    assert parse_duration("1.0", "s") == 1_000_000
    assert parse_duration("1.0us", "s") == 1


@pytest.mark.parametrize(
    "text",
    [
        "",
        "s",
        "-1",
        "1 day",
        "0x10",
        "1_000",
        "١",
        "1e999999999",
        "9" * 40,
        "1" * 10_000,
        "nan",
        "inf",
        "1.",
        "0.5us",
        "1e19h",
        "1 2",
    ],
)
def test_what_is_no_duration_is_refused_with_its_place(text: str) -> None:
    with pytest.raises(TextError) as refused:
        parse_duration(text)
    assert len(str(refused.value)) < 500


@given(st.integers(0, MAX_DURATION_US))
def test_printed_durations_read_back(duration_us: int) -> None:
    assert parse_duration(print_duration(duration_us)) == duration_us


def test_durations_print_in_the_largest_exact_unit() -> None:
    assert [print_duration(us) for us in (0, 1, 1_500_000, 120_000_000, 7_200_000_000, -5_000)] == [
        "0s",
        "1us",
        "1500ms",
        "2min",
        "2h",
        "-5ms",
    ]


@pytest.mark.parametrize(
    ("us", "shown"),
    [
        (0, "0 us"), (12, "12 us"), (-300, "-300 us"), (80_000, "80 ms"), (999_400, "999 ms"), (999_600, "1.0 s"), (1_250_000, "1.2 s"), (75_000_000, "75.0 s"),
        (180_000_000, "3 min"), (7_200_000_000, "2 h"), (432_000_000_000, "5 days"),
    ],
)  # fmt: skip
def test_spans_are_rounded_for_people(us: int, shown: str) -> None:
    assert print_span(us) == shown


@given(st.text(max_size=80))
def test_any_text_is_a_duration_or_a_text_error(text: str) -> None:
    with suppress(TextError):
        assert 0 <= parse_duration(text) <= MAX_DURATION_US
