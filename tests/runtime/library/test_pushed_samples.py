"""What a program pushes is checked in the program."""

import math
import random

import pytest

from dyknow import NO_VALUE, SURE, Quality
from dyknow.model.errors import WrongCall
from dyknow.runtime.library.pushed_samples import pushed

NOW_US = 5_000_000


@pytest.mark.parametrize(
    ("valid_us", "expected_us"), [(7, 7), ("now", NOW_US), ("-2s", 3_000_000), ("1970-01-01T00:00:01Z", 1_000_000)]
)
def test_an_instant_may_be_a_text(valid_us, expected_us) -> None:
    assert pushed("g", valid_us, 1.0, SURE, NOW_US) == ("g", expected_us, 1.0, SURE)


def test_values_are_those_that_streams_have() -> None:
    assert pushed("g", 0, None, SURE, NOW_US).value is NO_VALUE
    assert pushed("g", 0, ["a", (1, 2.5), True], SURE, NOW_US).value == ("a", (1, 2.5), True)


WRONG = [object(), {}, {"a": 1}, b"raw", [object()], lambda: 1, 1j, [[[[[[[[[[1]]]]]]]]]]]


@pytest.mark.parametrize(
    "arguments",
    [
        *((source, 0, 1.0, SURE) for source in (None, 3, ("g",))),
        *(("g", at, 1.0, SURE) for at in (None, 1.5, True, math.nan, math.inf, "soon", "3", [], 2**80) if at != "3"),
        *(("g", 0, value, SURE) for value in WRONG),
        *(("g", 0, 1.0, quality) for quality in (None, 1.0, {})),
    ],
)
def test_a_wrong_argument_is_refused_where_it_is_given(arguments) -> None:
    with pytest.raises(WrongCall):
        pushed(*arguments, NOW_US)


def test_whatever_is_pushed_is_a_sample_or_refused() -> None:
    rng = random.Random(5)
    anything = [
        None,
        0,
        -1,
        2**70,
        1.5,
        math.nan,
        "now",
        "x",
        True,
        (),
        (1,),
        [2],
        {},
        object(),
        NO_VALUE,
        SURE,
        Quality(0.5),
    ]
    for _ in range(2000):
        try:
            source, valid_us, _, quality = pushed(*rng.choices(anything, k=4), NOW_US)
        except WrongCall:
            continue
        assert isinstance(source, str)
        assert type(valid_us) is int
        assert isinstance(quality, Quality)
