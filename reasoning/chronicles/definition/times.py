"""Instants and the constraints between them (thesis 8.3.1, 8.3.3). All times are integers of milliseconds (C1)."""

from dataclasses import dataclass
from typing import Final, TypeAlias

from dyknow.model.errors import ChronicleError

LIMIT_MS: Final = 2**53
"""No time constant and no time of an event is larger."""


@dataclass(frozen=True, slots=True)
class Interval:
    """`[low, high]`, both inclusive; None is -oo or oo. Written open, as in `]-oo, 100[`, it ends at 99.

    Raises:
        ChronicleError: if it holds no integer, or a bound is larger than 2**53.
    """

    low_ms: int | None = None
    high_ms: int | None = None

    def __post_init__(self) -> None:
        if any(bound is not None and abs(bound) > LIMIT_MS for bound in (self.low_ms, self.high_ms)):
            raise ChronicleError(f"a bound of an interval is beyond {LIMIT_MS} ms; write oo for none")
        if self.low_ms is not None and self.high_ms is not None and self.low_ms > self.high_ms:
            raise ChronicleError(f"{self} holds no instant; write the lower bound first")

    def __contains__(self, time_ms: int) -> bool:
        return (self.low_ms is None or self.low_ms <= time_ms) and (self.high_ms is None or time_ms <= self.high_ms)

    def shifted(self, by_ms: int) -> "Interval":
        """`interval + constant`: added to every finite bound."""
        return self + Interval(by_ms, by_ms)

    def __add__(self, other: "Interval") -> "Interval":
        """The possible sums of an instant of each."""
        return Interval(_sum(self.low_ms, other.low_ms), _sum(self.high_ms, other.high_ms))

    def __neg__(self) -> "Interval":
        return Interval(_minus(self.high_ms), _minus(self.low_ms))

    def __sub__(self, other: "Interval") -> "Interval":
        return self + -other

    def __and__(self, other: "Interval") -> "Interval":
        lows = [low for low in (self.low_ms, other.low_ms) if low is not None]
        highs = [high for high in (self.high_ms, other.high_ms) if high is not None]
        return Interval(max(lows, default=None), min(highs, default=None))

    def __or__(self, other: "Interval") -> "Interval":
        """The union, which must be an interval itself: one without a gap."""
        for first, second in ((self, other), (other, self)):
            if first.high_ms is not None and second.low_ms is not None and first.high_ms + 1 < second.low_ms:
                raise ChronicleError(f"{first} | {second} has a gap; a constraint takes one interval")
        low = None if self.low_ms is None or other.low_ms is None else min(self.low_ms, other.low_ms)
        high = None if self.high_ms is None or other.high_ms is None else max(self.high_ms, other.high_ms)
        return Interval(low, high)

    def __str__(self) -> str:
        left = "]-oo" if self.low_ms is None else f"[{self.low_ms}"
        return f"{left}, " + ("oo[" if self.high_ms is None else f"{self.high_ms}]")


def _sum(left: int | None, right: int | None) -> int | None:
    return None if left is None or right is None else left + right


def _minus(bound: int | None) -> int | None:
    return None if bound is None else -bound


ZERO: Final = Interval(0, 0)


@dataclass(frozen=True, slots=True)
class TimePoint:
    """`t`, `t + 5`, `t - 1`, or `t + [0, 10]`: an instant, shifted by something in the interval `shift`.

    With an interval of more than one element the point is any instant in it: `t2 = t1 + [0, 10]` says
    `t2 - t1 in [0, 10]`, and in a predicate the point stands for an instant of its own that no event fixes.
    """

    instant: str
    shift: Interval = ZERO

    def __str__(self) -> str:
        low, high = self.shift.low_ms, self.shift.high_ms
        if low is None or low != high:
            return f"{self.instant} + {self.shift}"
        return self.instant if low == 0 else f"{self.instant} {'-' if low < 0 else '+'} {abs(low)}"


@dataclass(frozen=True, slots=True)
class TimeOrder:
    """`t1 < t2 <= t3 = t4`: one operator (`<`, `<=`, `=`, `>=`, `>`) fewer than points."""

    points: tuple[TimePoint, ...]
    operators: tuple[str, ...]

    def __str__(self) -> str:
        tail = (f" {operator} {point}" for operator, point in zip(self.operators, self.points[1:], strict=True))
        return f"{self.points[0]}{''.join(tail)}"


@dataclass(frozen=True, slots=True)
class Distance:
    """`to - from in interval`, also written `to - from < 100` or `10 <= to - from <= 30`.

    Attributes:
        from_: None if a single instant is constrained, by the clock: `t in [0, 1000]`.
    """

    to: str
    from_: str | None
    interval: Interval

    def __str__(self) -> str:
        return f"{self.to}{'' if self.from_ is None else f' - {self.from_}'} in {self.interval}"


@dataclass(frozen=True, slots=True)
class ConstraintUse:
    """`mySequence(begin, middle, finish)`: a complex constraint that is declared under a name."""

    name: str
    points: tuple[TimePoint, ...]

    def __str__(self) -> str:
        return f"{self.name}({', '.join(map(str, self.points))})"


TimeConstraint: TypeAlias = TimeOrder | Distance | ConstraintUse


@dataclass(frozen=True, slots=True)
class ComplexConstraint:
    """`time constraint mySequence(t1, t2, t3) { ... }`: a conjunction under a name; purely syntactic (8.3.3).

    Without parameters, `time constraint myOrder { ... }`, its instants are those of the text that uses it (8.3.5).

    The text of 8.3.3 writes `constraint mySequence(...)`, the grammar of 8.3.5 `time constraint mySequence(...)`.
    """

    name: str
    parameters: tuple[str, ...]
    constraints: tuple[TimeConstraint, ...]
