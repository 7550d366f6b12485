import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.documents.durations import duration_us
from dyknow.model.errors import WrongCall
from dyknow.runtime.configuration.instants import instant_us

NOW = 1_700_000_000_000_000


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("-10s", NOW - 10_000_000),
        ("+250ms", NOW + 250_000),
        ("now", NOW),
        ("0s", NOW),
        ("1700000000000001", 1_700_000_000_000_001),
        ("2023-11-14T22:13:20Z", NOW),
        ("2023-11-14T22:13:20", NOW),
        ("2023-11-15T00:13:20.000005+02:00", NOW + 5),
    ],
)
def test_an_instant_is_relative_iso_8601_or_microseconds(text: str, expected: int) -> None:
    assert instant_us(text, NOW, option="--at") == expected


@given(st.integers(min_value=0, max_value=4_000_000_000_000_000))
def test_microseconds_are_taken_exactly(instant: int) -> None:
    assert instant_us(str(instant), NOW, option="--at") == instant


@pytest.mark.parametrize("text", ["", "soon", "-", "-10x", "2023-13-01", "1e9", "10 s ago"])
def test_what_is_no_instant_is_refused_with_place_and_examples(text: str) -> None:
    with pytest.raises(WrongCall, match=r"^--at: .*(-10s|200ms)"):
        instant_us(text, NOW, option="--at")


@pytest.mark.parametrize(
    ("text", "expected"), [("5s", 5_000_000), ("200ms", 200_000), ("1.5min", 90_000_000), ("7us", 7)]
)
def test_a_duration_is_a_number_and_a_unit(text: str, expected: int) -> None:
    assert duration_us(text, option="--timeout") == expected


@pytest.mark.parametrize(
    ("text", "said"), [("5", "say 5ms or 5s"), ("0", "say 0ms or 0s"), ("0s", "too short"), ("9us", "1ms")]
)
def test_a_duration_without_a_unit_or_too_short_is_refused(text: str, said: str) -> None:
    with pytest.raises(WrongCall, match=f"^--every: .*{said}"):
        duration_us(text, option="--every", least_us=1_000)
