"""States of objects as they are expected after a time: places move on with the velocity, all else stays (thesis 12.3)."""

from collections.abc import Mapping
from math import cos, degrees, hypot, radians
from typing import Final

from dyknow.model.instants import US_PER_S
from dyknow.model.sample import Predicted, Sample, Value
from dyknow.model.values import NO_VALUE, Sort

EARTH_M: Final = 6_371_008.8
VELOCITY: Final = ("vx_m_s", "vy_m_s")
_AREAS: Final = ("xx_m2", "yy_m2")


def moved_on(sample: Sample, sort: Sort, ahead_us: int) -> Sample | None:
    """The state `ahead_us` later, predicted; a state valid after its arrival stays as it is. None: no place or no
    velocity.

    With `v_sd_m_s`, the standard deviation of the velocity, what is known of the place becomes as much vaguer.
    """
    if sample.quality.prediction is not None and sample.valid_us > sample.available_us:
        return sample
    names = [each.name for each in sort.fields]
    known = dict(zip(names, sample.value, strict=True))
    moved = _moved(known, ahead_us / US_PER_S)
    if not moved:
        return None
    made = sample.quality.prediction or Predicted(sample.valid_us)
    value = tuple(moved.get(name, known[name]) for name in names)
    return Sample(sample.available_us, sample.valid_us + ahead_us, value, sample.quality._replace(prediction=made))


def _moved(known: Mapping[str, Value], ahead_s: float) -> dict[str, float]:
    velocity = [known.get(name, NO_VALUE) for name in VELOCITY]
    if NO_VALUE in velocity:
        return {}
    east_m, north_m = (each * ahead_s for each in velocity)
    moved: dict[str, float] = {}
    for name, by_m in (("x_m", east_m), ("y_m", north_m)):
        if known.get(name, NO_VALUE) is not NO_VALUE:
            moved[name] = known[name] + by_m
    latitude_deg, longitude_deg = (known.get(name, NO_VALUE) for name in ("latitude_deg", "longitude_deg"))
    if NO_VALUE not in (latitude_deg, longitude_deg):
        moved["latitude_deg"] = latitude_deg + degrees(north_m / EARTH_M)
        moved["longitude_deg"] = longitude_deg + degrees(east_m / (EARTH_M * cos(radians(latitude_deg))))
    vaguer_m = known.get("v_sd_m_s", NO_VALUE)
    if moved and vaguer_m is not NO_VALUE:
        vaguer_m *= ahead_s
        moved |= {name: known[name] + vaguer_m**2 for name in _AREAS if known.get(name, NO_VALUE) is not NO_VALUE}
        if known.get("sd_m", NO_VALUE) is not NO_VALUE:
            moved["sd_m"] = hypot(known["sd_m"], vaguer_m)
    return moved
