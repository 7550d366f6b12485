from itertools import accumulate

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import History, Sample, ValueNotAvailable
from tests.strategies import definition, streams
from tests.thesis.streams.stream_definitions import most_recent_at


def filled(capacity: int, samples: list[Sample]) -> History:
    history = History(capacity)
    for s in samples:
        history.add(s)
    return history


def or_none(ask: object) -> Sample | None:
    try:
        return ask()  # type: ignore[operator,no-any-return]
    except ValueNotAvailable:
        return None


long_streams = st.lists(st.tuples(st.integers(1, 5), st.integers(-10, 60)), max_size=200).map(
    lambda steps: [
        Sample(at, at - delay, n)
        for n, (at, delay) in enumerate(zip(accumulate(s for s, _ in steps), (d for _, d in steps), strict=True))
    ]
)


@definition
@given(streams(), st.integers(1, 30))
def test_the_cache_is_the_tail_of_the_stream(f: list[Sample], capacity: int) -> None:
    history, tail = filled(capacity, f), f[-capacity:]
    assert history.get_size() == len(tail)
    assert history.get_slice(0, len(tail) - 1) == tail
    assert [history.get_nth_latest(n) for n in range(len(tail))] == tail[::-1]
    assert or_none(history.get_latest) == (tail[-1] if tail else None)
    assert or_none(history.get_latest_vtime) == max(tail, key=lambda s: (s.valid_us, s.available_us), default=None)


@definition
@given(long_streams, st.integers(1, 30), st.integers(0, 600), st.integers(0, 600))
def test_queries_by_valid_time_say_what_the_definitions_say_of_the_cache(
    f: list[Sample], capacity: int, t: int, length: int
) -> None:
    history, tail = filled(capacity, f), f[-capacity:]
    assert or_none(lambda: history.get_closest_at_or_before(t)) == most_recent_at(tail, t, 10**9)
    expected = sorted((s for s in tail if t <= s.valid_us <= t + length), key=lambda s: (s.valid_us, s.available_us))
    assert history.get_between(t, t + length) == expected
    assert history.get_between(t + 1, t) == []


@definition
@given(long_streams, st.integers(1, 30), st.integers(0, 600), st.integers(0, 600))
def test_most_recent_at_is_that_of_the_whole_stream_or_is_not_available(
    f: list[Sample], capacity: int, t: int, tq: int
) -> None:
    history = filled(capacity, f)
    found, whole = or_none(lambda: history.most_recent_at(t, tq)), most_recent_at(f, t, tq)
    assert found in (whole, None)
    if capacity >= len(f):
        assert found == whole
    elif history.starts_us is not None and whole is not None and whole.valid_us >= history.starts_us:
        assert found == whole, "nothing is refused that is surely known"


@given(long_streams, st.integers(1, 30))
def test_every_sample_from_the_start_of_the_history_on_is_held(f: list[Sample], capacity: int) -> None:
    history, tail = filled(capacity, f), f[-capacity:]
    if len(f) <= capacity:
        assert history.starts_us is None
    else:
        assert history.starts_us is not None
        assert all(s in tail for s in f if s.valid_us >= history.starts_us)


@given(long_streams, st.integers(1, 10), st.integers(0, 199))
def test_a_history_can_be_asked_while_it_grows(f: list[Sample], capacity: int, every: int) -> None:
    history = History(capacity)
    for n, s in enumerate(f):
        history.add(s)
        if n % (every + 1) == 0:
            tail = f[max(0, n + 1 - capacity) : n + 1]
            assert history.get_between(0, 10**9) == sorted(
                (x for x in tail if x.valid_us >= 0), key=lambda x: (x.valid_us, x.available_us)
            )


def test_one_valid_time_from_the_future_does_not_disorder_what_follows_for_ever() -> None:
    history = History(100)
    history.add(Sample(0, 10**9, "wrong"))
    for t in range(1, 1_000):
        history.add(Sample(t, t, "right"))
    assert history._ordered()[0] is history._samples, "back to bisection without sorting"
    assert history.get_latest_vtime() == Sample(999, 999, "right")


def test_memory_is_bounded() -> None:
    history = History(100)
    for t in range(10_000):
        history.add(Sample(t, t, "v"))
    assert len(history._samples) <= 164
    assert history.get_size() == 100


def test_what_is_not_there_is_said_not_to_be_available() -> None:
    empty = History(2)
    for ask in (
        empty.get_latest, empty.get_latest_vtime, lambda: empty.get_nth_latest(0), lambda: empty.get_slice(0, 0),
        lambda: empty.get_closest_at_or_before(5), lambda: empty.most_recent_at(5, 5),
    ):  # fmt: skip
        with pytest.raises(ValueNotAvailable):
            ask()
    assert empty.get_between(0, 5) == []
    assert empty.get_slice(0, -1) == []
    for n in range(4):
        empty.add(Sample(n, n, "v"))
    with pytest.raises(ValueNotAvailable, match="starts at 2 us"):
        empty.most_recent_at(1, 9)
    for wrong in (lambda: empty.get_nth_latest(-1), lambda: empty.get_nth_latest(2), lambda: empty.get_slice(-1, 0)):
        with pytest.raises(ValueNotAvailable):
            wrong()


@given(long_streams, st.integers(1, 30), st.integers(0, 200), st.integers(0, 600), st.integers(0, 900))
def test_what_is_forgotten_for_a_client_is_refused_and_never_answered_wrongly(
    f: list[Sample], capacity: int, at: int, t: int, tq: int
) -> None:
    history = filled(capacity, f[:at])
    assert history.forget() == min(at, len(f), capacity)
    assert history.get_size() == 0
    for s in f[at:]:
        history.add(s)
    found, whole = or_none(lambda: history.most_recent_at(t, tq)), most_recent_at(f, t, tq)
    assert found in (whole, None)
    if f[:at]:
        assert history.starts_us is not None, "it had a past"
        assert history.starts_us > max(s.valid_us for s in f[:at][-capacity:])
    assert history.get_between(-100, 10**9) == sorted(f[at:][-capacity:], key=lambda s: (s.valid_us, s.available_us))


def test_reset_forgets_everything_also_that_something_was_forgotten() -> None:
    history = filled(2, [Sample(n, 9 - n, "v") for n in range(5)])
    history.reset()
    assert history.get_size() == 0
    assert history.starts_us is None
    history.add(Sample(9, 1, "w"))
    assert history.get_closest_at_or_before(1) == Sample(9, 1, "w")


def test_a_history_holds_at_least_one_sample() -> None:
    with pytest.raises(ValueError, match="at least 1"):
        History(0)
