"""The definitions of 4.3 and 4.5.4 word for word, slow and by comprehension: what the product is compared with."""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from dyknow import NO_VALUE, Policy, PolicyAdapter, Sample, available

DATA = Path(__file__).parent / "data"
WORKED = json.loads((DATA / "streams.json").read_text())
MS = 1_000


def sample(written: Sequence[Any]) -> Sample:
    """A sample of the data file, whose times are milliseconds."""
    at, valid, value = written
    return Sample(round(at * MS), round(valid * MS), NO_VALUE if value is None else value)


def stream(written: Iterable[Sequence[Any]]) -> list[Sample]:
    return [sample(s) for s in written]


def valid_before(f: Iterable[Sample], t: int, tq: int) -> list[Sample]:
    """Definition 4.3.9."""
    return [s for s in available(f, tq) if s.valid_us <= t]


def last_valid_before(f: Sequence[Sample], t: int, tq: int) -> list[Sample]:
    """Definition 4.3.10."""
    found = valid_before(f, t, tq)
    return [s for s in found if s.valid_us == max(other.valid_us for other in found)]


def most_recent_at(f: Sequence[Sample], t: int, tq: int) -> Sample | None:
    """Definition 4.3.11."""
    return max(last_valid_before(f, t, tq), key=lambda s: s.available_us, default=None)


def is_substream(part: Iterable[Sample], f: Sequence[Sample]) -> bool:
    """Definition 4.5.9, with `available` where the text around it says `valid`."""
    return all(
        any(o.available_us <= s.available_us and (o.valid_us, o.value) == (s.valid_us, s.value) for o in f)
        for s in part
    )


def literal_extension(f: Sequence[Sample], policy: Policy) -> list[Sample]:
    """extend(f, p) of Definition 4.5.10, for a policy that uses the most recent value between two times."""
    assert policy.from_us is not None
    assert policy.to_us is not None
    assert policy.sample_us is not None
    assert policy.max_delay_us is not None
    points = range(policy.from_us, policy.to_us + 1, policy.sample_us)
    found = [(t, t + policy.max_delay_us, most_recent_at(f, t, t + policy.max_delay_us)) for t in points]
    return [Sample(at, t, NO_VALUE if s is None else s.value) for t, at, s in found]


def run(arrivals: Sequence[Sample], policy: Policy) -> tuple[list[Sample], PolicyAdapter]:
    """The stream a subscriber gets, when every timer goes off in its instant, after the inputs of that instant."""
    adapter, out, waiting = PolicyAdapter(policy), [], list(arrivals)
    horizon_us = max([s.available_us for s in arrivals], default=0) + 1_000
    while True:
        due_us = adapter.deadline_us
        if waiting and (due_us is None or waiting[0].available_us <= due_us):
            arrived = waiting.pop(0)
            out += adapter.on_sample(arrived, arrived.available_us)
        elif due_us is not None and due_us <= horizon_us:
            out += adapter.on_time(due_us)
        else:
            return out, adapter
