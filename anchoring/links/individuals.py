"""The motion of one object, learnt while it is seen: speed, acceleration and turn habits.

Speed s and turn rate r of an individual are each taken for a mean-reverting process: after t seconds the expectation is
mean + (now - mean) rho^t, where rho, the correlation over one second, comes from the variance V and the mean square D of
the changes over one second: D = 2 V (1 - rho). Older observations are forgotten with the time constant `MEMORY_S`.
"""

from collections import Counter
from math import atan2, exp, pi
from typing import Final

from dyknow import US_PER_S
from dyknow.anchoring.links.states import ObjectState

MEMORY_S: Final = 60.0
STRIDE_US: Final = US_PER_S
"""Changes are taken over this time."""
LEAST_S: Final = 5.0
"""No habit is known from less."""
_SLOW_M_S: Final = 1.0
_TURNS: Final = frozenset({"left", "right", "straight", "uturn"})


class Habit:
    """A quantity of one individual that reverts to its mean.

    Attributes:
        mean: over what is remembered.
        seconds: how much is remembered.
    """

    def __init__(self, prior_deviation: float) -> None:
        self.mean, self.seconds = 0.0, 0.0
        self._variance = prior_deviation * prior_deviation
        self._changes = 0.0
        self._last: float | None = None

    def observe(self, value: float, seconds: float) -> None:
        """One value; `seconds` after the one before."""
        kept = exp(-seconds / MEMORY_S)
        self.seconds = self.seconds * kept + seconds
        share = min(1.0, seconds / self.seconds)
        apart = value - self.mean
        self.mean += share * apart
        self._variance += share * (apart * apart * (1.0 - share) - self._variance)
        if self._last is not None:
            change = value - self._last
            self._changes += share * (change * change / seconds - self._changes)
        self._last = value

    def pause(self) -> None:
        """The next value does not continue the last one."""
        self._last = None

    @property
    def latest(self) -> float:
        """The value observed last; the mean after a pause."""
        return self.mean if self._last is None else self._last

    @property
    def mean_square(self) -> float:
        """0 before anything is known."""
        return self.mean * self.mean + self._variance if self.seconds > 0.0 else 0.0

    @property
    def deviation(self) -> float:
        return float(self._variance**0.5)

    @property
    def correlation(self) -> float:
        """Over one second, between 0 and 1."""
        if self._variance <= 0.0:
            return 1.0
        return min(1.0, max(0.0, 1.0 - self._changes / (2.0 * self._variance)))

    def after(self, now: float, seconds: float) -> float:
        """The expectation that much later."""
        return self.mean + (now - self.mean) * float(self.correlation**seconds)


class Individual:
    """The motion model of one object.

    Args:
        of_all: the speed of all objects of its type; its usual speed until its own is known.

    Attributes:
        speed: metres per second.
        turn_rate: radians per second, to the left positive.
        turns: how often it went which way at crossings, by the name of the way: left, straight, right.
    """

    def __init__(self, of_all: Habit | None = None) -> None:
        self.speed, self.turn_rate, self._of_all = Habit(5.0), Habit(0.2), of_all
        self.turns = Counter[str]()
        self._last: ObjectState | None = None
        self._turned_us: int | None = None

    @property
    def is_known(self) -> bool:
        """Whether it was seen for long enough to have habits."""
        return self.speed.seconds >= LEAST_S

    @property
    def square_speed(self) -> float:
        """The mean of the square of how fast it is, m^2/s^2; 0: it is not known."""
        own = self.speed.mean_square
        return own if self.is_known or self._of_all is None else max(own, self._of_all.mean_square)

    def observe(self, state: ObjectState) -> None:
        """One state of it while it is seen; states that follow too closely are skipped."""
        turned_us, turn = state.attributes.get("turned_us"), state.attributes.get("turn")
        if isinstance(turn, str) and turn in _TURNS and isinstance(turned_us, int) and turned_us != self._turned_us:
            self._turned_us = turned_us
            self.turns[turn] += 1
        last = self._last
        if last is not None and state.valid_us - last.valid_us < STRIDE_US:
            return
        self._last = state
        if last is None:
            return
        seconds = (state.valid_us - last.valid_us) / US_PER_S
        self.speed.observe(state.speed_m_s, seconds)
        if self._of_all is not None:
            self._of_all.observe(state.speed_m_s, seconds)
        if min(state.speed_m_s, last.speed_m_s) > _SLOW_M_S:
            turned = _heading(state) - _heading(last)
            self.turn_rate.observe(((turned + pi) % (2.0 * pi) - pi) / seconds, seconds)

    def pause(self) -> None:
        """It is no longer seen: the next state does not continue the last one."""
        self._last = None
        self.speed.pause()
        self.turn_rate.pause()


def _heading(state: ObjectState) -> float:
    return atan2(state.vy_m_s, state.vx_m_s)
