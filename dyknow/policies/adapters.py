"""Filters that enforce one constraint each (thesis, 4.4.5 and Def. 4.5.11). No clock, no queue, no I/O.

A filter compares a sample with the one accepted before it. They define what `Policy` means; `PolicyAdapter` does
the same in one step per sample.
"""

import math
from collections.abc import Callable
from typing import TypeAlias

from dyknow.model.errors import PolicyError
from dyknow.model.instants import RelativeInstant, print_instant
from dyknow.model.sample import Sample

Accept: TypeAlias = Callable[[Sample, Sample | None], bool]


def any_change(sample: Sample, last: Sample | None) -> bool:
    """Accept samples whose value or valid time differs from the sample before (Def. 4.4.9)."""
    return last is None or sample.valid_us != last.valid_us or sample.value != last.value


def sample_every(period_us: int) -> Accept:
    """Accept samples a positive multiple of `period_us` after the one before (Def. 4.4.9; a miss ends nothing).

    Raises:
        PolicyError: if `period_us` is not positive.
    """
    if period_us <= 0:
        raise PolicyError(f"a sample period must be > 0 us, got {period_us}", "sample every 100")

    def accept(sample: Sample, last: Sample | None) -> bool:
        if last is None:
            return True
        elapsed_us = sample.valid_us - last.valid_us
        return elapsed_us > 0 and elapsed_us % period_us == 0

    return accept


def on_grid(period_us: int, anchor_us: int) -> Accept:
    """Accept samples whose valid time is a multiple of `period_us` away from `anchor_us`."""
    return lambda sample, _last: (sample.valid_us - anchor_us) % period_us == 0


def max_delay(limit_us: int) -> Accept:
    """Accept samples no older than `limit_us` on arrival (Def. 4.4.10).

    Raises:
        PolicyError: if `limit_us` is negative.
    """
    if limit_us < 0:
        raise PolicyError(f"max delay must be >= 0 us, got {limit_us}", "max delay 1000")
    return lambda sample, _last: sample.delay_us <= limit_us


def duration(from_us: int | None, to_us: int | None) -> Accept:
    """Accept samples valid in [from_us, to_us], both inclusive; None is no bound (Def. 4.4.11). An offset is not known yet.

    Raises:
        PolicyError: if the duration ends before it starts.
    """
    comparable = isinstance(from_us, RelativeInstant) == isinstance(to_us, RelativeInstant)
    if from_us is not None and to_us is not None and comparable and to_us < from_us:
        raise PolicyError(
            f"`from {print_instant(from_us)}` and `to {print_instant(to_us)}` collide: a duration cannot end before it starts",
            "from 300 to 400",
        )
    return lambda sample, _last: (
        (from_us is None or from_us <= sample.valid_us) and (to_us is None or sample.valid_us <= to_us)
    )


def min_certainty(least: float) -> Accept:
    """Accept samples that are right with at least this probability (thesis 12.3).

    Raises:
        PolicyError: if `least` is no probability.
    """
    if not 0 <= least <= 1:
        raise PolicyError(f"a certainty is from 0 to 1, got {least}", "min certainty 0.95")
    return lambda sample, _last: sample.quality.certainty >= least


def max_deviation(limit: float) -> Accept:
    """Accept samples none of whose components has a greater standard deviation; in their unit (thesis 12.3).

    Raises:
        PolicyError: if `limit` is negative or no finite number.
    """
    if not 0 <= limit < math.inf:
        raise PolicyError(f"a deviation is a number >= 0, got {limit}", "max deviation 2.0")
    return lambda sample, _last: sample.quality.deviation <= limit


def predicted(ahead_us: int) -> Accept:
    """Accept samples that are predicted (thesis 12.3).

    Raises:
        PolicyError: nothing would be predicted.
    """
    if ahead_us <= 0:
        raise PolicyError(f"a prediction is for a time after now, got {ahead_us} us", "predict 5s")
    return lambda sample, _last: sample.quality.prediction is not None


def max_prediction_age(limit_us: int) -> Accept:
    """Accept samples that are measured, or were predicted at most so long before they came (thesis 12.3).

    Raises:
        PolicyError: `limit_us` is negative.
    """
    if limit_us < 0:
        raise PolicyError(f"an age must be >= 0 us, got {limit_us}", "max age of prediction 1s")
    return lambda sample, _last: (
        sample.quality.prediction is None or sample.available_us - sample.quality.prediction.made_us <= limit_us
    )


def monotone_order(sample: Sample, last: Sample | None) -> bool:
    """Accept samples whose valid time does not go back (Def. 4.4.12). Equal times pass."""
    return last is None or sample.valid_us >= last.valid_us


def strict_order(sample: Sample, last: Sample | None) -> bool:
    """Accept samples whose valid time goes forward (Def. 4.4.12)."""
    return last is None or sample.valid_us > last.valid_us
