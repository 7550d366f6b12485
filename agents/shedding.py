"""Load shedding: an overloaded platform does less, by declared importance, and reports it.

On an overloaded machine every message makes the others later, until nothing is in time. So a platform whose thread
waits for a processor sends its streams less often, and looks at its monitors less often: the least important first.
Each message of samples states how often they come; `ls` shows it as a condition. When the load ends all is as declared.
"""

from collections.abc import Iterable
from typing import Final

from dyknow.agents.effects import Pressed
from dyknow.agents.exchange.export_proxy import ExportProxy
from dyknow.agents.exchange.options import SheddingOptions
from dyknow.agents.exchange.subscription_keeper import SubscriptionKeeper
from dyknow.agents.monitoring.monitors import UnitMonitors
from dyknow.agents.part import Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.federation.messages.descriptions import ConditionEntry
from dyknow.reasoning import AlarmEvent

EVERY: Final = (1, 2, 8)
"""By level: a stream of importance 1 has each sample sent, each second one, each eighth. Monitors with half of the samples are fresh as
before; with less they are unknown, and say so."""
TOO_MUCH: Final = (0.30, 0.40)
ENOUGH: Final = (0.12, 0.18)
"""Parts of the time without a processor, by level: above the one less is done; below the other, of the level before, more."""
HARDER_US: Final = 2_000_000
"""Time between two steps down: the effect of the first must show before the second."""
EASIER_US: Final = 2_500_000
EASIER_MOST_US: Final = 40_000_000
"""How long there must be time before more is done again; it doubles when that was too early."""
TOLD_US: Final = 5_000_000
"""How long the condition is shown after its end, so that it is not withdrawn and renewed all the time."""


class Shedding(Part):
    """See the module. Times are the node clock.

    Attributes:
        level: 0 while all is done as declared.
    """

    takes = {Pressed: "on_pressed"}  # noqa: RUF012  (a declaration)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._may_shed = ports.config.options[SheddingOptions].shedding
        self._exporter, self._monitors = parts[ExportProxy.of], parts[UnitMonitors.of]
        self._keeper = parts[SubscriptionKeeper]
        self._directory, self._note, self._offer = ports.directory, ports.note, ports.offer
        self._alarms: set[str] = set()
        self.level = 0
        self._changed_us = self._eased_us = 0
        self._part = 0.0
        self._calm_us: int | None = None
        self._easier_us = EASIER_US
        self._shown: ConditionEntry | None = None

    def conditions(self) -> Iterable[ConditionEntry]:
        return () if self._shown is None else (self._shown,)

    def on_pressed(self, event: Pressed, now_us: int) -> None:
        """Take the process' measurement of its load; it comes twice a second while the load is high."""
        if not self._may_shed:
            return
        self._part = event.part
        self._judge(now_us)
        if self.level < len(TOO_MUCH) and event.part > TOO_MUCH[self.level] and now_us >= self._changed_us + HARDER_US:
            if self.level == 0 and now_us < self._eased_us + 4 * self._easier_us:
                self._easier_us = min(2 * self._easier_us, EASIER_MOST_US)
            self._set(self.level + 1, now_us)

    def _judge(self, now_us: int) -> None:
        """Whether there has been time for more, and since when."""
        is_calm = self.level > 0 and self._part <= ENOUGH[self.level - 1]
        self._calm_us = None if not is_calm else now_us if self._calm_us is None else self._calm_us

    @property
    def deadline_us(self) -> int | None:
        if self.level:
            return None if self._calm_us is None else max(self._calm_us, self._changed_us) + self._pause_us
        return None if self._shown is None else self._changed_us + TOLD_US

    @property
    def _pause_us(self) -> int:
        """From the worst the way back is never longer."""
        return self._easier_us if self.level == 1 else 2 * EASIER_US

    def on_time(self, now_us: int) -> None:
        """Do more again; withdraw the condition."""
        due_us = self.deadline_us
        if due_us is None or now_us < due_us:
            return
        if self.level:
            self._set(self.level - 1, now_us)
            self._eased_us = now_us
        else:
            self._shown = None
            self._offer(now_us)

    def on_alarm(self, event: AlarmEvent, now_us: int) -> None:  # noqa: ARG002  (as every part)
        """While an alarm is open here nothing is shed that monitors cannot do without."""
        if event.event == "opened":
            self._alarms.add(event.id)
        else:
            self._alarms.discard(event.id)
        self._shed()

    def _shed(self) -> None:
        every = EVERY[min(self.level, 1) if self._alarms else self.level]
        if every != self._exporter.shed:
            self._exporter.shed = every
            self._monitors.shed(every)

    def _set(self, level: int, now_us: int) -> None:
        self.level, self._changed_us, self._calm_us = level, now_us, None
        self._judge(now_us)
        self._shed()
        self._keeper.patience = 1 + 4 * level
        self._directory.is_busy = level > 0
        if level and self._shown is None:
            self._shown = ConditionEntry(
                text="too busy: streams are sent, and monitors looked at, less often", since_us=now_us
            )
            self._offer(now_us)
        omitted = self._exporter.omitted.total()
        self._note(
            f"too busy: of {self._exporter.shed} samples one is sent"
            if level
            else f"no longer too busy: all samples are sent; {omitted} were left out so far"
        )
