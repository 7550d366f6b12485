"""Instants as users type them, and as they read them."""

import re
from datetime import timedelta

from dyknow.documents.durations import duration_us
from dyknow.model.errors import WrongCall
from dyknow.model.instants import EPOCH, iso_instant


def instant_us(text: str, now_us: int, *, option: str) -> int:
    """An instant: ISO 8601, microseconds since the epoch, `now`, or relative to now (`-10s`, `0s`, `+2s`).

    A date without a zone is UTC. Raises WrongCall if the text is none of these.
    """
    given = str(text).strip()
    if given == "now":
        return now_us
    if re.fullmatch(r"[0-9]+", given):
        return int(given)
    if given[:1] in {"-", "+"}:
        if re.fullmatch(r"[0-9.]+", given[1:]):
            raise WrongCall(f"{option}: {text!r} has no unit; say {given}ms or {given}s.")
        offset = duration_us(given[1:], option=option)
        return now_us - offset if given[0] == "-" else now_us + offset
    if re.fullmatch(r"[0.]+[a-z]+", given):
        return now_us + duration_us(given, option=option)
    try:
        return iso_instant(given)
    except (ValueError, OverflowError):
        raise WrongCall(
            f"{option}: {text!r} is not an instant; write -10s (ten seconds ago), an ISO 8601 time such as "
            "2026-05-01T12:00:00Z, or microseconds since 1970-01-01."
        ) from None


def clock_time(instant: int) -> str:
    """The time of day of an instant, UTC, to the millisecond: `12:00:01.250`."""
    return (EPOCH + timedelta(microseconds=instant)).strftime("%H:%M:%S.%f")[:-3]
