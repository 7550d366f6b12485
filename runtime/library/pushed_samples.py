"""Samples that a program pushes into its own platform, checked there: a wrong one ends no thread of the platform."""

from typing import Any, NamedTuple

from dyknow import NO_VALUE, Quality, Value
from dyknow.model.errors import WrongCall
from dyknow.runtime.configuration.instants import instant_us

_LATEST_US = 2**62
_DEEPEST = 8


class PushedSample(NamedTuple):
    """A sample for a source."""

    source: str
    valid_us: int
    value: Value
    quality: Quality


def pushed(source: str, valid_us: int | str, value: Any, quality: Quality, now_us: int) -> PushedSample:
    """The sample that the arguments of a push come to.

    Raises:
        WrongCall: one of them is of another type.
    """
    if not isinstance(source, str):
        raise WrongCall(f"push: a source is called by its name, a text, got {source!r}")
    if isinstance(valid_us, str):
        valid_us = instant_us(valid_us, now_us, option="push: valid_us")
    if isinstance(valid_us, bool) or not isinstance(valid_us, int) or abs(valid_us) > _LATEST_US:
        said = f"push: valid_us is federation time in whole microseconds, `now_us`, or a text such as now; got {valid_us!r}"
        raise WrongCall(said)
    if not isinstance(quality, Quality):
        raise WrongCall(f"push: a quality is a Quality(certainty, covariance), got {quality!r}")
    return PushedSample(source, valid_us, _value(value, 0), quality)


def _value(value: Any, depth: int) -> Value:
    """Numbers, texts, truth values, and tuples of them; None is no value."""
    if value is None or value is NO_VALUE:
        return NO_VALUE
    if isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, tuple | list | frozenset) and depth < _DEEPEST:
        inside = [_value(each, depth + 1) for each in value]
        return frozenset(inside) if isinstance(value, frozenset) else tuple(inside)
    if hasattr(value, "item") and getattr(value, "ndim", 0) == 0:
        return _value(value.item(), depth + 1) if depth < _DEEPEST else NO_VALUE
    raise WrongCall(f"push: a value is a number, a text, a truth value or a tuple of such, got {value!r}")
