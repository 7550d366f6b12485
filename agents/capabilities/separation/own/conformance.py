"""Conformance of the own vehicle to its intent (ASTM F3548: an operational intent is nonconforming otherwise).

The published intent is compared with the position two seconds later. A vehicle that the wind carries off, or that
flies elsewhere by an order unknown to this platform, is off its intent: from then on its intent is its motion alone, an
alarm is open, and others keep away from where it may get.
"""

from collections import deque
from collections.abc import Callable
from math import hypot
from typing import Final

from dyknow.navigation.intents.intent import IntendedPlace, Intent, IntentEnding, IntentSource
from dyknow.navigation.intents.path import STEP_S, FlatOrigin, nominal
from dyknow.reasoning import NONCONFORMING, AlarmEvent

AFTER_US: Final = 2_000_000
"""The age of the intent with which the present position is compared."""
LOOKS: Final = 6
"""How many looks in a row, two a second, decide that it is off its intent, or on it again."""
OFF_M, OFF_SHARE, OFF_UP_M = 8.0, 0.6, 4.0
"""How far off is a contradiction: level, plus that share of the way flown meanwhile; and upright, beyond the heights of the tube."""
_SAME_M: Final = 1.0
_COMPARED: Final = frozenset(
    {IntentSource.ROUTE, IntentSource.ORDER, IntentSource.STATION, IntentSource.MANOEUVRE, IntentSource.HOVER}
)
"""A mission may wait at its items; how a vehicle returns, lands and takes off is the autopilot's own."""


class Conformance:
    """See the module; `on_alarm` takes events, `note` words. Federation time."""

    def __init__(self, unit: str, on_alarm: Callable[[AlarmEvent], None], note: Callable[[str], None]) -> None:
        self._unit, self._raise, self._note = unit, on_alarm, note
        self._published: deque[Intent] = deque()
        self._contrary = 0
        self._open: AlarmEvent | None = None

    def shown(self, intent: Intent) -> Intent:
        """The intent to publish: the given one, or, while the vehicle does not conform to it, its present motion alone."""
        off = self._off(intent)
        self._published.append(intent)
        if intent.is_airborne:
            self._contrary = min(LOOKS, self._contrary + 1) if off else max(0, self._contrary - 1)
        else:
            self._contrary = 0
        if off and self._contrary == LOOKS and self._open is None:
            self._begin(intent, off)
        elif self._open is not None and not self._contrary:
            self._note(f"{self._unit} flies as it has published again")
            self._raise(self._open._replace(event="closed", detected_us=intent.at_us))
            self._open = None
        if self._open is None:
            return intent
        return intent._replace(legs=(), ending=IntentEnding.OPEN, contingency=None)

    def _begin(self, intent: Intent, off: str) -> None:
        self._open = AlarmEvent(
            f"{NONCONFORMING} {self._unit} {intent.at_us}", "opened", NONCONFORMING, (self._unit,), intent.at_us, intent.at_us,
            {"off": off, "source": intent.source.value, "altitude_m": intent.altitude_m},
        )  # fmt: skip
        self._note(f"{self._unit} does not fly as it has published: {off}")
        self._raise(self._open)

    def _off(self, intent: Intent) -> str:
        """How far it is from where it was to be, in words; empty: it is there, or it is unknown."""
        before: Intent | None = None
        while self._published and intent.at_us - self._published[0].at_us >= AFTER_US:
            before = self._published.popleft()
        if before is None or before.source not in _COMPARED or not _has_same_way(before, intent):
            return ""
        origin = FlatOrigin.at(before.latitude_deg, before.longitude_deg)
        at = round((intent.at_us - before.at_us) / 1e6 / STEP_S)
        north_m, east_m, low_m, high_m, radius_m = nominal(before, origin, at + 1)[:, at]
        here_north_m, here_east_m = origin.metres(intent.latitude_deg, intent.longitude_deg)
        off_m = hypot(north_m - here_north_m, east_m - here_east_m)
        if off_m > OFF_M + radius_m + OFF_SHARE * hypot(north_m, east_m):
            return f"it is {off_m:.0f} m from where it was to be by now"
        up_m = max(low_m - intent.altitude_m, intent.altitude_m - high_m)
        return f"it is {up_m:.0f} m higher or lower than it was to be by now" if up_m > OFF_UP_M else ""


def _has_same_way(before: Intent, after: Intent) -> bool:
    """Whether it was to fly to the same place all the time."""
    if before.source is not after.source or before.ending is IntentEnding.OPEN or after.ending is IntentEnding.OPEN:
        return False
    if not before.legs or not after.legs:
        return not before.legs and not after.legs
    origin = FlatOrigin.at(before.latitude_deg, before.longitude_deg)

    def place(leg: IntendedPlace) -> tuple[float, float]:
        return origin.metres(leg.latitude_deg, leg.longitude_deg)

    one, other = before.legs[0], after.legs[0]
    return hypot(*(a - b for a, b in zip(place(one), place(other), strict=True))) < _SAME_M and (
        abs(one.altitude_m - other.altitude_m) < _SAME_M
    )
