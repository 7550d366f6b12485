"""When a vehicle's own time was, on our clock.

A vehicle stamps its messages with the time since it booted. The offset to our clock is the smallest difference
(arrival - device time) of the last four seconds: delays only ever add, so the quickest message is the best witness, and the
window is short enough to follow a clock that stops for a moment. A clock that runs slow or fast (a simulator that is too
busy does) is followed by its rate: the slope of the smallest differences of the last half minute. Valid time = device
time + offset; it never lies after the arrival.

A single stamp that leaps is not believed. Three in a row that agree with each other are a reboot (or a clock that was
set), and the estimate starts again.

`driven`: for a vehicle whose clock we set (a simulated one) SYSTEM_TIME states federation time exactly, and is used as
it is. A real vehicle's UTC is not: nothing says that it agrees with the clock of the federation.
"""

from collections import deque
from collections.abc import Sequence
from itertools import pairwise

_PIECE_US = 500_000
_PIECES = 8
"""In these of the device's time the smallest difference is looked for."""
_LONG_PIECES = 60
_LEAST_LONG = 30
"""From so many pieces on the rate is known."""
_NOTED = 0.004
"""A rate is worth a word if it differs so much from ours, or from the one before."""
_LEAST_SLOPE, _MOST_SLOPE = 0.001, 0.05
"""Smaller slopes are those of crystals and of delays; greater ones are of no clock."""
_LEAP_US = 1_000_000
_WITNESSES = 3
_EPOCH_STAMP_US = 10**15
"""Stamps above this count from 1970 (the year 2001), those below from the boot."""


class DeviceClock:
    def __init__(self, *, driven: bool = False) -> None:
        self._driven = driven
        self.reboots = 0
        self._pieces: deque[tuple[int, int]] = deque(maxlen=_LONG_PIECES)
        self._slope = 0.0
        self._told = 1.0
        self._last_us = 0
        self._suspect: tuple[int, int] | None = None
        self._unix_us: int | None = None

    def on_system_time(self, unix_us: int, boot_us: int) -> None:
        """SYSTEM_TIME: the vehicle's idea of UTC (0: none) at its time since boot."""
        if unix_us > _EPOCH_STAMP_US:
            self._unix_us = unix_us - boot_us

    def valid_us(self, device_us: int | None, arrival_us: int, *, witness: bool = True) -> int | None:
        """Our time of a device stamp that arrived at `arrival_us`; the arrival where there is none; None: disbelieved.

        `witness`: the stamp is the moment of sending, so the clock can be learned from it; another stamp is only
        translated.
        """
        if device_us is None:
            return arrival_us
        if device_us > _EPOCH_STAMP_US:
            if self._driven:
                return device_us
            if self._unix_us is None:
                return arrival_us
            device_us -= self._unix_us
        if not witness:
            return arrival_us if not self._pieces else min(arrival_us, device_us + self._ahead_us(device_us))
        found_us = arrival_us - device_us
        if not self._pieces:
            self._restart(device_us, found_us)
        elif device_us < self._last_us - _LEAP_US or found_us < self._best_us(device_us) - _LEAP_US:
            return self._leapt(device_us, found_us, arrival_us)
        self._suspect = None
        self._last_us = max(self._last_us, device_us)
        self._witness(device_us, found_us)
        return min(arrival_us, device_us + self._ahead_us(device_us))

    @property
    def rate(self) -> float:
        """How many seconds the device's clock runs in one of ours; 1.0 while that is not known to differ."""
        return 1.0 / (1.0 + self._slope)

    @property
    def words(self) -> str:
        """A note on its rate; empty where it runs as ours."""
        return f"its clock runs at {self._told:.3f}" if abs(self._told - 1.0) > _NOTED else ""

    def _witness(self, device_us: int, found_us: int) -> None:
        """Keep the smallest difference of each piece of the device's time; a piece that is over may change the rate."""
        pieces = self._pieces
        if device_us // _PIECE_US > pieces[-1][0] // _PIECE_US:
            pieces.append((device_us, found_us))
            self._slope = _slope(pieces)
            if abs(self.rate - self._told) > _NOTED:
                self._told = self.rate
        elif found_us < pieces[-1][1]:
            pieces[-1] = (device_us, found_us)

    def _ahead_us(self, device_us: int) -> int:
        """How far our clock is ahead of the device's."""
        return self._unix_us if self._driven and self._unix_us is not None else self._best_us(device_us)

    def _best_us(self, device_us: int) -> int:
        since_us = device_us - _PIECES * _PIECE_US
        found = [
            each_us + round(self._slope * (device_us - at_us)) for at_us, each_us in self._pieces if at_us >= since_us
        ]
        return min(found, default=self._pieces[-1][1])

    def _restart(self, device_us: int, found_us: int) -> None:
        self._pieces.clear()
        self._pieces.append((device_us, found_us))
        self._slope = 0.0
        self._last_us, self._suspect = device_us, None

    def _leapt(self, device_us: int, found_us: int, arrival_us: int) -> int | None:
        last_us, count = self._suspect or (found_us, 0)
        agreeing = count + 1 if abs(found_us - last_us) <= _LEAP_US else 1
        self._suspect = (found_us, agreeing)
        if agreeing < _WITNESSES:
            return None
        self.reboots += 1
        self._unix_us = None
        self._restart(device_us, found_us)
        return arrival_us


def _slope(pieces: Sequence[tuple[int, int]]) -> float:
    """How fast the smallest differences grow: of the edges of their lower hull the one that lies over the middle."""
    if len(pieces) < _LEAST_LONG:
        return 0.0
    hull: list[tuple[int, int]] = []
    for x, y in pieces:
        while len(hull) > 1 and (hull[-1][1] - hull[-2][1]) * (x - hull[-2][0]) >= (y - hull[-2][1]) * (
            hull[-1][0] - hull[-2][0]
        ):
            hull.pop()
        hull.append((x, y))
    middle = (pieces[0][0] + pieces[-1][0]) // 2
    (x0, y0), (x1, y1) = next(edge for edge in pairwise(hull) if edge[1][0] >= middle)
    slope = (y1 - y0) / (x1 - x0)
    return slope if _LEAST_SLOPE <= abs(slope) <= _MOST_SLOPE else 0.0
