"""When a vehicle's own time was, on our clock.

A vehicle stamps its messages with the time since it booted. The offset to our clock is the smallest difference
(arrival - device time) of the last minute: delays only ever add, so the quickest message is the best witness, and the
window lets the estimate follow a drifting crystal. Valid time = device time + offset; it never lies after the arrival.

A single stamp that leaps is not believed. Three in a row that agree with each other are a reboot (or a clock that was
set), and the estimate starts again.

`driven`: for a vehicle whose clock we set (a simulated one) SYSTEM_TIME states federation time exactly, and is used as
it is. A real vehicle's UTC is not: nothing says that it agrees with the clock of the federation.
"""

_WINDOW_US = 30_000_000
_LEAP_US = 1_000_000
_WITNESSES = 3
_EPOCH_STAMP_US = 10**15
"""Stamps above this count from 1970 (the year 2001), those below from the boot."""


class DeviceClock:
    def __init__(self, *, driven: bool = False) -> None:
        self._driven = driven
        self.reboots = 0
        self._offset_us: int | None = None
        self._before_us: int | None = None
        self._window_from_us = 0
        self._last_us = 0
        self._suspect: tuple[int, int] | None = None
        self._unix_us: int | None = None

    def on_system_time(self, unix_us: int, boot_us: int) -> None:
        """SYSTEM_TIME: the vehicle's idea of UTC (0: none) at its time since boot."""
        if unix_us > _EPOCH_STAMP_US:
            self._unix_us = unix_us - boot_us

    def valid_us(self, device_us: int | None, arrival_us: int, *, witness: bool = True) -> int | None:
        """Our time of a device stamp that arrived at `arrival_us`; the arrival where there is none; None: disbelieved.

        `witness`: the stamp is the moment of sending, so the clock can be learned from it; one that is not is only
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
            return arrival_us if self._offset_us is None else min(arrival_us, device_us + self._ahead_us)
        found_us = arrival_us - device_us
        if self._offset_us is None:
            self._restart(device_us, found_us, arrival_us)
        elif device_us < self._last_us - _LEAP_US or found_us < self._best_us - _LEAP_US:
            return self._leapt(device_us, found_us, arrival_us)
        self._suspect = None
        self._last_us = max(self._last_us, device_us)
        if arrival_us >= self._window_from_us + _WINDOW_US:
            self._before_us, self._offset_us, self._window_from_us = self._offset_us, found_us, arrival_us
        elif self._offset_us is None or found_us < self._offset_us:
            self._offset_us = found_us
        return device_us + self._ahead_us

    @property
    def _ahead_us(self) -> int:
        """How far our clock is ahead of the device's."""
        return self._unix_us if self._driven and self._unix_us is not None else self._best_us

    @property
    def _best_us(self) -> int:
        known = [each for each in (self._offset_us, self._before_us) if each is not None]
        return min(known)

    def _restart(self, device_us: int, found_us: int, arrival_us: int) -> None:
        self._offset_us, self._before_us, self._window_from_us = found_us, None, arrival_us
        self._last_us, self._suspect = device_us, None

    def _leapt(self, device_us: int, found_us: int, arrival_us: int) -> int | None:
        last_us, count = self._suspect or (found_us, 0)
        agreeing = count + 1 if abs(found_us - last_us) <= _LEAP_US else 1
        self._suspect = (found_us, agreeing)
        if agreeing < _WITNESSES:
            return None
        self.reboots += 1
        self._unix_us = None
        self._restart(device_us, found_us, arrival_us)
        return arrival_us
