"""Reports of platforms about their tracks, and the gate that refuses impossible ones.

A report is a Gaussian over (x, y, vx, vy) at a valid time. It comes from another member, which may be wrong or
malicious: a report is refused, by member and reason, if it is no number or no covariance, of another time, too fast, or
one too many.
"""

from collections import Counter
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from dyknow import US_PER_S
from dyknow.anchoring.links.states import ObjectState

FARTHEST_M: Final = 1e6
FASTEST_M_S: Final = 100.0
LEAST_SD_M: Final = 0.05
MOST_SD_M: Final = 50.0
"""Vaguer than this is no place."""
MOST_SD_M_S: Final = 30.0
EARLY_US: Final = US_PER_S
LATE_US: Final = 10 * US_PER_S
MOST_TRACKS: Final = 128
"""Of one member at a time."""
MOST_REPORTS_S: Final = 2000
LONGEST_NAME: Final = 64


class TrackKey(NamedTuple):
    """A track: the member that follows it, and the member's symbol for it. `life` counts the restarts of the member."""

    unit: str
    symbol: str
    life: int = 0

    def __str__(self) -> str:
        return f"{self.symbol} of {self.unit}"


class TrackReport(NamedTuple):
    """The state of a track.

    Attributes:
        is_anchored: a percept shows it; else it is predicted, which is no evidence.
        has_ended: the member follows it no longer.
    """

    unit: str
    symbol: str
    state: ObjectState
    is_anchored: bool = True
    has_ended: bool = False


class IdentityClaim(NamedTuple):
    """A member's name for one of its tracks.

    Attributes:
        identity: the name that the object has everywhere.
        born_us: since when there is that name.
        since_us: since when the track has it.
    """

    unit: str
    symbol: str
    identity: str
    born_us: int
    since_us: int


@dataclass(slots=True)
class _Budget:
    since_us: int = 0
    count: int = 0


class ReportGate:
    """Refuses what cannot be, and counts it.

    Attributes:
        refused: by member and reason.
    """

    def __init__(self) -> None:
        self.refused = Counter[tuple[str, str]]()
        self._budgets: dict[str, _Budget] = {}

    def refuse(self, unit: str, reason: str) -> None:
        """Count one more."""
        self.refused[unit, reason] += 1

    def passes(self, report: TrackReport, now_us: int) -> bool:
        """Whether a report may be believed at all; `now_us` in federation time."""
        reason = self._fault(report, now_us)
        if reason:
            self.refuse(report.unit, reason)
        return not reason

    def is_affordable(self, unit: str, now_us: int) -> bool:
        """Whether the member has not sent more in this second than anyone needs."""
        budget = self._budgets.setdefault(unit, _Budget(now_us))
        if not 0 <= now_us - budget.since_us < US_PER_S:
            budget.since_us, budget.count = now_us, 0
        budget.count += 1
        if budget.count > MOST_REPORTS_S:
            self.refuse(unit, "too many reports")
            return False
        return True

    def _fault(self, report: TrackReport, now_us: int) -> str:
        if not self.is_affordable(report.unit, now_us):
            return "too many reports in a second"
        if not 0 < len(report.symbol) <= LONGEST_NAME:
            return "no symbol"
        if not now_us - LATE_US <= report.state.valid_us <= now_us + EARLY_US:
            return "another time"
        return "" if report.has_ended else fault_of(report.state)


def fault_of(state: ObjectState) -> str:
    """Why a state cannot be that of an object; nothing if it can."""
    mean, covariance = np.array(state[1:5], dtype=float), np.asarray(state.covariance, dtype=float)
    if covariance.shape != (4, 4) or not (np.isfinite(mean).all() and np.isfinite(covariance).all()):
        return "not a number"
    if np.abs(mean[:2]).max() > FARTHEST_M or np.hypot(*mean[2:]) > FASTEST_M_S:
        return "too far or too fast"
    if not np.allclose(covariance, covariance.T, rtol=1e-6, atol=1e-9) or np.linalg.eigvalsh(covariance)[0] < 0.0:
        return "no covariance"
    if np.sqrt(np.diag(covariance)[:2]).max() > MOST_SD_M:
        return "too vague"
    return ""


def sound(state: ObjectState) -> ObjectState:
    """The state, no surer than anything can be, and with a velocity that is no vaguer than vehicles are fast."""
    covariance = np.array(state.covariance, dtype=float)
    covariance[0, 0] += LEAST_SD_M**2
    covariance[1, 1] += LEAST_SD_M**2
    if covariance[2, 2] > MOST_SD_M_S**2 or covariance[3, 3] > MOST_SD_M_S**2:
        covariance[2:, :2], covariance[:2, 2:] = 0.0, 0.0
        covariance[2:, 2:] = np.diag(np.minimum(np.diag(covariance)[2:], MOST_SD_M_S**2))
    return state._replace(covariance=(covariance + covariance.T) / 2)
