"""The unit of kinds.kpl."""

from typing import Any

from dyknow import Sample, computational_unit


@computational_unit("vehicle", "world", "vehicle", name="Averaged", needs_all=False)
def averaged(_now_us: int, world: Sample, before: Sample | None) -> tuple[Any, ...]:
    """The object below, with the mean of the lengths that were measured until now."""
    symbol, x_m, y_m = world.value[:3]
    length_m, samples = world.value[-2], 0
    if before is not None:
        mean_m, samples = before.value[3:5]
        length_m = (samples * mean_m + length_m) / (samples + 1)
    return symbol, x_m, y_m, length_m, samples + 1, False
