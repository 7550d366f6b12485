"""Sources of a host: waited for, read at their times, and never by two at once."""

import threading
import time
from collections.abc import Iterator
from queue import SimpleQueue

from dyknow import Sample, SourcePrototype
from dyknow.agents.hosts.knowledge_host import Read
from dyknow.policies.sampling import Grid
from dyknow.runtime.hosts.sources import SourceThread

PATIENCE_S = 10.0


class Sensor:
    """Blocks until the test has something for it; counts who is in it."""

    def __init__(self) -> None:
        self.values: SimpleQueue[tuple[int | None, object]] = SimpleQueue()
        self.inside = self.most = self.opened = 0

    def read(self, _from_us: int) -> Iterator[tuple[int | None, object]]:
        self.inside += 1
        self.opened += 1
        self.most = max(self.most, self.inside)
        try:
            while True:
                yield self.values.get(timeout=PATIENCE_S)
        finally:
            self.inside -= 1


class Host:
    def __init__(self, source: SourcePrototype) -> None:
        self.source = source
        self.readings: SimpleQueue[tuple[int, Sample]] = SimpleQueue()
        self.faults: SimpleQueue[str] = SimpleQueue()

    def read(self, process: int, *after: SourceThread, grid: Grid | None = None) -> SourceThread:
        thread = SourceThread(
            Read(process, self.source, 0, grid), after, now_us, lambda span_us: span_us / 1e6,
            lambda thread, samples: [self.readings.put((thread.process, sample)) for sample in samples] and None,
            lambda _process, said: self.faults.put(said),
        )  # fmt: skip
        thread.start()
        return thread


def now_us() -> int:
    return time.monotonic_ns() // 1000


def test_a_sensor_that_is_not_let_go_yet_is_not_opened_a_second_time() -> None:
    sensor = Sensor()
    host = Host(SourcePrototype("sensor", "number", sensor.read))
    first = host.read(1)
    sensor.values.put((None, "a"))
    assert host.readings.get(timeout=PATIENCE_S)[1].value == "a"
    first.rest()
    second = host.read(2, first)
    third = host.read(3, first, second)
    second.rest()
    sensor.values.put((None, "nobody wants it"))
    sensor.values.put((None, "b"))
    process, sample = host.readings.get(timeout=PATIENCE_S)
    assert (process, sample.value) == (3, "b")
    assert first.is_at_rest
    assert second.is_at_rest
    assert sensor.most == 1
    assert sensor.opened == 2
    third.rest()
    sensor.values.put((None, "the last"))


def test_what_has_no_valid_time_is_valid_when_it_was_read_and_the_rest_comes_at_its_time() -> None:
    begins_us = now_us()
    read = [(None, 1), (begins_us + 100_000, 2), (begins_us + 200_000, 3)]
    host = Host(SourcePrototype("some", "number", lambda _from_us: iter(read)))
    host.read(1)
    samples = [host.readings.get(timeout=PATIENCE_S) for _ in read]
    came_us = now_us()
    assert [sample.value for _, sample in samples] == [1, 2, 3]
    assert begins_us <= samples[0][1].valid_us <= samples[0][1].available_us
    assert came_us >= begins_us + 200_000


def test_only_what_is_wanted_is_passed_on() -> None:
    host = Host(SourcePrototype("some", "number", lambda _from_us: iter([(n, n) for n in range(1, 10)])))
    host.read(1, grid=Grid(3, 1))
    assert [host.readings.get(timeout=PATIENCE_S)[1].value for _ in range(3)] == [1, 4, 7]


def test_what_is_wrong_with_a_source_is_told() -> None:
    def breaks(_from_us: int) -> Iterator[tuple[int, int]]:
        yield 1, 1
        raise OSError("unplugged")

    for read, said in ((breaks, "unplugged"), (lambda _from_us: iter([5]), "unpack"), (lambda: None, "cannot be read")):
        host = Host(SourcePrototype("some", "number", read))  # type: ignore[arg-type]
        host.read(1)
        assert said in host.faults.get(timeout=PATIENCE_S)


def test_who_owns_the_processes_is_told_once_and_gets_the_newest() -> None:
    host = Host(SourcePrototype("some", "number", lambda _from_us: iter(())))
    thread = host.read(1)
    told = [thread.leave((Sample(0, n, n),)) for n in range(5000)]
    assert told == [True, *[False] * 4999]
    assert thread.taken()[-1][0].value == 4999
    assert len(thread.taken()) == 0
    assert threading.active_count() < 50
