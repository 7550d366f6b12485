"""A stream filtered by constraints, one after the other: what `PolicyAdapter` does in one step is compared with it."""

from collections.abc import Iterable, Iterator

from dyknow import Sample
from dyknow.policies.adapters import Accept


def restrict(samples: Iterable[Sample], *accepts: Accept) -> Iterator[Sample]:
    """Yield the samples every filter accepts, compared with the last one yielded."""
    last: Sample | None = None
    for sample in samples:
        if all(accept(sample, last) for accept in accepts):
            yield sample
            last = sample
