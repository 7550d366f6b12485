"""Who comes and goes, and what each part of a platform makes of it. Times are the node clock."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

from agents.bulletin import alarm_content
from agents.orphans import Orphans
from agents.services import FEDERATION
from dyknow import earlier
from dyknow.errors import Refused
from federation.acts import Act
from federation.clock import Standing
from federation.conversations import is_given_up, is_lost
from federation.deadlines import Deadlines
from federation.directory import Outcome
from federation.exports import ExportEvent
from federation.liveness import NameConflict, PlatformAppeared, PlatformGone, PlatformReturned, PlatformSuspected
from federation.offers import LabelAppeared, LabelGone, ServiceAppeared, ServiceGone
from federation.replicas import PlatformRefused
from federation.transport import Reopen
from reasoning import AlarmEvent

if TYPE_CHECKING:
    from agents.platform import Platform

TWIN_US = 1_000_000
FORGOTTEN_US = 60_000_000
"""How long the monitors over a platform that died are kept, as missing."""


class Membership:
    """Passes what happens in the directory, to clocks and to alarms on to the platform's parts."""

    def __init__(self, platform: "Platform") -> None:
        self._p = platform
        self._orphans = Orphans(platform)
        self._departed: Deadlines[str] = Deadlines()
        self._found: tuple[str, ...] | None = None
        self._standing: dict[str, Standing] = {}
        self._twins: dict[int, int] = {}

    # -- the directory -----------------------------------------------------------------------------------------

    @property
    def found(self) -> tuple[str, ...]:
        """The platforms that offer the federation service, this one included."""
        if self._found is None:
            offering = self._p.directory.search(service=FEDERATION.service.service)
            self._found = tuple(entry.unit for entry in offering)
        return self._found

    def on_directory(self, change: Outcome, now_us: int) -> bool:
        """One event of the directory; False if it is an effect."""
        match change:
            case PlatformAppeared():
                self._appeared(change, now_us)
            case PlatformReturned():
                self._p.interface.peer_appeared(change.unit, change.boot, now_us)
                self._p.exports.receiver_back(change.unit)
                self._p.supply.wake(now_us)
            case PlatformGone():
                self._gone(change, now_us)
            case ServiceAppeared():
                if change.service.service == FEDERATION.service.service and change.unit != self._p.unit:
                    self._present(change.unit, now_us)
            case LabelAppeared():
                if change.unit != self._p.unit:
                    self._p.supply.wake(now_us)
            case NameConflict():
                self._namesake(change)
            case PlatformRefused():
                self._refused(change)
            case Reopen():
                self._p.note(f"opens a new session: {change.why}")
                return False
            case PlatformSuspected() | ServiceGone() | LabelGone():
                pass
            case _:
                return False
        if isinstance(change, ServiceAppeared | ServiceGone) and change.service.service == FEDERATION.service.service:
            self._found = None
        self._p.bulletin.on_directory_change(change, now_us)
        return True

    def _appeared(self, change: PlatformAppeared, now_us: int) -> None:
        unit = change.unit
        if change.kind == "uav":
            for task in self._p.tasks.of(unit):  # it may have asked before it was known what it is
                task.is_part = task.is_part or task.name == "create-multicast"
        self._end_exports(self._p.exports.receiver_appeared(unit, change.boot, now_us), now_us)
        self._p.importer.on_owner(unit, change.boot)
        self._p.clocks.on_appeared(unit, change.boot, now_us)
        self._p.interface.peer_appeared(unit, change.boot, now_us)

    def _present(self, unit: str, now_us: int) -> None:
        """A platform offers the federation service, for the first time or again."""
        self._departed.set(unit, None)
        entry = self._p.directory.entry(unit)
        if entry is None or entry.kind != "uav":
            return
        self._p.monitors.join(unit, self._federation_us(now_us))
        self._judge_clock(unit, now_us)
        self._p.supply.wake(now_us)
        self._p.coordination.on_present(unit, now_us)

    def _gone(self, change: PlatformGone, now_us: int) -> None:
        unit = change.unit
        if change.why == "restarted":
            self._end_exports(self._p.exports.receiver_restarted(unit, now_us), now_us)
        else:
            self._p.exports.receiver_gone(unit, now_us, change.boot)
        self._p.supply.forget(unit)
        self._p.interface.peer_gone(unit, now_us)
        self._p.clocks.on_gone(unit)
        self._standing.pop(unit, None)
        if change.why == "left":
            self._p.monitors.leave(unit)
        else:
            self._p.monitors.doubt(unit, change.why, self._federation_us(now_us))
            self._departed.set(unit, now_us + FORGOTTEN_US)
        self._p.coordination.on_gone(unit, now_us)
        self._p.giving_way.on_gone(unit, now_us)

    def is_twin(self, boot: int, at_us: int) -> bool:
        """Whether another process goes by our name: heard over a second, since an earlier life of ours may echo."""
        if boot == self._p.config.boot:
            return False
        since_us = self._twins.setdefault(boot, at_us)
        return at_us - since_us >= TWIN_US

    def _namesake(self, change: NameConflict) -> None:
        """Two platforms of one name: the one that was there first stays."""
        if change.boot < self._p.config.boot:
            self._p.halt(f"another platform is called {change.unit} already; choose another --unit")
        else:
            self._p.note(f"another platform calls itself {change.unit}, as this one does")

    def _refused(self, change: PlatformRefused) -> None:
        """Two platforms that cannot federate: of two clocks the one that was there first stays."""
        entry = self._p.directory.entry(change.unit)
        if "clock" in change.why and entry is not None and entry.kind == "uav" and change.boot < self._p.config.boot:
            self._p.halt(f"{change.unit} is in this federation already and {change.why}: join with the same clock")
        else:
            self._p.note(f"{change.unit} cannot federate with this platform: {change.why}")

    # -- clocks ------------------------------------------------------------------------------------------------

    def on_clock(self, unit: str, now_us: int) -> bool:
        """A clock was compared: monitors over a peer whose clock is skewed, or not known yet, count it as missing.

        Returns whether that changed.
        """
        known = self._standing.get(unit)
        if known is self._p.clocks.standing(unit) or not self._p.monitors.has_member(unit):
            return False
        if self._p.directory.is_present(unit):
            self._judge_clock(unit, now_us)
        return True

    def _judge_clock(self, unit: str, now_us: int) -> None:
        standing = self._standing[unit] = self._p.clocks.standing(unit)
        if standing in {Standing.SKEWED, Standing.UNKNOWN}:
            self._p.monitors.doubt(unit, f"clock {standing.value}", self._federation_us(now_us))
        else:
            self._p.monitors.join(unit, self._federation_us(now_us))

    def _end_exports(self, events: Iterable[ExportEvent], now_us: int) -> None:
        self._p.federation.on_contracts_ended(self._p.gateway.exporter.on_events(events), now_us)

    # -- conversations that end ------------------------------------------------------------------------------------

    def on_lost(self, act: Act, now_us: int) -> None:
        """Who asked for something is gone. What a person asked for stays; what a platform asked for is adopted or ends."""
        unit, conversation = act.sender.unit, act.conversation_id or ""
        if self._p.bulletin.unsubscribe(unit, conversation) or self._p.inquiries.cancel(conversation, unit):
            return
        self._orphans.on_lost(conversation, now_us)

    def on_cancel(self, act: Act, of_others: bool, now_us: int) -> bool:
        """Somebody ends what was asked for in a conversation; raises Refused if it is another's and must not."""
        unit, conversation = act.sender.unit, act.conversation_id or ""
        if self._p.bulletin.unsubscribe(unit, conversation) or self._p.inquiries.cancel(conversation, unit):
            return True
        task = self._p.tasks.get(conversation)
        if task is not None and task.initiator == unit and is_lost(act):
            self._orphans.on_forgotten(task, now_us)
            return True
        if task is not None and task.initiator != unit:
            if not of_others:
                raise Refused(f"only {task.initiator}, who asked for it, or a command centre may end {conversation}")
            self._p.interface.end(conversation, task.initiator, f"cancelled by {unit}", now_us)
        led = self._p.coordination.led.get(conversation)
        if led is not None and led.leader != self._p.unit:
            raise Refused(f"the task is led by {led.leader} now: cancel it there")
        before = list(self._p.coordination.led)
        is_known = self._p.tasks.cancel(conversation, now_us)
        for ended in before:
            if ended not in self._p.coordination.led and not is_given_up(act):
                self._p.tasks.bury(ended, unit)
        return is_known

    @property
    def deadline_us(self) -> int | None:
        return earlier(self._orphans.deadline_us, self._departed.next_us)

    def on_time(self, now_us: int) -> None:
        self._orphans.on_time(now_us)
        for unit in self._departed.pop_due(now_us):
            self._p.monitors.leave(unit)

    # -- alarms ------------------------------------------------------------------------------------------------

    def on_alarm(self, event: AlarmEvent, now_us: int) -> None:
        """An alarm opened or closed here: note it, tell who wants to know, and the other one it is about; give way."""
        said = alarm_content(event, self._p.unit)
        self._p.alarms.raise_(event, now_us)
        self._p.coordination.on_alarm(event, said, now_us)
        for unit in event.units[1:]:
            if self._p.directory.is_present(unit):
                self._p.interface.tell(unit, said, now_us)
        if event.monitor.endswith("-warn") and self._p.config.avoidance and self._p.coordination.avoids(event.monitor):
            self._p.giving_way.on_alarm(event, now_us)

    def _federation_us(self, now_us: int) -> int:
        return self._p.clock.federation_us(now_us)
