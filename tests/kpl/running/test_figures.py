"""What an instance says of its own streams: how late they are, also while nothing comes."""

from dyknow import Sample
from tests.kpl.instances import Running

BASE = "source number raw\nstrmgen slow = raw\nstream out = slow\nstream late = stream_delay[slow]\n"


def fed(every_ms: int, delay_ms: int, until_ms: int, watch_ms: int) -> list[float]:
    """The delays that are told of a stream whose samples come so, and then no more."""
    running = Running(BASE)
    for at_ms in range(every_ms, until_ms + 1, every_ms):
        running.wait((at_ms + delay_ms) * 1000)
        running.network.now_us = (at_ms + delay_ms) * 1000
        running.instance.push("raw", Sample(running.network.now_us, at_ms * 1000, 1.0))
    running.wait(watch_ms * 1000)
    return [
        sample.value for name, sample in running.outputs if name == "late" and sample.valid_us > 2 * every_ms * 1000
    ]


def test_a_stream_of_one_hertz_has_its_delay_between_its_samples_too() -> None:
    told = fed(1000, 500, 8000, 8900)
    assert len(told) > 50
    assert set(told[5:]) == {500.0}


def test_a_stream_that_is_fast_has_the_longest_delay_of_the_last_tenth() -> None:
    assert set(fed(10, 20, 2000, 2000)[-5:]) == {20.0}


def test_a_regular_stream_that_stalls_is_overdue_by_more_and_more() -> None:
    told = fed(100, 5, 2000, 6000)
    assert max(told[:15]) < 100
    assert told[-1] > 3000
    assert told[-20:] == sorted(told[-20:])
