"""Descriptions of wanted objects: allowed values of properties, and the degree to which a value fits."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import hypot, inf
from typing import Final, TypeAlias

PropertyValue: TypeAlias = str | bool | float | tuple[float, float]
"""Text, truth, a number, or a place in metres."""
LEAST: Final = 1e-9
"""Degrees below this are 0."""


@dataclass(frozen=True, slots=True)
class AllowedValues:
    """A set of values, each with the degree to which it is as described; 1 in a set that is not graded."""

    degrees: tuple[tuple[PropertyValue, float], ...]

    def degree(self, value: PropertyValue) -> float:
        return next((d for allowed, d in self.degrees if same_value(allowed, value)), 0.0)

    def __str__(self) -> str:
        return " or ".join(
            shown_value(value) if degree == 1.0 else f"{shown_value(value)} (to {degree:g})"
            for value, degree in self.degrees
        )


@dataclass(frozen=True, slots=True)
class AllowedInterval:
    """Numbers from `low` to `high`; over `soft` outside of them the degree falls from 1 to 0."""

    low: float = -inf
    high: float = inf
    soft: float = 0.0

    def degree(self, value: PropertyValue) -> float:
        if isinstance(value, bool | str | tuple):
            return 0.0
        return _falling(max(self.low - value, value - self.high, 0.0), self.soft)

    def __str__(self) -> str:
        if self.low == -inf:
            return f"at most {self.high:g}"
        return f"at least {self.low:g}" if self.high == inf else f"from {self.low:g} to {self.high:g}"


@dataclass(frozen=True, slots=True)
class AllowedPlace:
    """Places within `within_m` of a point; over `soft_m` outside of that the degree falls from 1 to 0."""

    at_m: tuple[float, float]
    within_m: float
    soft_m: float = 0.0

    def degree(self, value: PropertyValue) -> float:
        if not isinstance(value, tuple):
            return 0.0
        distance_m = hypot(value[0] - self.at_m[0], value[1] - self.at_m[1])
        return _falling(max(distance_m - self.within_m, 0.0), self.soft_m)

    def __str__(self) -> str:
        return f"within {self.within_m:g} m of {shown_value(self.at_m)}"


Allowed: TypeAlias = AllowedValues | AllowedInterval | AllowedPlace


@dataclass(frozen=True, slots=True)
class ObjectDescription:
    """The description of a wanted object; properties of percepts that it does not mention are ignored.

    Attributes:
        is_definite: it means one object, "the cup in my office"; else any that is so, "a red cup".
    """

    properties: Mapping[str, Allowed]
    is_definite: bool = True


def same_value(one: PropertyValue, other: PropertyValue) -> bool:
    """Equal and of one kind: true is not 1."""
    return isinstance(one, bool) == isinstance(other, bool) and one == other


def shown_value(value: PropertyValue) -> str:
    """A value as a message has it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple):
        return f"({value[0]:g}, {value[1]:g})"
    return value if isinstance(value, str) else f"{value:g}"


def _falling(outside: float, soft: float) -> float:
    if outside <= 0.0:
        return 1.0
    degree = 1.0 - outside / soft if soft > 0.0 else 0.0
    return degree if degree > LEAST else 0.0
