"""Computational units of the examples: cars on a road, positions in metres along it."""

from dyknow import Quality, Sample, computational_unit


@computational_unit("distance", "pos", "pos", name="Distance")
def distance(_now_us: int, one: Sample, other: Sample) -> float | None:
    """Metres from one to the other; nothing while the position of one of them is older."""
    return abs(one.value - other.value) if one.valid_us == other.valid_us else None


@computational_unit("pos", "percept", name="Seen", samplewise=True)
def seen(now_us: int, percept: Sample) -> Sample:
    """What a camera sees, (position, how sure it is), as a position that is so certain."""
    position_m, certainty = percept.value
    return Sample(now_us, percept.valid_us, position_m, Quality(certainty))
