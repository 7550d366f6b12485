"""Durations as users write them, in texts and on the command line."""

from typing import Final

from dyknow.model.errors import TextError, WrongCall
from dyknow.model.instants import US_PER_UNIT, parse_duration, print_span

SHORTEST_US: Final = 1_000
"""The least that a period or a limit of users may be."""


def duration_us(text: str, *, option: str, least_us: int = 0) -> int:
    """A duration such as `200ms`, `5s`, `1.5min`, of at least `least_us`.

    Raises:
        WrongCall: if the text is no duration, has no unit, or is too short; `option` names the place.
    """
    given = text.strip() if isinstance(text, str) else f"{type(text).__name__} {text!r}"
    try:
        duration = parse_duration(given)
    except TextError as wrong:
        remedy = f"write a number and a unit, as in 200ms, 5s, 1.5min (units: {', '.join(US_PER_UNIT)})"
        raise WrongCall(f"{option}: {wrong.message}; {remedy}.") from None
    if given[-1].isdigit():
        raise WrongCall(f"{option}: {text!r} has no unit; say {given}ms or {given}s.")
    if duration < least_us:
        raise WrongCall(
            f"{option}: {text} is too short; write {print_span(least_us).replace(' ', '')} or more, as in 5s."
        )
    return duration
