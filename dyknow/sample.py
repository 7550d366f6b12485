"""Samples, the unit of exchange on every stream (thesis, Def. 4.3.4).

A `NamedTuple`: building one costs a third of a frozen, slotted dataclass, and every delivery builds one.
"""

from typing import Any, NamedTuple, TypeAlias

Value: TypeAlias = Any
"""A simple value, `NO_VALUE`, or a tuple of values (Def. 4.3.3). Immutable. Records are tuples in field order."""


class Sample(NamedTuple):
    """One value of one stream.

    Attributes:
        available_us: when this node could first use the sample; microseconds of federation time.
        valid_us: when the value held in the world; same clock.
        value: immutable payload; its unit belongs to the stream's sort, e.g. metres for `heli-altitude`.
    """

    available_us: int
    valid_us: int
    value: Value

    @property
    def delay_us(self) -> int:
        """Age of the value on arrival. Negative for predictions, which are legal."""
        return self.available_us - self.valid_us
