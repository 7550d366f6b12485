"""The pseudo-code of 7.8.2, procedure by procedure: buffers keep everything, categories are computed from scratch."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from dyknow import NO_VALUE, Policy, Sample, State
from dyknow.states.synchronization import Category

EXACT, APRX_FINAL, APRX_MORE, NOAPRX_FINAL, NOAPRX_MORE = Category


class Wanted(NamedTuple):
    """from, to, sample every, delay before approximation, max delay; microseconds."""

    from_us: int
    to_us: int
    sample_us: int
    delay_before_us: int
    max_delay_us: int


class Step(NamedTuple):
    now_us: int
    sync_us: int
    categories: tuple[Category, ...]


def category(buffer: Sequence[Sample], policy: Policy, sync_us: int, now_us: int) -> Category:
    """Classify one input, with most recent value approximation."""
    if any(s.valid_us == sync_us for s in buffer):
        return EXACT
    last_us = max((s.valid_us for s in buffer), default=None)
    final = policy.max_delay_us is not None and now_us >= sync_us + policy.max_delay_us
    if last_us is not None and policy.sample_us is not None:
        final = final or last_us + policy.sample_us > sync_us
    elif last_us is not None and policy.order == "strict":
        final = final or last_us >= sync_us
    elif last_us is not None and policy.order == "monotone":
        final = final or last_us > sync_us
    if any(s.valid_us < sync_us for s in buffer):
        return APRX_FINAL if final else APRX_MORE
    return NOAPRX_FINAL if final else NOAPRX_MORE


def value(buffer: Sequence[Sample], sync_us: int) -> Any:
    """The sample with the highest valid time up to the point, of equals the one that arrived last."""
    usable = [s for s in buffer if s.valid_us <= sync_us]
    return max(usable, key=lambda s: (s.valid_us, s.available_us)).value if usable else NO_VALUE


def synchronized(categories: Sequence[Category], sync_us: int, clock_us: int, wanted: Wanted) -> bool:
    """`clock_us`: every timer set to it or earlier has gone off."""
    now = [APRX_FINAL if c is NOAPRX_FINAL else c for c in categories]
    if all(c in {EXACT, APRX_FINAL} for c in now):
        return True
    if all(c in {EXACT, APRX_FINAL, APRX_MORE} for c in now) and sync_us + wanted.delay_before_us <= clock_us:
        return True
    return sync_us + wanted.max_delay_us <= clock_us


def events(
    arrivals: Sequence[tuple[int, Sample]], sync_us: int, policies: Sequence[Policy], wanted: Wanted
) -> Iterator[int]:
    """When anything can change: arrivals, and the timers of one synchronisation point."""
    yield from (s.available_us for _, s in arrivals)
    yield from (sync_us + wanted.delay_before_us, sync_us + wanted.max_delay_us)
    yield from (sync_us + p.max_delay_us for p in policies if p.max_delay_us is not None)


def sampled_synchronized_state_stream(
    policies: Sequence[Policy], arrivals: Sequence[tuple[int, Sample]], wanted: Wanted, start_us: int
) -> tuple[list[State], list[Step]]:
    """States and what was known at each step, for arrivals (input, sample) in order of available time."""
    buffers: list[list[Sample]] = [[] for _ in policies]
    waiting = list(arrivals)
    states: list[State] = []
    steps: list[Step] = []
    now_us, clock_us = start_us, start_us

    def look(sync_us: int) -> tuple[Category, ...]:
        found = tuple(category(b, p, sync_us, clock_us) for b, p in zip(buffers, policies, strict=True))
        steps.append(Step(now_us, sync_us, found))
        return found

    for sync_us in range(wanted.from_us, wanted.to_us + 1, wanted.sample_us):
        while not synchronized(look(sync_us), sync_us, clock_us, wanted):
            timers = [t for t in events([], sync_us, policies, wanted) if t > clock_us]
            if waiting and waiting[0][1].available_us <= min(timers):  # at one instant inputs come before timers
                i, arrived = waiting.pop(0)
                now_us, clock_us = arrived.available_us, arrived.available_us - 1
                buffers[i].append(arrived)
            else:
                now_us = clock_us = min(timers)
        states.append(State(now_us, sync_us, tuple(value(b, sync_us) for b in buffers)))
    return states, steps
