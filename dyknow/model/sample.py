"""Samples, the unit of exchange on every stream (thesis, Def. 4.3.4).

A `NamedTuple`: building one costs a third of a frozen, slotted dataclass, and every delivery builds one.
"""

import math
from collections.abc import Iterable
from typing import Any, Final, NamedTuple, TypeAlias

Value: TypeAlias = Any
"""A simple value, `NO_VALUE`, or a tuple of values (Def. 4.3.3). Immutable. Records are tuples in field order."""


MAX_BRANCH: Final = 64
"""Characters of a branch."""


class Predicted(NamedTuple):
    """That a value is predicted (thesis 12.3).

    Attributes:
        made_us: valid time of the newest sample that it was made from; federation time.
        branch: which of several futures it belongs to; empty: there is one.
        weight: probability in [0, 1] of that branch.
    """

    made_us: int
    branch: str = ""
    weight: float = 1.0


class Quality(NamedTuple):
    """Quality of a sample's value by its producer (thesis 12.3); by default it is sure, exact and measured.

    Attributes:
        certainty: probability in [0, 1] that the value is right.
        covariance: of the numeric components of the value, a symmetric matrix by rows, units squared; empty is none.
        prediction: when it was made, if the value is predicted.
    """

    certainty: float = 1.0
    covariance: tuple[tuple[float, ...], ...] = ()
    prediction: Predicted | None = None

    @property
    def deviation(self) -> float:
        """The largest standard deviation of a component, in its unit; infinite if a variance is negative."""
        variances = [row[i] for i, row in enumerate(self.covariance)]
        return math.sqrt(max(variances, default=0.0)) if min(variances, default=0.0) >= 0.0 else math.inf


SURE = Quality()
_new = tuple.__new__  # makes a NamedTuple in half the time


def oldest(predictions: Iterable[Predicted | None]) -> Predicted | None:
    """That of a value made from values with these: as old as the oldest, in all their branches; None: all are measured."""
    found = [each for each in predictions if each is not None]
    if not found:
        return None
    branches = {each.branch: each.weight for each in found}
    named = sorted(branch for branch in branches if branch)
    return Predicted(min(each.made_us for each in found), "+".join(named)[:MAX_BRANCH], math.prod(branches.values()))


class Sample(NamedTuple):
    """One value of one stream.

    Attributes:
        available_us: when this node could first use the sample; microseconds of federation time.
        valid_us: when the value held in the world; same clock.
        value: immutable payload; its unit belongs to the stream's sort, e.g. metres for `heli-altitude`.
        quality: how good the value is.
    """

    available_us: int
    valid_us: int
    value: Value
    quality: Quality = SURE

    def __repr__(self) -> str:
        more = "" if self.quality == SURE else f", {self.quality}"
        return f"Sample(available_us={self.available_us}, valid_us={self.valid_us}, value={self.value!r}{more})"

    def available_at(self, available_us: int) -> "Sample":
        """The same value, available at another time."""
        if available_us == self.available_us:
            return self
        return _new(Sample, (available_us, self.valid_us, self.value, self.quality))

    @property
    def delay_us(self) -> int:
        """Age of the value on arrival. Negative for predictions, which are legal."""
        return self.available_us - self.valid_us


def independent(*variances: float) -> Quality:
    """The quality of a sure value whose components err independently, by these variances."""
    count = range(len(variances))
    return Quality(1.0, tuple([tuple([variances[i] if i == j else 0.0 for j in count]) for i in count]))
