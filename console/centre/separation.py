"""How far two platforms are from each other, from their federated streams."""

from dataclasses import dataclass, field

from navigation.geodesy import distance_m

POSITION, ALTITUDE = "heli-position", "heli-altitude"
_KEPT = 200


@dataclass(slots=True)
class Separation:
    """3-D distance in metres of two units, at every valid time for which both have a position."""

    units: tuple[str, str]
    smallest_m: float | None = None
    latest_m: float | None = None
    latest_us: int = 0
    _seen: dict[int, dict[tuple[str, str], tuple[float, ...]]] = field(default_factory=dict)

    def on_sample(self, unit: str, label: str, valid_us: int, value: tuple[float, ...]) -> None:
        """Take a sample; late ones count, too."""
        if unit not in self.units or label not in {POSITION, ALTITUDE}:
            return
        known = self._seen.setdefault(valid_us, {})
        known[unit, label] = value
        if len(known) == 4:
            del self._seen[valid_us]
            self._measured(valid_us, known)
        while len(self._seen) > _KEPT:
            del self._seen[min(self._seen)]

    def _measured(self, valid_us: int, known: dict[tuple[str, str], tuple[float, ...]]) -> None:
        one, other = self.units
        (latitude_a, longitude_a), (latitude_b, longitude_b) = known[one, POSITION], known[other, POSITION]
        up_m = known[one, ALTITUDE][0] - known[other, ALTITUDE][0]
        apart_m = distance_m(latitude_a, longitude_a, latitude_b, longitude_b, up_m)
        if valid_us > self.latest_us:
            self.latest_us, self.latest_m = valid_us, apart_m
        if self.smallest_m is None or apart_m < self.smallest_m:
            self.smallest_m = apart_m
