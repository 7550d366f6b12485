"""Whether a vehicle is heard well enough, in words; reported when that changes and lasts, never in floods.

No socket and no clock: times are arguments, monotonic microseconds.
"""

from typing import Any, NamedTuple

from dyknow.proxies.mavlink.hearing import Hearing
from dyknow.proxies.mavlink.reports import VehicleReports, autopilot_name
from dyknow.proxies.mavlink.requests import Requests

SILENT_US = 3_000_000
_LASTS_US = 2_500_000
"""How long something has to be wrong before it is reported: most of it is over a moment later."""
_ANSWERS_US = 2_000_000
_BURST, _REFILL_US = 4, 10_000_000


class LinkCondition(NamedTuple):
    """Whether all is well, and the vehicle that is heard, or the trouble."""

    ok: bool
    text: str


class VehicleCondition:
    """Follows one vehicle at one endpoint.

    Args:
        hearing: of the endpoint.
        system: the system id that is waited for; None: any.
        component: the component id that is waited for; None: the autopilot's.
    """

    def __init__(self, hearing: Hearing, system: int | None, component: int | None) -> None:
        self._hearing, self._wanted = hearing, (system, component)
        self._met_us: int | None = None
        self._beat_us: int | None = None
        self._position_us: int | None = None
        self._has_fix: bool | None = None
        self._reported: LinkCondition | None = None
        self._wrong_us: int | None = None
        self._budget, self._refilled_us = _BURST, 0

    @property
    def is_heard(self) -> bool:
        """Whether it was ever heard."""
        return self._beat_us is not None

    def on_heartbeat(self, now_us: int) -> bool:
        """A HEARTBEAT of the autopilot; whether the vehicle is thereby met, or met again after silence."""
        is_met = self._beat_us is None or now_us - self._beat_us > SILENT_US
        if is_met:
            self._met_us = now_us
        self._beat_us = now_us
        return is_met

    def on_position(self, now_us: int) -> None:
        """The autopilot says where it is."""
        self._position_us = now_us

    def on_fix(self, *, has_fix: bool) -> None:
        """The satellite receiver says whether it knows where it is."""
        self._has_fix = has_fix

    def on_time(
        self, system: int | None, port: Any, known: VehicleReports, requests: Requests, now_us: int
    ) -> LinkCondition | None:
        """The condition to report now, or None."""
        found = self._now(system, port, known, requests, now_us)
        if found.ok:
            self._wrong_us = None
        elif self._wrong_us is None:
            self._wrong_us = now_us
        if now_us - self._refilled_us >= _REFILL_US:
            self._budget, self._refilled_us = min(self._budget + 1, _BURST), now_us
        lasts = self._wrong_us is None or now_us - self._wrong_us >= _LASTS_US
        if found == self._reported or not lasts or not self._budget:
            return None
        self._budget -= 1
        self._reported = found
        return found

    def _now(
        self, system: int | None, port: Any, known: VehicleReports, requests: Requests, now_us: int
    ) -> LinkCondition:
        endpoint, now_s = self._hearing.endpoint, now_us / 1e6
        if port.problem:
            return LinkCondition(False, f"{endpoint} is not open: {port.problem}; it is tried again every second")
        if system is None or self._beat_us is None:
            return LinkCondition(False, self._hearing.absence(*self._wanted, now_s))
        if now_us - self._beat_us > SILENT_US:
            return LinkCondition(False, f"system {system} is silent at {endpoint}")
        name = f"system {system}, {autopilot_name(known.autopilot, known.vehicle_type)}"
        is_placed = self._position_us is not None and now_us - self._position_us <= SILENT_US
        if self._has_fix is False:
            return LinkCondition(False, f"{name}: position without GPS" if is_placed else f"hears {name}, no GPS fix")
        if not is_placed:
            return LinkCondition(False, f"hears {name}: {self._why_no_position(system, port, requests, now_us)}")
        others = [str(each) for each in self._hearing.systems(now_s) if each not in port.taken]
        more = f"; system{'s' if len(others) > 1 else ''} {', '.join(others)} there too (--sysid)" if others else ""
        return LinkCondition(True, f"hears {name}, MAVLink {port.version(system)}{more}")

    def _why_no_position(self, system: int, port: Any, requests: Requests, now_us: int) -> str:
        if requests.is_answered or self._met_us is None or now_us - self._met_us < _ANSWERS_US:
            return "no position yet"
        if self._hearing.is_signed(system) and not port.has_key:
            return "no answer to requests; its frames are signed, give its key (--signing-key)"
        return f"no position, no answer to requests in MAVLink {port.version(system)}"
