"""Two clocks: the one a federation shares, and how far each peer's node clock is from ours."""

from collections import deque
from enum import Enum
from math import isfinite
from typing import NamedTuple

from dyknow.model.errors import PolicyError

SYNCHRONISED_US = 50_000
CORRECTED_US = 1_000_000
BURST = 8
BURST_RETRY_US = 1_000_000
PERIOD_US, TOGETHER_US = 5_000_000, 200_000
PING_TIMEOUT_US = 1_000_000
DRIFT_PPM = 200
AGREEING = 2
STEP_AFTER = 3


class FederationClock:
    """Federation time = epoch + speed * (node clock - epoch), in whole microseconds (rounded down).

    At speed 1 federation time is the node clock. `wall_us` is the earliest node time at which a federation instant
    has been reached, so `federation_us(wall_us(t)) >= t` always, and a timer set with it never fires early.

    Raises:
        PolicyError: the speed is not a positive finite number.
    """

    __slots__ = ("_denominator", "_numerator", "epoch_us", "speed")

    def __init__(self, epoch_us: int = 0, speed: float = 1.0) -> None:
        if not (isfinite(speed) and speed > 0):
            raise PolicyError(f"a federation's clock runs at a positive speed, not {speed}")
        self.epoch_us, self.speed = epoch_us, speed
        self._numerator, self._denominator = speed.as_integer_ratio()

    def __repr__(self) -> str:
        return f"FederationClock(epoch_us={self.epoch_us}, speed={self.speed})"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, FederationClock):
            return NotImplemented
        return self.agrees(other.epoch_us, other.speed)

    def __hash__(self) -> int:
        return hash((self.epoch_us, self.speed))

    def agrees(self, epoch_us: int, speed: float) -> bool:
        """Whether a platform with this epoch and speed may join: at speed 1 every epoch is the same clock."""
        return speed == self.speed and (speed == 1 or epoch_us == self.epoch_us)

    def federation_us(self, wall_us: int) -> int:
        if self.speed == 1:
            return wall_us
        return self.epoch_us + (wall_us - self.epoch_us) * self._numerator // self._denominator

    def wall_us(self, federation_us: int) -> int:
        if self.speed == 1:
            return federation_us
        return self.epoch_us - (self.epoch_us - federation_us) * self._denominator // self._numerator


class Standing(Enum):
    """The class of a peer by its clock offset."""

    UNKNOWN = "unknown"
    SYNCHRONISED = "synchronised"
    CORRECTED = "corrected"
    SKEWED = "skewed"


class Offset(NamedTuple):
    """A peer's node clock minus ours, +- bound; microseconds of wall time."""

    offset_us: int
    bound_us: int

    @property
    def standing(self) -> Standing:
        worst_us = abs(self.offset_us) + self.bound_us
        if worst_us <= SYNCHRONISED_US:
            return Standing.SYNCHRONISED
        return Standing.CORRECTED if worst_us <= CORRECTED_US else Standing.SKEWED


class _Exchange(NamedTuple):
    """Half the sum and half the round trip of one exchange, doubled so that they stay whole numbers."""

    at_us: int
    twice_offset_us: int
    round_trip_us: int

    def bound_us(self, now_us: int) -> int:
        """Half the round trip, and what two clocks may have drifted apart since."""
        return (self.round_trip_us + 1) // 2 - max(0, now_us - self.at_us) * DRIFT_PPM // -1_000_000

    def agrees(self, other: "_Exchange") -> bool:
        """Whether one true offset explains both, drift between them allowed."""
        drift_us = abs(self.at_us - other.at_us) * DRIFT_PPM // 1_000_000
        apart_us = abs(self.twice_offset_us - other.twice_offset_us)
        return apart_us <= self.round_trip_us + other.round_trip_us + 2 * drift_us + 2


class OffsetEstimator:
    """The clock offset of one peer from four-stamp exchanges.

    We ask at t1, the peer sees it at t2 and answers at t3, we see that at t4 (t1, t4 on our node clock, t2, t3 on
    the peer's): offset = ((t2 - t1) + (t3 - t4)) / 2, bound = half the round trip (t4 - t1) - (t3 - t2). The true
    offset lies within the bound whatever the delays are. Of the last eight exchanges the tightest counts (drift of
    200 ppm since then added to its bound) among those that at least half of them agree with, so no single exchange
    decides; three in a row that contradict the estimate and agree with each other mean that a clock was set.

    The owner steps it: `due(now_us)` says how many exchanges to start.
    """

    __slots__ = ("_answered", "_best", "_contradicting", "_kept", "_next_us", "boot", "offset", "refused")

    def __init__(self, now_us: int) -> None:
        self.boot: int | None = None
        self.offset: Offset | None = None
        self.refused = 0
        self._best: _Exchange | None = None
        self._kept: deque[_Exchange] = deque(maxlen=BURST)
        self._contradicting: list[_Exchange] = []
        self._answered = 0
        self._next_us = now_us

    @property
    def standing(self) -> Standing:
        return Standing.UNKNOWN if self.offset is None else self.offset.standing

    @property
    def deadline_us(self) -> int:
        return self._next_us

    def due(self, now_us: int) -> int:
        """The number of exchanges to start now: the missing ones of eight, each second, then one every five seconds.

        Once the eight are had, one that is due in 200 ms is started with those of other peers.
        """
        missing = BURST - self._answered
        if now_us < (self._next_us if missing > 0 else self._next_us - TOGETHER_US):
            return 0
        self._next_us = now_us + (BURST_RETRY_US if missing > 0 else PERIOD_US)
        return max(1, missing)

    def hurry(self, now_us: int) -> None:
        """Ask at once, as when the peer was met; the known offset stays."""
        self._answered, self._next_us = 0, now_us

    def reset(self, now_us: int) -> None:
        """The peer was restarted or its link was changed: forget its offset."""
        self.boot = self.offset = self._best = None
        self._kept.clear()
        self._contradicting.clear()
        self._answered, self._next_us = 0, now_us

    def on_stamps(self, boot: int, asked_us: int, seen_us: int, answered_us: int, back_us: int) -> None:
        """Take the stamps t1, t2, t3, t4 of one exchange with incarnation `boot` of the peer."""
        round_trip_us = (back_us - asked_us) - (answered_us - seen_us)
        if round_trip_us < 0 or answered_us < seen_us or back_us < asked_us:
            self.refused += 1
            return
        if self.boot != boot:
            self.reset(back_us)
            self.boot = boot
        self._answered += 1
        if self._answered == BURST:
            self._next_us = back_us + PERIOD_US
        found = _Exchange(back_us, (seen_us - asked_us) + (answered_us - back_us), round_trip_us)
        if self._is_step(found):
            self._kept.clear()
            self._kept.extend(self._contradicting)
            self._contradicting.clear()
            self._best = None
        else:
            self._kept.append(found)
        self._choose(back_us)

    def _is_step(self, found: _Exchange) -> bool:
        if self._best is None or found.agrees(self._best):
            self._contradicting.clear()
            return False
        self._contradicting = [other for other in self._contradicting if other.agrees(found)] + [found]
        return len(self._contradicting) >= STEP_AFTER

    def _choose(self, now_us: int) -> None:
        kept = self._kept
        highest = max([one.twice_offset_us - one.round_trip_us for one in kept])
        lowest = min([one.twice_offset_us + one.round_trip_us for one in kept])
        if highest <= lowest and len(kept) >= AGREEING:
            trusted = list(kept)  # one offset explains them all, as nearly always
        else:
            trusted = [
                one
                for one in kept
                if (votes := sum(one.agrees(other) for other in kept)) >= AGREEING and 2 * votes >= len(kept)
            ]
        if trusted:
            best = self._best = min(trusted, key=lambda one: (one.bound_us(now_us), -one.at_us))
            self.offset = Offset(best.twice_offset_us // 2, best.bound_us(now_us) + (best.twice_offset_us & 1))
