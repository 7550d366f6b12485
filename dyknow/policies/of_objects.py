"""One policy for a stream about many objects: it holds for the states of each object by themselves (Def. 8.5.2)."""

from dataclasses import replace
from typing import Final

from dyknow.model.sample import Sample
from dyknow.model.values import NO_VALUE, Sort
from dyknow.policies.ahead import moved_on
from dyknow.policies.policy import Policy
from dyknow.policies.sampling import Grid, PolicyAdapter

MOST_OBJECTS: Final = 4096
"""Objects whose last state is remembered."""


class ObjectAdapter(PolicyAdapter):
    """Adapts a stream of object states.

    Objects are seen at times of their own: with `sample every` each has one state at most in each period, with its own
    valid time, or one of each branch of that time, and nothing is approximated. A state to be predicted is moved on
    with its own velocity. The last state of an object, whose `end` is true, always passes.

    Args:
        before: continue a stream that was adapted until now.
    """

    __slots__ = ("_each", "_sort")

    def __init__(self, policy: Policy, sort: Sort, before: PolicyAdapter | None = None) -> None:
        super().__init__(replace(policy, approximation="none"))
        self.policy, self._sort = policy, sort
        self._each: dict[str, Sample] = dict(before._each) if isinstance(before, ObjectAdapter) else {}  # noqa: SLF001
        self.on_sample = self._of_object

    def confine(self, grid: Grid | None) -> None:
        """States lie on no grid."""

    def continued(self, policy: Policy) -> PolicyAdapter:
        return ObjectAdapter(policy, self._sort, self)

    @property
    def needed(self) -> Grid | None:
        return None

    @property
    def settling(self) -> bool:
        return False

    @property
    def is_open(self) -> bool:
        return False

    def _of_object(self, sample: Sample, now_us: int) -> list[Sample]:
        symbol = "" if sample.value is NO_VALUE else sample.value[0]
        ahead_us = self.policy.predict_us
        if ahead_us is not None and symbol and not self._sort.is_end(sample.value):
            moved = moved_on(sample, self._sort, ahead_us)
            if moved is None:
                self._unpredictable += 1
                return []
            sample = moved
        last = self._each.get(symbol)
        if not self._passes(sample, last, now_us):
            return []
        if sample.available_us < now_us or (self._last is not None and sample.available_us <= self._last.available_us):
            earliest_us = now_us if self._last is None else max(now_us, self._last.available_us + 1)
            sample = sample._replace(available_us=max(earliest_us, sample.available_us))
        self._last = sample
        self._each.pop(symbol, None)
        if not self._sort.is_end(sample.value):
            self._each[symbol] = sample
            if len(self._each) > MOST_OBJECTS:
                del self._each[next(iter(self._each))]
        return [sample]

    def _passes(self, sample: Sample, last: Sample | None, now_us: int) -> bool:
        valid_us, quality = sample.valid_us, sample.quality
        if self._sort.is_end(sample.value):
            return True
        if quality.certainty < self._least_certainty or quality.deviation > self._most_deviation:
            self._uncertain += 1
        elif quality.prediction is not None and sample.available_us - quality.prediction.made_us > self._oldest_us:
            self._too_old += 1
        elif not self._from_us <= valid_us <= self._to_us:
            self._outside += 1
        elif now_us - valid_us > self._max_delay_us:
            self._late += 1
        elif last is None or _is_other_branch(sample, last):
            return True
        elif valid_us - last.valid_us < self._least_step_us:
            self._out_of_order += 1
        elif self._changes and valid_us == last.valid_us and sample.value == last.value:
            self._no_change += 1
        elif self._period_us and self._cell(valid_us) == self._cell(last.valid_us):
            self._off_grid += 1
        else:
            return True
        return False

    def _cell(self, valid_us: int) -> int:
        """Which period a time lies in, from `from` on."""
        return (valid_us - (self.policy.from_us or 0)) // self._period_us


def _is_other_branch(sample: Sample, last: Sample) -> bool:
    """Whether both are of one time, in different futures."""
    one, other = sample.quality.prediction, last.quality.prediction
    if one is None or other is None:
        return False
    return sample.valid_us == last.valid_us and one.branch != other.branch


def adapted_to(adapter: PolicyAdapter, sort: Sort) -> PolicyAdapter:
    """The adapter for a stream of that sort: of object states one that looks at each object by itself."""
    is_plain = isinstance(adapter, ObjectAdapter) or adapter.is_open or not sort.is_of_objects
    return adapter if is_plain else ObjectAdapter(adapter.policy, sort, adapter)
