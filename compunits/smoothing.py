"""Less noise: means, medians, and values that have to last before they count.

Means and medians take numbers or records of numbers of any sort, each component by itself; headings and longitudes,
which jump where their circle closes, are not for them. They want samples ordered by valid time: late ones give nothing.
Where a sample has no value, or is not made of finite numbers, the output has no value, and nothing is forgotten.
"""

import math
from collections import deque
from collections.abc import Callable, Sequence
from statistics import median

from dyknow import NO_VALUE, US_PER_S, Quality, Sample, Value, computational_unit
from dyknow.compunits.numeric import Numbers, in_shape_of, is_sound, numbers_of, positive
from dyknow.model.sample import oldest

_MOST_REMEMBERED = 10_000


class _Window:
    """The common part of `MovingAverage` and `MovingMedian`: the samples of the last while."""

    def __init__(self, seconds: float | None, samples: int | None) -> None:
        if seconds is None and samples is None:
            samples = 5
        self._span_us = None if seconds is None else round(positive("seconds", seconds) * US_PER_S)
        most = _MOST_REMEMBERED if samples is None else samples
        if isinstance(most, bool) or not isinstance(most, int) or not 0 < most <= _MOST_REMEMBERED:
            raise ValueError(f"samples must be a number from 1 to {_MOST_REMEMBERED}, got {samples!r}")
        self._known: deque[tuple[int, Numbers, Quality]] = deque(maxlen=most)

    def over(self, now_us: int, sample: Sample, reduce: Callable[[Sequence[float]], float]) -> Sample | None:
        known, valid_us = self._known, sample.valid_us
        if known and valid_us < known[-1][0]:
            return None
        numbers = numbers_of(sample.value)
        if numbers is None:
            return Sample(now_us, valid_us, NO_VALUE, sample.quality)
        if known and len(known[-1][1]) != len(numbers):
            known.clear()
        known.append((valid_us, numbers, sample.quality))
        while self._span_us is not None and known[0][0] <= valid_us - self._span_us:
            known.popleft()
        try:
            smooth = [reduce(column) for column in zip(*[row for _, row, _ in known], strict=True)]
        except OverflowError:
            smooth = [math.nan]
        certainty = min(quality.certainty for _, _, quality in known)
        prediction = oldest(quality.prediction for _, _, quality in known)
        return Sample(now_us, valid_us, in_shape_of(sample.value, smooth), Quality(certainty, (), prediction))


@computational_unit("?sort", "?sort", history_us=US_PER_S, cheaper="ExponentialSmoothing")
class MovingAverage:
    """The mean of the last samples, valid when the latest is, and as certain as the least certain of them.

    Args:
        seconds: those with a valid time in ]t - seconds, t].
        samples: number of the newest samples; if neither is given, 5. At most 10 000 are remembered.
    """

    def __init__(self, seconds: float | None = None, samples: int | None = None) -> None:
        self._window = _Window(seconds, samples)

    def __call__(self, now_us: int, sample: Sample) -> Sample | None:
        return self._window.over(now_us, sample, _mean)


def _mean(column: Sequence[float]) -> float:
    return math.fsum(column) / len(column)


@computational_unit("?sort", "?sort", history_us=US_PER_S, cheaper="MovingAverage")
class MovingMedian:
    """The median of the last samples, which single wrong ones do not move; arguments as for `MovingAverage`."""

    def __init__(self, seconds: float | None = None, samples: int | None = None) -> None:
        self._window = _Window(seconds, samples)

    def __call__(self, now_us: int, sample: Sample) -> Sample | None:
        return self._window.over(now_us, sample, median)


@computational_unit("?sort", "?sort", history_us=3 * US_PER_S)
class ExponentialSmoothing:
    """y + (1 - e^(-dt / T)) (x - y): a value T seconds old counts e times less; dt is the time since the last sample.

    Args:
        seconds: the time constant T.
    """

    def __init__(self, seconds: float = 1.0) -> None:
        self._constant_us = positive("seconds", seconds) * US_PER_S
        self._last: tuple[int, Numbers] | None = None

    def __call__(self, now_us: int, sample: Sample) -> Sample | None:
        valid_us, last = sample.valid_us, self._last
        if last is not None and valid_us < last[0]:
            return None
        numbers = numbers_of(sample.value)
        if numbers is None:
            return Sample(now_us, valid_us, NO_VALUE, sample.quality)
        if last is not None and len(last[1]) == len(numbers):
            fresh = -math.expm1((last[0] - valid_us) / self._constant_us)
            numbers = tuple([(1.0 - fresh) * old + fresh * new for old, new in zip(last[1], numbers, strict=True)])
        self._last = valid_us, numbers
        return Sample(now_us, valid_us, in_shape_of(sample.value, numbers), sample.quality._replace(covariance=()))


@computational_unit("?sort", "?sort", history_us=US_PER_S // 2)
class StabilityFilter:
    """It "only changes the value of an attribute if it has been stable for a fixed amount of time" (thesis 8.7.4).

    A value passes once the samples of the last `seconds` and the one they began with have all been equal to it; till
    then the value stays that passed last, and before the first there is nothing. `no_value` is a value here, and a
    value that is not finite is `no_value`. The output is valid when the sample that shows it is.

    Args:
        seconds: of valid time; "in our case 500 milliseconds".
    """

    def __init__(self, seconds: float = 0.5) -> None:
        self._span_us = round(positive("seconds", seconds) * US_PER_S)
        self._candidate: Value = NO_VALUE
        self._since_us: int | None = None
        self._latest_us = 0
        self._passed: Value = None

    def __call__(self, now_us: int, sample: Sample) -> Sample | None:
        valid_us = sample.valid_us
        if self._since_us is not None and valid_us < self._latest_us:
            return None
        self._latest_us = valid_us
        value = sample.value if is_sound(sample.value) else NO_VALUE
        if self._since_us is None or value != self._candidate:
            self._candidate, self._since_us = value, valid_us
        if valid_us - self._since_us >= self._span_us:
            self._passed = value
        return None if self._passed is None else Sample(now_us, valid_us, self._passed, sample.quality)


@computational_unit("?sort", "?sort", history_us=US_PER_S // 2)
class StableFields:
    """Each component of a record by itself as by a `StabilityFilter`; nothing before each has passed once.

    After `seconds` without a value the output has none either, and each component has to be stable again before it passes.

    Args:
        seconds: of valid time; where a sample has another number of components, there is no output.
    """

    def __init__(self, seconds: float = 0.5) -> None:
        self._span_us = round(positive("seconds", seconds) * US_PER_S)
        self._candidates: list[Value] = []
        self._since_us: list[int] = []
        self._passed: list[Value] = []
        self._latest_us = 0
        self._lacking_us: int | None = None

    def __call__(self, now_us: int, sample: Sample) -> Sample | None:
        record = sample.value
        if record is NO_VALUE or (isinstance(record, tuple) and is_sound(record)):
            return self.on_record(now_us, sample.valid_us, record, sample.quality)
        return None

    def on_record(self, now_us: int, valid_us: int, record: Value, quality: Quality) -> Sample | None:
        """The same for a record of sound values, or `NO_VALUE`."""
        if record is NO_VALUE:
            return self._without(now_us, valid_us, quality)
        self._lacking_us = None
        if not self._candidates:
            self._candidates, self._since_us = list(record), [valid_us] * len(record)
            self._passed, self._latest_us = [None] * len(record), valid_us
        if len(record) != len(self._candidates) or valid_us < self._latest_us:
            return None
        self._latest_us = valid_us
        candidates, since_us, latest_us = self._candidates, self._since_us, valid_us - self._span_us
        for i, part in enumerate(record):
            if part != candidates[i]:
                candidates[i], since_us[i] = part, valid_us
            if since_us[i] <= latest_us:
                self._passed[i] = part
        return None if None in self._passed else Sample(now_us, valid_us, tuple(self._passed), quality)

    def restart(self) -> None:
        """Each component has to be stable again before it passes."""
        self._candidates, self._lacking_us = [], None

    def _without(self, now_us: int, valid_us: int, quality: Quality) -> Sample | None:
        if not self._candidates or valid_us < self._latest_us:
            return None
        self._latest_us = valid_us
        if self._lacking_us is None:
            self._lacking_us = valid_us
        if valid_us - self._lacking_us < self._span_us:
            return None
        self.restart()
        return Sample(now_us, valid_us, NO_VALUE, quality)


@computational_unit("?sort", "?sort")
class Observed:
    """Samples that are measured and certain; predicted ones are left out, such as those of a linked object that no percept shows.

    Args:
        seconds: a prediction passes that was made at most so long before its time.
        certainty: the least certainty of a sample that passes.
    """

    def __init__(self, seconds: float = 0.0, certainty: float = 0.9) -> None:
        if not (isinstance(seconds, int | float) and 0.0 <= seconds < math.inf):
            raise ValueError(f"seconds must be a number >= 0, got {seconds!r}")
        if not (isinstance(certainty, int | float) and 0.0 <= certainty <= 1.0):
            raise ValueError(f"certainty must be a number from 0 to 1, got {certainty!r}")
        self._span_us, self._least = round(seconds * US_PER_S), certainty

    def __call__(self, now_us: int, sample: Sample) -> Sample | None:
        quality = sample.quality
        made_us = sample.valid_us if quality.prediction is None else quality.prediction.made_us
        is_seen = sample.valid_us - made_us <= self._span_us and quality.certainty >= self._least
        value = sample.value if is_sound(sample.value) else NO_VALUE
        return Sample(now_us, sample.valid_us, value, quality) if is_seen else None
