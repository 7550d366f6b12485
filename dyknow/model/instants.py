"""Durations as users write them, and the integer microseconds they stand for.

Instants and durations are `int` microseconds everywhere; nothing is rounded, so a text finer than that is refused.
"""

import re
from decimal import Decimal

from dyknow.model.errors import TextError

US_PER_MS = 1_000
US_PER_S = 1_000_000
US_PER_UNIT = {"us": 1, "ms": US_PER_MS, "s": US_PER_S, "min": 60 * US_PER_S, "h": 3_600 * US_PER_S}
MAX_DURATION_US = 2**62
"""Far beyond any clock, and small enough that sums of durations stay 64-bit on the wire."""

_DURATION = re.compile(r"([0-9]{1,20}(?:\.[0-9]{1,20})?(?:[eE][+-]?[0-9]{1,2})?)\s?(us|ms|s|min|h)?")
_PRINTED = ("h", "min", "s", "ms", "us")
_ROUNDED = (
    (1, 1_000, "us", 0),
    (US_PER_MS, US_PER_S, "ms", 0),
    (US_PER_S, 100 * US_PER_S, "s", 1),
    (60 * US_PER_S, 6_000 * US_PER_S, "min", 0),
    (3_600 * US_PER_S, 360_000 * US_PER_S, "h", 0),
)
"""Each unit, below which size it is used, and with how many decimals."""


def earlier(one_us: int | None, other_us: int | None) -> int | None:
    """The earlier of two deadlines; None is none."""
    if one_us is None or (other_us is not None and other_us < one_us):
        return other_us
    return one_us


def parse_duration(text: str, default_unit: str = "ms") -> int:
    """Microseconds of `200`, `200ms`, `2s`, `1.5 min`, `1e3us`.

    Raises:
        TextError: it is no duration, is finer than a microsecond or beyond `MAX_DURATION_US`.
    """
    stripped = text.strip()
    found = _DURATION.fullmatch(stripped) if len(stripped) <= 64 else None
    if found is None:
        shown = stripped[:64]
        raise TextError(
            f"{shown!r} is not a duration",
            text=shown,
            width=len(shown),
            repair="a number and us, ms, s, min or h: 200ms",
        )
    amount = Decimal(found[1]) * US_PER_UNIT[found[2] or default_unit]
    if amount > MAX_DURATION_US:
        raise TextError(
            f"{stripped!r} is too long a time", text=stripped, width=len(stripped), repair="oo, or a shorter time"
        )
    if amount != amount.to_integral_value():
        raise TextError(f"{stripped!r} is finer than a microsecond", text=stripped, width=len(stripped), repair="1us")
    return int(amount)


def print_duration(duration_us: int) -> str:
    """The shortest exact text: 1_500_000 is `1500ms`, 120_000_000 is `2min`; `parse_duration` reads it back."""
    sign, amount = ("-", -duration_us) if duration_us < 0 else ("", duration_us)
    if amount == 0:
        return "0s"
    unit = next(unit for unit in _PRINTED if amount % US_PER_UNIT[unit] == 0)
    return f"{sign}{amount // US_PER_UNIT[unit]}{unit}"


def print_span(duration_us: float) -> str:
    """A length of time for display, rounded: `80 ms`, `1.2 s`, `3 min`, `5 days`."""
    for unit_us, below_us, unit, decimals in _ROUNDED:
        if round(abs(duration_us) / unit_us, decimals) < below_us / unit_us:
            return f"{duration_us / unit_us:.{decimals}f} {unit}"
    return f"{duration_us / 86_400_000_000:.0f} days"
