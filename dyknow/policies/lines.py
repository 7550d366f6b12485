"""Values on the straight line through two samples: between them they are interpolated, beyond them predicted."""

from dyknow.model.sample import SURE, Quality, Sample, Value, oldest
from dyknow.model.values import NO_VALUE


def interpolate(before: Sample, after: Sample, valid_us: int) -> Value:
    """The value at `valid_us` on the straight line through two samples, component by component.

    `NO_VALUE` where there is no line: a component is not a number, or the arities differ.
    """
    share = (valid_us - before.valid_us) / (after.valid_us - before.valid_us)
    if not isinstance(before.value, tuple):
        return _between(before.value, after.value, share)
    if not isinstance(after.value, tuple) or len(before.value) != len(after.value):
        return NO_VALUE
    components = tuple(_between(a, b, share) for a, b in zip(before.value, after.value, strict=True))
    return NO_VALUE if NO_VALUE in components else components


def between(before: Sample, after: Sample, valid_us: int) -> Quality:
    """The quality of the value that `interpolate` gives; errors of the two samples are taken as independent."""
    one, other = before.quality, after.quality
    if one is SURE and other is SURE:
        return SURE
    certainty, prediction = min(one.certainty, other.certainty), oldest((one.prediction, other.prediction))
    if len(one.covariance) != len(other.covariance):
        return Quality(certainty, max(one, other, key=lambda quality: quality.deviation).covariance, prediction)
    share = (valid_us - before.valid_us) / (after.valid_us - before.valid_us)
    rows = zip(one.covariance, other.covariance, strict=True)
    return Quality(
        certainty,
        tuple(tuple((1 - share) ** 2 * a + share**2 * b for a, b in zip(*row, strict=True)) for row in rows),
        prediction,
    )


def _between(before: Value, after: Value, share: float) -> Value:
    if not _is_number(before) or not _is_number(after):
        return NO_VALUE
    return before + (after - before) * share


def _is_number(value: Value) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
