"""Computational units of cars.kpl: positions along a road in metres, speeds in metres per second."""

from dyknow import Sample, computational_unit


@computational_unit("speed", "pos")
class SpeedEst:
    """Distance over time between the last two positions; nothing before there are two."""

    def __init__(self) -> None:
        self._last: Sample | None = None

    def __call__(self, _now_us: int, pos: Sample) -> float | None:
        last, self._last = self._last, pos
        if last is None or pos.valid_us <= last.valid_us:
            return None
        return (pos.value - last.value) / (pos.valid_us - last.valid_us) * 1e6
