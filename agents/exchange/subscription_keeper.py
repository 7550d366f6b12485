"""Keeping the inputs of this platform's monitors alive: a missing stream is requested again (thesis 9.4.1).

The coordinator of a task has streams set up at the start; afterwards every platform requests its missing streams: from
a newcomer, after a cut, after a restart. Streams no longer needed are cancelled. Times are the node clock.
"""

from collections import Counter
from collections.abc import Set as AbstractSet
from dataclasses import dataclass

from dyknow import US_PER_S
from dyknow.agents.exchange.import_proxy import ImportProxy
from dyknow.agents.exchange.label_agreements import LabelAgreements
from dyknow.agents.part import Followed, Part, PeerChange
from dyknow.agents.ports import Needs, PartRegistry, Ports
from dyknow.federation.members.liveness import PlatformGone, PlatformReturned
from dyknow.federation.members.offers import LabelAppeared, ServiceAppeared
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import Content, CreateMulticast
from dyknow.federation.messages.contents.parts import LEAST_PERIOD_S
from dyknow.federation.messages.rounds import Retries

FIRST_US = 250_000
CHECK_US = 250_000
AGAIN_US, AGAIN_MOST_US = 1_500_000, 6_000_000
"""The pause before a platform gets the next request: it doubles while nothing comes, up to the second, so that
requests do not add to the load of a platform that is late because of its load."""
AT_ONCE = 8
"""How many platforms get a request in one look."""
SILENT_US = 1_000_000
REPLY_US = 2_000_000
AGES_US = 2**62
"""Age of a stream that never came."""


@dataclass(slots=True)
class PendingRenewal:
    """Requests to a platform at once: the agreements awaited, and the conversations that they are to replace."""

    unit: str
    before: tuple[str, ...]
    awaited: int


class SubscriptionKeeper(Part):
    """Keeps the streams of other units coming: the requests to each unit, and when to check again.

    Args:
        monitored: the needs of the monitors; it returns the same object while they do not change.

    Attributes:
        patience: how much longer than usual it waits for samples and answers, since there is too much to do.
    """

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._unit, self._agent, self._directory = ports.unit, ports.agent, ports.directory
        self._importer = parts[ImportProxy]
        self._agreements = parts[LabelAgreements]
        self._monitored = ports.monitored()
        self._counted = Counter[tuple[str, tuple[str, int, int]]]()
        self._imported: Needs = {}
        self._both: tuple[Needs, Needs, Needs] = ({}, {}, {})
        self._retries: Retries[str] = Retries(AGAIN_US, AGAIN_MOST_US)
        self._open: dict[str, list[str]] = {}
        self._asked_for: dict[str, AbstractSet[tuple[str, int, int]]] = {}
        self._renew: set[str] = set()
        self._check_us: int | None = None
        self._look_us: dict[str, int] = {}
        self._next_us = 0
        self._needs: Needs | None = None
        self._changes = -1
        self.patience = 1

    def needs(self) -> Needs:
        """Streams of other units that monitors and specification need; the same object while they do not change."""
        one, other = self._monitored(), self._imported
        if one is not self._both[0] or other is not self._both[1]:
            both = {unit: {*one.get(unit, ()), *other.get(unit, ())} for unit in {**one, **other}}
            self._both = one, other, both
        return self._both[2]

    def need(self, unit: str, need: tuple[str, int, int], now_us: int, *, wanted: bool) -> None:
        """A stream (label, period, max delay) of `unit` is needed from now on, or no longer."""
        self._counted[unit, need] += 1 if wanted else -1
        self._counted = +self._counted
        imported: dict[str, set[tuple[str, int, int]]] = {}
        for of_unit, each in self._counted:
            imported.setdefault(of_unit, set()).add(each)
        self._imported = imported
        self.wake(now_us)

    def on_peer(self, change: PeerChange, now_us: int) -> None:
        """Look soon when a platform or a stream came; forget requests to a platform that is gone."""
        if isinstance(change, PlatformReturned | LabelAppeared | ServiceAppeared) and change.unit != self._unit:
            self.wake(now_us)
        elif isinstance(change, PlatformGone):
            self._forget(change.unit)

    def wake(self, now_us: int) -> None:
        """A monitor was set up or a platform came: look soon."""
        due_us = now_us + FIRST_US
        self._check_us = due_us if self._check_us is None else min(self._check_us, due_us)

    @property
    def deadline_us(self) -> int | None:
        return self._check_us

    def on_time(self, now_us: int) -> Followed:
        self._look(now_us)
        return ()

    def _look(self, now_us: int) -> None:
        if self._check_us is None or now_us < self._check_us:
            return
        needs = self.needs()
        self._check_us = now_us + CHECK_US if needs else None
        for unit in [unit for unit in self._open if unit not in needs]:
            self._asked_for.pop(unit, None)
            for conversation in self._open.pop(unit):
                self._agent.cancel(unit, conversation, now_us)
        importer = self._importer
        if needs is not self._needs or importer.imports.changes != self._changes:
            self._look_us.clear()
            self._renew.update(unit for unit, asked in self._asked_for.items() if not asked <= needs[unit])
            self._needs, self._changes = needs, importer.imports.changes
            self._next_us = 0
        if now_us < self._next_us and not self._renew:
            return
        due = dict.fromkeys(unit for unit in needs if now_us >= self._look_us.get(unit, 0) or unit in self._renew)
        heard_us = importer.heard_us(due) if due else {}
        asked = 0
        for unit in due:
            if asked == AT_ONCE:
                return
            silent_at_us = {
                label: heard_us.get((unit, label), now_us - AGES_US) + SILENT_US * self.patience + 2 * period_us
                for label, period_us, _ in needs[unit]
            }
            self._look_us[unit] = min(silent_at_us.values()) + 1
            silent = {label for label, at_us in silent_at_us.items() if now_us > at_us}
            if not silent:
                self._retries.settle(unit)
            if self._lacks(unit, silent, now_us):
                asked_for = needs[unit] if unit in self._renew else self._asked_for.get(unit, set())
                wanted = {need for need in needs[unit] if need[0] in silent or need in asked_for}
                self._ask(unit, wanted, now_us)
                asked += 1
        self._next_us = min((self._look_us[unit] for unit in needs), default=0)

    def _forget(self, unit: str) -> None:
        """Forget requests to a platform that is gone; its exports to this one are requested again when it returns."""
        self._retries.forget(unit)
        self._asked_for.pop(unit, None)
        if self._open.pop(unit, None):
            self._renew.add(unit)

    def _lacks(self, unit: str, silent: set[str], now_us: int) -> bool:
        """Whether to ask for streams again: those of labels that are silent, or all after a return or for less."""
        is_renewed = unit in self._renew
        if not (silent or is_renewed) or not self._retries.is_due(unit, now_us, self.patience):
            return False
        if not self._directory.is_present(unit):
            return False
        offered = self._offered(unit)
        return bool(offered) if is_renewed else not silent.isdisjoint(offered)

    def _offered(self, unit: str) -> set[str]:
        """The labels that a unit has for us, and means as we do."""
        entry = self._directory.entry(unit)
        return {
            each.label
            for each in (() if entry is None else entry.labels)
            if (not each.receivers or self._unit in each.receivers)
            and not self._agreements.disagreement(unit, each.label)
        }

    def _ask(self, unit: str, wanted: AbstractSet[tuple[str, int, int]], now_us: int) -> None:
        """Request the silent streams and those requested before; the old requests end once the new ones are agreed to."""
        self._retries.asked(unit, now_us)
        self._asked_for[unit] = set(wanted)
        self._renew.discard(unit)
        offered = self._offered(unit)
        by_policy: dict[tuple[int, int], list[str]] = {}
        for label, period_us, delay_us in sorted(wanted):
            if label in offered:
                by_policy.setdefault((period_us, delay_us), []).append(label)
        held = self._open.setdefault(unit, [])
        batch = PendingRenewal(unit, tuple(held), len(by_policy))
        for (period_us, delay_us), labels in by_policy.items():
            content = CreateMulticast(
                semantic_labels=tuple(labels),
                sample_period_s=max(LEAST_PERIOD_S, period_us / US_PER_S),
                delay_s=delay_us / US_PER_S,
                to_units=(self._unit,),
            )
            held.append(self._delegate(batch, content, now_us))

    def _delegate(self, batch: PendingRenewal, content: CreateMulticast, now_us: int) -> str:
        asked: list[str] = []

        def is_held() -> bool:
            return bool(asked) and asked[0] in self._open.get(batch.unit, ())

        def on_reply(reply: Act, _content: Content | None, at_us: int) -> None:
            if reply.performative is Performative.AGREE:
                self._agreed(batch, at_us)
            elif reply.performative is Performative.FAILURE and is_held():
                self._renew.add(batch.unit)

        def on_silence(_why: str, _at_us: int) -> None:
            if is_held():
                self._renew.add(batch.unit)

        asked.append(
            self._agent.delegate(
                batch.unit,
                content,
                now_us,
                on_reply=on_reply,
                on_silence=on_silence,
                reply_within_us=REPLY_US * self.patience,
            )
        )
        return asked[0]

    def _agreed(self, batch: PendingRenewal, now_us: int) -> None:
        batch.awaited -= 1
        held = self._open.get(batch.unit, [])
        for conversation in batch.before if batch.awaited == 0 else ():
            if conversation in held:
                held.remove(conversation)
                self._agent.cancel(batch.unit, conversation, now_us)
