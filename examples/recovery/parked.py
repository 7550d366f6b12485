"""A detector of your own, made up: two red cars are parked below; one has a mark on its west side, which is seen from there only."""

from math import atan2, cos, degrees, hypot, radians
from typing import NamedTuple

from dyknow import NO_VALUE, Field, Sample, Sort, Value, computational_unit

ORIGIN_DEG = 55.724, 13.46
"""Of metres east and north: that of the simulated scenarios."""
M_A_DEG = 111_320.0
SEEN_M = 150.0
"""How far away a car is seen, level."""
SIDE_DEG = 60.0
PERCEPT = Sort(
    "parked-percept",
    (
        Field("symbol", "text"), Field("x_m", "m"), Field("y_m", "m"), Field("colour", "text"), Field("mark", "bool"),
        Field("end", "bool"),
    ),
)  # fmt: skip


class Parked(NamedTuple):
    """A car, and from where its mark is seen: degrees from north; None: it has none."""

    x_m: float
    y_m: float
    mark_deg: float | None = None


CARS = {"track1": Parked(96.0, 88.0), "track2": Parked(68.0, 92.0, mark_deg=270.0)}


@computational_unit(PERCEPT, "position", name="ParkedCars")
class ParkedCars:
    """One car with each position of the vehicle, in turn."""

    def __init__(self) -> None:
        self._turn = 0

    def __call__(self, _now_us: int, position: Sample) -> Value:
        if position.value is NO_VALUE:
            return None
        self._turn += 1
        name = list(CARS)[self._turn % len(CARS)]
        car, (latitude_deg, longitude_deg) = CARS[name], position.value
        east_m = (longitude_deg - ORIGIN_DEG[1]) * M_A_DEG * cos(radians(ORIGIN_DEG[0])) - car.x_m
        north_m = (latitude_deg - ORIGIN_DEG[0]) * M_A_DEG - car.y_m
        if hypot(east_m, north_m) > SEEN_M:
            return None
        mark: Value = NO_VALUE
        if car.mark_deg is not None:
            off_deg = (degrees(atan2(east_m, north_m)) - car.mark_deg + 180.0) % 360.0 - 180.0
            mark = True if abs(off_deg) < SIDE_DEG else NO_VALUE
        return name, car.x_m, car.y_m, "red", mark, False
