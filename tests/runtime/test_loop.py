from dataclasses import dataclass, field
from pathlib import Path
from queue import Empty

from dyknow.runtime.loop import BATCH, Pressure, step
from tests.fakes import FakeClock


@dataclass
class Waiting:
    """A mailbox on the fake clock: waiting moves the clock to the next event or to the end of the timeout."""

    clock: FakeClock
    events: list[tuple[int, str]] = field(default_factory=list)
    waits_s: list[float | None] = field(default_factory=list)

    def get(self, timeout: float | None) -> str:
        self.waits_s.append(timeout)
        until_us = None if timeout is None else self.clock.now_us() + round(timeout * 1e6)
        if self.events and (until_us is None or self.events[0][0] <= until_us):
            at_us, event = self.events.pop(0)
            self.clock.advance_us(max(0, at_us - self.clock.now_us()))
            return event
        assert until_us is not None, "a node without a deadline would sleep for ever"
        self.clock.advance_us(until_us - self.clock.now_us())
        raise Empty


@dataclass
class Metronome:
    """Beats every 100 us, and repeats what it hears."""

    deadline_us: int | None = 100
    period_us: int | None = 100

    def on_event(self, event: str, now_us: int) -> list[str]:
        return [f"{event} at {now_us}"]

    def on_time(self, now_us: int) -> list[str]:
        self.deadline_us = None if self.period_us is None else now_us + self.period_us
        return [f"beat at {now_us}"]


def test_a_deadline_ends_the_wait() -> None:
    clock, done = FakeClock(), list[str]()
    step(Metronome(), Waiting(clock), clock.now_us, done.append)
    assert done == ["beat at 100"]


def test_at_one_instant_inputs_come_before_timers() -> None:
    clock, done = FakeClock(), list[str]()
    step(Metronome(), Waiting(clock, [(100, "a"), (100, "b")]), clock.now_us, done.append)
    assert done == ["a at 100", "b at 100", "beat at 100"]


def test_timers_come_even_when_events_never_pause() -> None:
    clock, done = FakeClock(), list[str]()
    box = Waiting(clock, [(100, str(number)) for number in range(10 * BATCH)])
    step(Metronome(), box, clock.now_us, done.append)
    assert len(done) == BATCH + 1
    assert done[-1] == "beat at 100"


def test_without_a_deadline_the_wait_has_no_end_but_an_event() -> None:
    clock, done = FakeClock(), list[str]()
    box = Waiting(clock, [(5_000_000, "late")])
    step(Metronome(deadline_us=None), box, clock.now_us, done.append)
    assert done == ["late at 5000000"]
    assert box.waits_s[0] is None


def test_an_effect_is_performed_before_the_next_event_is_taken() -> None:
    clock = FakeClock()
    box = Waiting(clock, [(0, "a"), (0, "b")])
    left: list[int] = []
    step(Metronome(), box, clock.now_us, lambda _effect: left.append(len(box.events)))
    assert left[:2] == [1, 0]


def test_steps_without_events_are_the_deadlines_in_order() -> None:
    clock, done = FakeClock(), list[str]()
    node = Metronome()
    while len(done) < 5:
        step(node, Waiting(clock), clock.now_us, done.append)
    assert done == [f"beat at {100 * n}" for n in range(1, 6)]


def statistics(path: Path, waited_ns: int) -> Path:
    path.write_text(f"123456 {waited_ns} 42\n")
    return path


def test_a_loop_pauses_the_longer_the_more_its_thread_waits_for_a_processor(tmp_path: Path) -> None:
    waited_ns, pauses = 0, []
    pressure = Pressure(statistics(tmp_path / "schedstat", 0))
    for half_second in range(41):
        part = 0.0 if half_second <= 10 or half_second > 30 else 0.05 if half_second <= 20 else 0.5
        waited_ns += int(part * 500_000_000)
        statistics(tmp_path / "schedstat", waited_ns)
        pauses.append(pressure.pause_s(half_second * 500_000))
    assert pauses[:11] == [0.0] * 11
    assert 0.006 < pauses[20] < 0.010
    assert pauses[30] == 0.060
    assert pauses[40] < 0.002, "and no more when the machine is free again"


def test_a_process_says_how_long_its_thread_waits_while_that_is_much_and_once_when_it_is_over(tmp_path: Path) -> None:
    waited_ns, told = 0, []
    pressure = Pressure(statistics(tmp_path / "schedstat", 0))
    for half_second in range(40):
        waited_ns += 200_000_000 if 10 <= half_second < 20 else 0
        statistics(tmp_path / "schedstat", waited_ns)
        pressure.pause_s(half_second * 500_000)
        if pressure.is_news:
            told.append((half_second, pressure.reported()))
        assert not pressure.is_news
    at, parts = zip(*told, strict=True)
    assert at == tuple(range(10, at[-1] + 1))
    assert max(parts) == parts[9] > 0.35
    assert parts[-1] < 0.05 <= parts[-2]


def test_a_loop_never_pauses_where_nothing_says_how_long_threads_wait(tmp_path: Path) -> None:
    for text in (None, "", "1", "a b c"):
        if text is not None:
            (tmp_path / "schedstat").write_text(text)
        pressure = Pressure(tmp_path / "schedstat")
        assert [pressure.pause_s(at_us) for at_us in range(0, 5_000_000, 500_000)] == [0.0] * 10
