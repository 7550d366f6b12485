"""How fast an autopilot flies to places by itself, as its parameters say."""

from typing import NamedTuple


class CruiseReport(NamedTuple):
    """Metres per second, level, up and down; None where the autopilot has not reported it."""

    valid_us: int
    speed_m_s: float | None = None
    climb_m_s: float | None = None
    descent_m_s: float | None = None
