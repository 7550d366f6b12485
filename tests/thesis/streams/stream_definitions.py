"""The definitions of 4.3 and 4.5.4 word for word, slow and by comprehension: what the product is compared with."""

import json
from collections.abc import Iterable, Iterator, Sequence
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

from dyknow import NO_VALUE, Policy, PolicyAdapter, Sample, UnitFunction, Value

DATA = Path(__file__).parent / "data"
WORKED = json.loads((DATA / "streams.json").read_text())
MS = 1_000


def sample(written: Sequence[Any]) -> Sample:
    """A sample of the data file, whose times are milliseconds."""
    at, valid, value = written
    return Sample(round(at * MS), round(valid * MS), NO_VALUE if value is None else value)


def stream(written: Iterable[Sequence[Any]]) -> list[Sample]:
    return [sample(s) for s in written]


def is_value(v: Any) -> bool:
    """Definitions 4.3.2 and 4.3.3: a simple value, no_value, or a tuple of values; a set of values is ours."""
    if isinstance(v, tuple | frozenset):
        return all(map(is_value, v))
    if isinstance(v, float):
        return v - v == 0
    return v is NO_VALUE or isinstance(v, bool | int | str)


def is_fluent_stream(f: Sequence[Any]) -> bool:
    """Definitions 3.2.1 and 4.3.5: samples, in order of available times that are unique."""
    times = [s.available_us for s in f if isinstance(s, Sample)]
    return len(times) == len(f) == len(set(times)) and times == sorted(times)


def available(f: Iterable[Sample], t: int) -> list[Sample]:
    """Definition 4.3.7."""
    return [s for s in f if s.available_us <= t]


def last_available(f: Iterable[Sample], t: int) -> Sample | None:
    """Definition 4.3.8; no_sample is None."""
    there = available(f, t)
    return next((s for s in there if all(o.available_us <= s.available_us for o in there)), None)


def valid_before(f: Iterable[Sample], t: int, tq: int) -> list[Sample]:
    """Definition 4.3.9."""
    return [s for s in available(f, tq) if s.valid_us <= t]


def last_valid_before(f: Sequence[Sample], t: int, tq: int) -> list[Sample]:
    """Definition 4.3.10."""
    found = valid_before(f, t, tq)
    return [s for s in found if s.valid_us == max(other.valid_us for other in found)]


def most_recent_at(f: Sequence[Sample], t: int, tq: int) -> Sample | None:
    """Definition 4.3.11."""
    return last_available(last_valid_before(f, t, tq), tq)


def previous(f: Sequence[Sample], s: Sample | None) -> Sample | None:
    """Definition 4.3.12."""
    before = [] if s is None else [o for o in f if o.available_us < s.available_us]
    return max(before, key=lambda o: o.available_us, default=None)


def available_times(*fs: Iterable[Sample]) -> set[int]:
    """Definition 4.3.13."""
    return set().union(*({s.available_us for s in f} for f in fs))


def join(*fs: Sequence[Sample]) -> list[Sample]:
    """Definition 4.3.16."""
    return [Sample(t, t, tuple(last_available(f, t) for f in fs)) for t in sorted(available_times(*fs))]


def values(samples: Iterable[Sample | None]) -> list[Value]:
    """Definition 4.5.5; a list, since values that are equal need not be the same."""
    return [s.value for s in samples if s is not None]


def refined(function: UnitFunction, *fs: Sequence[Sample]) -> list[Sample]:
    """Definition 4.5.8: the unit over the join of its inputs, its state first no_value."""
    state, found = NO_VALUE, list[Sample]()
    for element in join(*fs):
        output, state = function(element.available_us, element.value, state)
        if output is not None:
            found.append(output)
    return found


def holds(f: Sequence[Sample], policy: Policy) -> Iterator[bool]:
    """Definition 4.5.11, constraint by constraint; `sample every` as P1 has it, and the constraints of 12.3."""
    pairs = [(s, before) for s in f if (before := previous(f, s)) is not None]
    if policy.change == "any change":
        yield all(s.valid_us != before.valid_us or s.value != before.value for s, before in pairs)
    if policy.sample_us is not None:
        steps = [s.valid_us - before.valid_us for s, before in pairs]
        yield all(step > 0 and step % policy.sample_us == 0 for step in steps)
    if policy.from_us is not None:
        yield all(policy.from_us <= s.valid_us for s in f)
    if policy.to_us is not None:
        yield all(s.valid_us <= policy.to_us for s in f)
    if policy.max_delay_us is not None:
        yield all(s.available_us - s.valid_us <= policy.max_delay_us for s in f)
    if policy.order == "monotone":
        yield all(before.valid_us <= s.valid_us for s, before in pairs)
    if policy.order == "strict":
        yield all(before.valid_us < s.valid_us for s, before in pairs)
    if policy.min_certainty is not None:
        yield all(s.quality.certainty >= policy.min_certainty for s in f)
    if policy.max_deviation is not None:
        variances = [row[i] for s in f for i, row in enumerate(s.quality.covariance)]
        yield all(variance <= policy.max_deviation**2 for variance in variances)


def satisfies(f: Sequence[Sample], policy: Policy) -> bool:
    """I, f |= p of Definition 4.5.11."""
    return all(holds(f, policy))


def is_maximal(kept: Sequence[Sample], f: Sequence[Sample], policy: Policy) -> bool:
    """Definition 4.5.10 for policies without approximation: no satisfying stream of samples of f has more than `kept`.

    As P1 has it, on the grid that `from` anchors; each sample at the time when it came.
    """
    sample_us, from_us = policy.sample_us, policy.from_us
    on_grid = [s for s in f if sample_us is None or from_us is None or (s.valid_us - from_us) % sample_us == 0]
    left = [s for s in on_grid if s not in kept]
    more = (added for n in range(1, len(left) + 1) for added in combinations(left, n))
    return not any(satisfies(sorted([*kept, *added], key=lambda s: s.available_us), policy) for added in more)


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


def line_between(f: Iterable[Sample], policy: Policy) -> list[tuple[int, int, Any]]:
    """(valid, available, value) of each grid point under `use linear`: exact, or on the line between its neighbours."""
    assert policy.sample_us is not None
    heard: list[Sample] = []
    for s in f:
        if not heard or s.valid_us > heard[-1].valid_us:
            heard.append(s)
    anchor_us = policy.from_us if policy.from_us is not None or not heard else heard[0].valid_us
    found: list[tuple[int, int, Any]] = []
    for before, after in pairwise([None, *heard]):
        assert after is not None
        first_us = after.valid_us if before is None else before.valid_us + 1
        assert anchor_us is not None
        for t in range(first_us + (anchor_us - first_us) % policy.sample_us, after.valid_us + 1, policy.sample_us):
            is_wanted = (policy.from_us is None or policy.from_us <= t) and (policy.to_us is None or t <= policy.to_us)
            is_late = policy.max_delay_us is not None and after.available_us - t > policy.max_delay_us
            value = after.value if before is None else on_line(before, after, t)
            if is_wanted and not is_late and (t == after.valid_us or value is not NO_VALUE):
                found.append((t, after.available_us, after.value if t == after.valid_us else value))
    return found


def on_line(before: Sample, after: Sample, t: int) -> Any:
    """The point of the straight line, component by component; none where a component has no number."""

    def one(a: Any, b: Any) -> Any:
        if not all(isinstance(v, int | float) and not isinstance(v, bool) for v in (a, b)):
            return NO_VALUE
        return a + (b - a) * (t - before.valid_us) / (after.valid_us - before.valid_us)

    if not isinstance(after.value, tuple):
        return one(before.value, after.value)
    if not isinstance(before.value, tuple) or len(before.value) != len(after.value):
        return NO_VALUE
    found = tuple(map(one, before.value, after.value))
    return NO_VALUE if NO_VALUE in found else found


def run(
    arrivals: Sequence[Sample], policy: Policy, horizon_us: int | None = None
) -> tuple[list[Sample], PolicyAdapter]:
    """The stream a subscriber gets, when every timer goes off in its instant, after the inputs of that instant."""
    adapter, out, waiting = PolicyAdapter(policy), [], list(arrivals)
    if horizon_us is None:
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
