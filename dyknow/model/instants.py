"""Durations and instants as users write them, and the integer microseconds they stand for.

Instants and durations are `int` microseconds everywhere; nothing is rounded, so a text finer than that is refused.
"""

import re
from datetime import UTC, datetime, timedelta
from decimal import Decimal

from dyknow.model.errors import TextError

US_PER_MS = 1_000
US_PER_S = 1_000_000
US_PER_UNIT = {"us": 1, "ms": US_PER_MS, "s": US_PER_S, "min": 60 * US_PER_S, "h": 3_600 * US_PER_S}
MAX_DURATION_US = 2**62
"""Far beyond any clock, and small enough that sums of durations stay 64-bit on the wire."""
LATEST_US = 60_000_000_000_000_000
"""Of an instant that others say, before or after the epoch: the years 69 to 3871, which dates hold, and sums in 64 bits."""
LATEST_S = LATEST_US / US_PER_S

_DURATION = re.compile(r"([0-9]{1,20}(?:\.[0-9]{1,20})?(?:[eE][+-]?[0-9]{1,2})?)\s?(us|ms|s|min|h)?")
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_PRINTED = ("h", "min", "s", "ms", "us")
_ROUNDED = (
    (1, 1_000, "us", 0),
    (US_PER_MS, US_PER_S, "ms", 0),
    (US_PER_S, 100 * US_PER_S, "s", 1),
    (60 * US_PER_S, 6_000 * US_PER_S, "min", 0),
    (3_600 * US_PER_S, 360_000 * US_PER_S, "h", 0),
)
"""Each unit, below which size it is used, and with how many decimals."""


class RelativeInstant(int):
    """Microseconds from the moment of a declaration on: an instant that is not known yet. It equals no number."""

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, RelativeInstant) and int(self) == int(other)

    def __ne__(self, other: object) -> bool:
        return not self == other

    def __hash__(self) -> int:
        return hash((RelativeInstant, int(self)))

    def at(self, now_us: int) -> int:
        """The instant, for a declaration at `now_us`; none is before the epoch."""
        return max(0, now_us + int(self))


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


def parse_instant(text: str) -> int:
    """Microseconds since the epoch of `200` (milliseconds), `2s` or `"2026-11-22T20:00:00Z"`; of `now`, `+5s`, `-10s` the offset.

    ISO 8601 stands in quotes; without a zone it is UTC.

    Raises:
        TextError: it is none of these.
    """
    if text == "now":
        return RelativeInstant(0)
    if text[:1] in {"+", "-"}:
        return RelativeInstant(parse_duration(text[1:]) * (-1 if text[0] == "-" else 1))
    try:
        return iso_instant(text[1:-1]) if text[:1] == '"' else parse_duration(text)
    except (ValueError, OverflowError, TextError):
        repair = 'now, +5s, "2026-11-22T20:00:00Z", or ms since 1970'
        raise TextError(f"{text} is not an instant", text=text, width=len(text), repair=repair) from None


def iso_instant(text: str) -> int:
    """Microseconds since the epoch of an ISO 8601 time, UTC where it names no zone; raises ValueError, OverflowError."""
    when = datetime.fromisoformat(text)
    if (instant := ((when if when.tzinfo else when.replace(tzinfo=UTC)) - EPOCH) // timedelta(microseconds=1)) < 0:
        raise ValueError(text)
    return instant


def print_instant(instant: int) -> str:
    """An instant of KPL as it is typed: an offset as `now` or `+5s`, another in milliseconds; `parse_instant` reads it back."""
    if isinstance(instant, RelativeInstant):
        return f"{'+' if instant > 0 else ''}{print_duration(int(instant))}" if int(instant) else "now"
    return f"{instant}us" if instant % US_PER_MS else f"{instant // US_PER_MS}"


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
