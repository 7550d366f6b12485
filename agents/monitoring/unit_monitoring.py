"""The monitors of a platform in a federation whose members come, go and have clocks of their own (thesis 9.4.2)."""

from dyknow import earlier
from dyknow.agents.actions import FEDERATION
from dyknow.agents.exchange.import_proxy import ImportProxy
from dyknow.agents.monitoring.monitors import UnitMonitors
from dyknow.agents.part import ClockCompared, Followed, Part, PeerChange
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.federation.members.clock import Standing
from dyknow.federation.members.deadlines import Deadlines
from dyknow.federation.members.liveness import Departure, PlatformGone
from dyknow.federation.members.offers import ServiceAppeared

FORGOTTEN_US = 60_000_000
"""How long the monitors over a platform that died are kept, as missing."""


class UnitMonitoring(Part):
    """Steps the monitors, which live in federation time, and decides over which units there are any.

    A unit that is gone, or whose clock is skewed or not compared yet, counts as missing.

    Args:
        offsets: say how far the clock of a unit can be relied on.
    """

    vital = heeds_samples = True

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._unit, self._clock, self._directory = ports.unit, ports.clock, ports.directory
        self.monitors, self._standing_of = parts[UnitMonitors.of], ports.offsets.standing
        parts[ImportProxy].on_every.append(self.monitors.on_every)
        self._standing: dict[str, Standing] = {}
        self._departed: Deadlines[str] = Deadlines()

    # -- time --------------------------------------------------------------------------------------------------

    @property
    def deadline_us(self) -> int | None:
        due_us, leave_us = self.monitors.deadline_us, self._departed.next_us
        if due_us is None:
            return leave_us
        due_us = self._clock.wall_us(due_us)
        return due_us if leave_us is None else earlier(due_us, leave_us)

    def on_time(self, now_us: int) -> Followed:
        self.monitors.on_time(self._clock.federation_us(now_us))
        gone = self._departed.pop_due(now_us)
        for unit in gone:
            self.monitors.leave(unit)
        return None if gone else ()

    # -- units -------------------------------------------------------------------------------------------------

    def on_peer(self, change: PeerChange, now_us: int) -> None:
        match change:
            case ServiceAppeared(unit, service) if service.service == FEDERATION.service and unit != self._unit:
                self._on_present(unit, now_us)
            case PlatformGone():
                self._on_gone(change, now_us)
            case ClockCompared(unit):
                is_news = self._standing.get(unit) is not self._standing_of(unit)
                if is_news and self.monitors.has_member(unit) and self._directory.is_present(unit):
                    self._judge_clock(unit, now_us)

    def _on_present(self, unit: str, now_us: int) -> None:
        """A platform offers the federation service, for the first time or again."""
        self._departed.set(unit, None)
        entry = self._directory.entry(unit)
        if entry is not None and entry.kind == "uav":
            self.monitors.join(unit, self._clock.federation_us(now_us))
            self._judge_clock(unit, now_us)

    def _on_gone(self, change: PlatformGone, now_us: int) -> None:
        self._standing.pop(change.unit, None)
        if change.why is Departure.LEFT:
            self.monitors.leave(change.unit)
        else:
            self.monitors.suspect(change.unit, change.why, self._clock.federation_us(now_us))
            self._departed.set(change.unit, now_us + FORGOTTEN_US)

    def _judge_clock(self, unit: str, now_us: int) -> None:
        standing = self._standing[unit] = self._standing_of(unit)
        if standing in {Standing.SKEWED, Standing.UNKNOWN}:
            self.monitors.suspect(unit, f"clock {standing.value}", self._clock.federation_us(now_us))
        else:
            self.monitors.join(unit, self._clock.federation_us(now_us))
