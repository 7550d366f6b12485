"""Keeping the inputs of this platform's monitors alive: whoever lacks a stream asks for it (thesis 9.4.1).

The leader of a task has streams set up at the start; afterwards every platform asks for what does not come: from a
newcomer, after a cut, after a restart. What is needed no more is asked for no more. Times are the node clock.
"""

from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field

from agents.context import Context
from agents.monitoring import Needs
from dyknow import US_PER_S
from federation.acts import Act, Performative
from federation.contents import Content, CreateMulticast

FIRST_US = 250_000
CHECK_US = 250_000
AGAIN_US = 1_500_000
SILENT_US = 1_000_000
AGES_US = 2**62
"""How long ago what never came was heard."""


@dataclass(slots=True)
class Batch:
    """What is asked of a platform at once: how many agreements are awaited, and what they are to take the place of."""

    unit: str
    before: tuple[str, ...]
    awaited: int


@dataclass(slots=True)
class Supply:
    """What was asked of whom, and when to look again."""

    context: Context
    _asked_us: dict[str, int] = field(default_factory=dict)
    _open: dict[str, list[str]] = field(default_factory=dict)
    _asked_for: dict[str, AbstractSet[tuple[str, int, int]]] = field(default_factory=dict)
    _renew: set[str] = field(default_factory=set)
    _check_us: int | None = None
    _look_us: dict[str, int] = field(default_factory=dict)
    _next_us: int = 0
    _needs: Needs | None = None
    _changes: int = -1

    def wake(self, now_us: int) -> None:
        """A monitor was set up or a platform came: look soon."""
        due_us = now_us + FIRST_US
        self._check_us = due_us if self._check_us is None else min(self._check_us, due_us)

    @property
    def deadline_us(self) -> int | None:
        return self._check_us

    def on_time(self, now_us: int) -> None:
        if self._check_us is None or now_us < self._check_us:
            return
        needs = self.context.gateway.needs()
        self._check_us = now_us + CHECK_US if needs else None
        for unit in [unit for unit in self._open if unit not in needs]:
            self._asked_for.pop(unit, None)
            for conversation in self._open.pop(unit):
                self.context.desk.cancel(unit, conversation, now_us)
        importer = self.context.gateway.importer
        if needs is not self._needs or importer.changes != self._changes:
            self._look_us.clear()
            self._renew.update(unit for unit, asked in self._asked_for.items() if not asked <= needs[unit])
            self._needs, self._changes = needs, importer.changes
            self._next_us = 0
        if now_us < self._next_us and not self._renew:
            return
        due = [unit for unit in needs if now_us >= self._look_us.get(unit, 0) or unit in self._renew]
        heard_us = importer.heard_us() if due else {}
        for unit in due:
            silent_at_us = {
                label: heard_us.get((unit, label), now_us - AGES_US) + SILENT_US + 2 * period_us
                for label, period_us, _ in needs[unit]
            }
            self._look_us[unit] = min(silent_at_us.values()) + 1
            if self._lacks(unit, {label for label, at_us in silent_at_us.items() if now_us > at_us}, now_us):
                self._ask(unit, needs[unit], now_us)
        self._next_us = min((self._look_us[unit] for unit in needs), default=0)

    def forget(self, unit: str) -> None:
        """The platform is gone, and the conversations with it: what it exported to us is asked for anew if it returns."""
        self._asked_us.pop(unit, None)
        self._asked_for.pop(unit, None)
        if self._open.pop(unit, None):
            self._renew.add(unit)

    def _lacks(self, unit: str, silent: set[str], now_us: int) -> bool:
        """Whether to ask for streams again: those of labels that are silent, or all after a return or for less."""
        is_renewed = unit in self._renew
        if not (silent or is_renewed) or now_us < self._asked_us.get(unit, -AGAIN_US) + AGAIN_US:
            return False
        entry = self.context.directory.entry(unit)
        if entry is None or not self.context.directory.is_present(unit):
            return False
        offered = {label.label for label in entry.labels}
        return bool(offered) if is_renewed else not silent.isdisjoint(offered)

    def _ask(self, unit: str, wanted: AbstractSet[tuple[str, int, int]], now_us: int) -> None:
        """Ask for all of it; what stood ends when all of that is agreed to, so that no stream ends in between."""
        self._asked_us[unit], self._asked_for[unit] = now_us, set(wanted)
        self._renew.discard(unit)
        entry = self.context.directory.entry(unit)
        offered = {label.label for label in entry.labels} if entry is not None else set()
        by_policy: dict[tuple[int, int], list[str]] = {}
        for label, period_us, delay_us in sorted(wanted):
            if label in offered:
                by_policy.setdefault((period_us, delay_us), []).append(label)
        held = self._open.setdefault(unit, [])
        batch = Batch(unit, tuple(held), len(by_policy))
        for (period_us, delay_us), labels in by_policy.items():
            content = CreateMulticast(
                semantic_labels=tuple(labels),
                sample_period_s=period_us / US_PER_S,
                delay_s=delay_us / US_PER_S,
                to_units=(self.context.unit,),
            )
            held.append(self._delegate(batch, content, now_us))

    def _delegate(self, batch: Batch, content: CreateMulticast, now_us: int) -> str:
        asked: list[str] = []

        def is_held() -> bool:
            return bool(asked) and asked[0] in self._open.get(batch.unit, ())

        def on_reply(reply: Act, _said: Content | None, at_us: int) -> None:
            if reply.performative is Performative.AGREE:
                self._agreed(batch, at_us)
            elif reply.performative is Performative.FAILURE and is_held():
                self._renew.add(batch.unit)

        def on_silence(_why: str, _at_us: int) -> None:
            if is_held():
                self._renew.add(batch.unit)

        asked.append(self.context.desk.delegate(batch.unit, content, now_us, on_reply=on_reply, on_silence=on_silence))
        return asked[0]

    def _agreed(self, batch: Batch, now_us: int) -> None:
        batch.awaited -= 1
        held = self._open.get(batch.unit, [])
        for conversation in batch.before if batch.awaited == 0 else ():
            if conversation in held:
                held.remove(conversation)
                self.context.desk.cancel(batch.unit, conversation, now_us)
