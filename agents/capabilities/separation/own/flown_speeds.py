"""How fast the own vehicle flies: as it is seen, and while it gains speed as its autopilot's parameters have it."""

from collections import deque
from typing import Final

from dyknow.agents.places import Fix
from dyknow.navigation.cruise import CruiseReport
from dyknow.navigation.intents.intent import CLIMB_M_S, DESCENT_M_S, SPEED_M_S

OVER_US: Final = 2_000_000
"""Time between the two speeds whose difference shows whether the vehicle gains speed."""
GAINS_M_S, STEADY_M_S, MOVES_M_S = 0.5, 0.3, 1.0
MOST_UPRIGHT_M_S: Final = 20.0
_KEPT: Final = 0.998
"""The share of the fastest speed seen that is kept with each new position."""


class FlownSpeeds:
    """See the module. Metres per second."""

    def __init__(self) -> None:
        self._seen: deque[tuple[int, float]] = deque()
        self.forget()

    def forget(self) -> None:
        """Forget the speeds: the vehicle is on the ground."""
        self._seen.clear()
        self._steady_m_s = self.fastest_m_s = self._up_m_s = self._down_m_s = 0.0

    def watch(self, fix: Fix) -> None:
        """A new position."""
        seen = self._seen
        seen.append((fix.valid_us, fix.speed_m_s))
        while seen and fix.valid_us - seen[0][0] > OVER_US:
            seen.popleft()
        self.fastest_m_s = max(fix.speed_m_s, _KEPT * self.fastest_m_s)
        self._up_m_s = max(-fix.down_m_s, _KEPT * self._up_m_s)
        self._down_m_s = max(fix.down_m_s, _KEPT * self._down_m_s)
        if fix.speed_m_s > MOVES_M_S and abs(fix.speed_m_s - seen[0][1]) < STEADY_M_S and self._is_long:
            self._steady_m_s = fix.speed_m_s

    @property
    def _is_long(self) -> bool:
        return self._seen[-1][0] - self._seen[0][0] > OVER_US // 2

    def level_m_s(self, cruise: CruiseReport) -> float:
        """Its cruise speed: the last steady speed, or, while it accelerates or stands, that of its parameters."""
        now_m_s, before_m_s = (self._seen[-1][1], self._seen[0][1]) if self._seen else (0.0, 0.0)
        if now_m_s <= MOVES_M_S or now_m_s - before_m_s > GAINS_M_S:
            return max(now_m_s, cruise.speed_m_s or max(self.fastest_m_s, self._steady_m_s) or SPEED_M_S)
        return max(now_m_s, self._steady_m_s or self.fastest_m_s)

    def climb_m_s(self, cruise: CruiseReport) -> float:
        return max(cruise.climb_m_s or CLIMB_M_S, min(MOST_UPRIGHT_M_S, self._up_m_s))

    def descent_m_s(self, cruise: CruiseReport) -> float:
        return max(cruise.descent_m_s or DESCENT_M_S, min(MOST_UPRIGHT_M_S, self._down_m_s))
