"""Hypothesis strategies that more than one package needs. Times are small, so that they meet often."""

from collections.abc import Callable
from typing import TypeVar

import pytest
from hypothesis import settings
from hypothesis import strategies as st

from dyknow import SURE, Label, Policy, Quality, Sample
from dyknow.model.labels import RESERVED
from dyknow.policies.policy import Approximation

Test = TypeVar("Test", bound=Callable[..., None])
_Found = TypeVar("_Found")
CASES = 10_000


def examples(all_of_them: int) -> int:
    """How many examples a property sees: in the usual profile two of five."""
    return all_of_them if settings.get_current_profile_name() == "full" else all_of_them * 2 // 5


def definition(test: Test) -> Test:
    """A property test of a numbered definition of the thesis: in the full profile it sees `CASES` cases."""
    full = settings.get_current_profile_name() == "full"
    return pytest.mark.definition(settings(max_examples=CASES)(test) if full else test)


times_us = st.integers(min_value=0, max_value=400)
values = st.sampled_from(["a", "b", "c"])
names = st.from_regex(r"[a-zA-Z_][a-zA-Z0-9_]{0,4}(-[a-zA-Z0-9_]{1,3})?", fullmatch=True).filter(
    lambda n: n not in RESERVED
)
labels = st.builds(Label, names, st.lists(names | st.integers(0, 99).map(str), max_size=3).map(tuple))


QUALITIES = (SURE, SURE, Quality(0.5), Quality(0.96, ((4.0,),)), Quality(1.0, ((9.0, 1.0), (1.0, 1.0))))


def rows(draw: st.DrawFn, max_size: int, width: int) -> list[bytes]:
    """So many numbers below 256 for each sample of a stream, drawn at once: one by one they cost twenty times as much."""
    size = draw(st.integers(0, max_size))
    drawn = draw(st.binary(min_size=size * width, max_size=size * width))
    return [drawn[at : at + width] for at in range(0, len(drawn), width)]


@st.composite
def streams(draw: st.DrawFn, max_size: int = 20, max_delay_us: int = 120, max_lead_us: int = 20) -> list[Sample]:
    """A stream in order of available time, with unique available times; valid times of any order, some predictions."""
    return _stream(rows(draw, max_size, 3), max_delay_us + max_lead_us + 1, max_lead_us)


@st.composite
def gridded_streams(draw: st.DrawFn, period_us: int = 20, max_size: int = 20) -> list[Sample]:
    """As above, but valid times are mostly multiples of `period_us`, so that sampled policies find something."""
    return _stream(rows(draw, max_size, 4), period_us=period_us)


@st.composite
def rated_streams(draw: st.DrawFn, max_size: int = 20) -> list[Sample]:
    """As above, of samples that say how good they are."""
    return _stream(rows(draw, max_size, 5), period_us=20)


def _stream(rows: list[bytes], spread_us: int = 141, lead_us: int = 20, period_us: int | None = None) -> list[Sample]:
    """Of each row: time since the sample before, delay, value, whether it lies beside the grid, quality."""
    found, at_us = list[Sample](), 0
    for row in rows:
        at_us += 1 + row[0] % 60
        valid_us = max(0, at_us - row[1] % spread_us + lead_us)
        if period_us is not None:
            valid_us = valid_us // period_us * period_us + (row[3] % 4 == 3)
        quality = SURE if len(row) < 5 else QUALITIES[row[4] % len(QUALITIES)]
        found.append(Sample(at_us, valid_us, "abc"[row[2] % 3], quality))
    return found


@st.composite
def policies(draw: st.DrawFn, exact: bool = False) -> Policy:
    """Every kind of valid policy; the exact ones approximate nothing."""
    return _policy(draw(st.binary(min_size=15, max_size=15)), exact)


def _policy(row: bytes, exact: bool) -> Policy:
    """Of each number a choice, or half a time; a first choice that is odd is no constraint of its kind."""

    def maybe(at: int, found: _Found) -> _Found | None:
        return found if row[at] % 2 == 0 else None

    from_us = maybe(0, (row[1] + 256 * row[2]) % 401)
    to_us = maybe(3, (row[4] + 256 * row[5]) % 401)
    sample_us = maybe(6, (5, 10, 20, 40)[row[6] // 2 % 4])
    max_delay_us = maybe(7, row[8] % 101)
    approximations: list[Approximation] = ["none"]
    if sample_us is not None and not exact:
        approximations += ["linear"] + (["most recent"] if from_us is not None and max_delay_us is not None else [])
    approximation = approximations[row[11] % len(approximations)]
    return Policy(
        change="sample" if sample_us is not None else ("any update", "any change")[row[9] % 2],
        sample_us=sample_us,
        max_delay_us=max_delay_us,
        from_us=from_us,
        to_us=None if to_us is None else to_us + (from_us or 0),
        order=("any", "monotone", "strict")[row[10] % 3],
        approximation=approximation,
        exact=approximation == "none" and row[10] // 3 % 4 == 0,
        delay_before_us=maybe(12, (row[12] + 256 * row[11]) % 401),
        min_certainty=maybe(13, (0.0, 0.95, 1.0)[row[13] // 2 % 3]),
        max_deviation=maybe(14, (0.0, 2.0, 3.0)[row[14] // 2 % 3]),
        importance=(1.0, 0.5, 10.0)[row[9] // 2 % 3],
    )
