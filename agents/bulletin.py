"""What people and agents ask a platform about itself: alarms, monitors, tasks, the account, the directory.

Times are the node clock, but for those of samples and alarms.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from itertools import islice
from typing import Any, TypeVar

from agents.account import Account, Entry
from agents.alarm_book import Subscriber
from agents.context import Context
from agents.derived_states import derived_declaration
from dyknow import NoValue, Value, as_json
from federation.acts import Act, AgentName, Performative
from federation.contents import (
    MAX_LIST,
    ActList,
    ActLog,
    Acts,
    Alarm,
    AlarmList,
    Content,
    DirectoryEvent,
    Found,
    ImportAccount,
    ImportList,
    LabelList,
    MonitorList,
    Search,
    TaskList,
)
from federation.contents import Monitor as MonitorEntry
from federation.contents import Task as TaskEntry
from federation.directory import (
    DirectoryEvent as DirectoryChange,
)
from federation.liveness import SUSPECT_US, PlatformAppeared, PlatformGone, PlatformReturned, PlatformSuspected
from federation.offers import LabelAppeared, LabelGone, ServiceAppeared, ServiceGone
from kpl import print_specification
from kpl.complaints import shortened
from kpl.formula_monitors import FormulaMonitor
from reasoning import AlarmEvent, Monitor

P = Performative
T = TypeVar("T")
ALARMS_A_PAGE = 50
ACTS_A_PAGE = 25
MONITORS_A_PAGE = 40
IMPORTS_A_PAGE = 200
MISSED_US = 60_000_000
"""How long a platform that fell silent (stands still, or is cut off) is named when somebody asks who is there."""
TEXT = 2000
LONGEST_LABEL = 256
LONGEST_STATES = 1000
MOST_VALUES = 256


def alarm_content(event: AlarmEvent, by: str) -> Alarm:
    """An alarm as it is told."""
    return Alarm(
        id=event.id,
        event=event.event,
        monitor=event.monitor,
        by=by,
        units=event.units,
        valid_us=event.valid_us,
        detected_us=event.detected_us,
        values=_told(event.values),
        samples=_told(event.samples_us),
    )


def _told(values: Mapping[str, Value]) -> dict[str, Any]:
    """As much of the values as an alarm can carry: records and what else is no scalar as text."""
    shown = islice(((label, value) for label, value in values.items() if len(label) <= LONGEST_LABEL), MOST_VALUES)
    return {
        label: value if isinstance(value, bool | int | float | NoValue) else shortened(str(as_json(value)))
        for label, value in shown
    }


class Bulletin:
    """Answers to questions about this platform, and subscriptions to what happens on it.

    Args:
        specified: the monitors of its specification over streams of its own.
    """

    def __init__(self, context: Context, account: Account, specified: Callable[[], Iterable[FormulaMonitor]]) -> None:
        self._c, self._account, self._specified = context, account, specified
        self._followers: dict[Subscriber, Act] = {}
        self._watchers: dict[Subscriber, Act] = {}
        self._missing: dict[str, int] = {}
        account.on_entry = self._on_entry

    # -- questions ---------------------------------------------------------------------------------------------

    def on_alarm_list(self, act: Act, _content: Content, now_us: int) -> None:
        found = [alarm_content(event, self._c.unit) for event in self._c.alarms.events]
        for page, more in _pages(found, ALARMS_A_PAGE):
            self._c.desk.answer(act, P.INFORM, AlarmList(alarms=tuple(page), more=more), now_us)

    def on_act_list(self, act: Act, _content: Content, now_us: int) -> None:
        found = [self._log(entry) for entry in self._account.entries]
        for page, more in _pages(found, ACTS_A_PAGE):
            self._c.desk.answer(act, P.INFORM, ActList(acts=tuple(page), more=more), now_us)

    def on_monitors(self, act: Act, _content: Content, now_us: int) -> None:
        gateway = self._c.gateway
        of_plans = (
            (named.plan.name, each.monitor, derived_declaration(named.plan, each.maker, gateway.translation))
            for named in gateway.monitors.named.values()
            for each in named.instances.values()
        )
        specified = ((each.monitor.name, each.monitor, each.states) for each in self._specified())
        own = ((name, monitor, states.declarations(name)) for name, monitor, states in specified)
        found = [self._monitor(name, monitor, print_specification(said)) for name, monitor, said in (*of_plans, *own)]
        for page, more in _pages(found, MONITORS_A_PAGE):
            self._c.desk.answer(act, P.INFORM, MonitorList(monitors=tuple(page), more=more), now_us)

    def _monitor(self, name: str, monitor: Monitor, states: str) -> MonitorEntry:
        return MonitorEntry(
            by=self._c.unit,
            name=name,
            units=monitor.key,
            verdict=monitor.verdict,
            inputs=monitor.inputs,
            shows=monitor.shows,
            since_us=monitor.inputs_since_us,
            which=tuple(shortened(name) for name in monitor.missing_inputs[:MAX_LIST]),
            states=states if len(states) <= LONGEST_STATES else "",
            counted=dict(monitor.counted),
        )

    def on_import_list(self, act: Act, _content: Content, now_us: int) -> None:
        """Which streams come in, and what became of their samples: gaps show here."""
        found = [
            ImportAccount(
                owner=stream.owner,
                semantic_label=stream.label,
                hash=stream.policy_hash,
                missing=stream.missing,
                **asdict(stream.account),
            )
            for stream in (found.stream for found in self._c.gateway.importer.imports.values())
        ]
        for page, more in _pages(found, IMPORTS_A_PAGE):
            self._c.desk.answer(act, P.INFORM, ImportList(imports=tuple(page), more=more), now_us)

    def on_labels(self, act: Act, _content: Content, now_us: int) -> None:
        """Which streams the local instance has, under its own names: only agents of this platform get here."""
        labels = tuple(map(str, self._c.gateway.network.labels()))[:MAX_LIST]
        self._c.desk.answer(act, P.INFORM, LabelList(labels=labels), now_us)

    def on_tasks(self, act: Act, _content: Content, now_us: int) -> None:
        found = tuple(
            TaskEntry(
                conversation=task.conversation,
                task=task.name,
                unit=self._c.unit,
                state=task.state,
                delegator=str(AgentName("interface", task.initiator)) if task.initiator else None,
                since_us=task.since_us,
            )
            for task in self._c.tasks.all()
            if not task.is_part
        )
        self._c.desk.answer(act, P.INFORM, TaskList(tasks=found[:500]), now_us)

    def on_search(self, act: Act, content: Search, now_us: int) -> None:
        found = self._c.directory.search(service=content.service, label=content.semantic_label, outside=True)
        agents = tuple(str(AgentName("interface", entry.unit)) for entry in found)[:MAX_LIST]
        missing = tuple(unit for unit, since_us in self._missing.items() if now_us < since_us + MISSED_US)[:MAX_LIST]
        self._c.desk.answer(act, P.INFORM, Found(agents=agents, missing_units=missing), now_us)

    # -- subscriptions -----------------------------------------------------------------------------------------

    def on_alarms(self, act: Act, _content: Content, now_us: int) -> None:
        def tell(event: AlarmEvent, at_us: int) -> None:
            self._c.desk.answer(act, P.INFORM, alarm_content(event, self._c.unit), at_us)

        self._c.alarms.listeners[self._subscriber(act)] = tell
        self._c.desk.answer(act, P.AGREE, None, now_us)

    def on_acts(self, act: Act, _content: Acts, now_us: int) -> None:
        self._followers[self._subscriber(act)] = act
        self._c.desk.answer(act, P.AGREE, None, now_us)

    def on_directory(self, act: Act, _content: Content, now_us: int) -> None:
        self._watchers[self._subscriber(act)] = act
        self._c.desk.answer(act, P.AGREE, None, now_us)

    def _subscriber(self, act: Act) -> Subscriber:
        """Who subscribes, and in which conversation.

        Raises:
            ContentError: in none. Refused: one that is about a task.
        """
        return act.sender.unit, self._c.tasks.check_free(act.conversation_id)

    def unsubscribe(self, unit: str, conversation: str) -> bool:
        """End a subscription of that unit; whether there was one."""
        name = unit, conversation
        found = (
            self._c.alarms.listeners.pop(name, None)
            or self._followers.pop(name, None)
            or self._watchers.pop(name, None)
        )
        return found is not None

    def on_directory_change(self, change: DirectoryChange, now_us: int) -> None:
        """Tell those who watch the directory what came or went, and remember who is missed."""
        self._note_missing(change, now_us)
        said = _change(change, now_us)
        if said is not None:
            for act in list(self._watchers.values()):
                self._c.desk.answer(act, P.INFORM, said, now_us)

    def _note_missing(self, change: DirectoryChange, now_us: int) -> None:
        """Who fell silent is missed; whose token went while it still spoke has ended, and is not."""
        if isinstance(change, PlatformSuspected):
            entry = self._c.directory.entry(change.unit)
            if entry is not None and entry.kind == "uav" and entry.since_us >= entry.heard_us + SUSPECT_US:
                self._missing.setdefault(change.unit, now_us)
        elif isinstance(change, PlatformAppeared | PlatformReturned) or (
            isinstance(change, PlatformGone) and change.why == "left"
        ):
            self._missing.pop(change.unit, None)
        for unit in [unit for unit, since_us in self._missing.items() if now_us >= since_us + MISSED_US]:
            del self._missing[unit]

    def _on_entry(self, entry: Entry) -> None:
        """Tell those who follow the acts, but not of what is told to them, nor of their own questions about it."""
        if not self._followers:
            return
        if entry.act is not None and (entry.peer, entry.act.conversation_id) in self._followers:
            return
        said = self._log(entry)
        for act in list(self._followers.values()):
            self._c.desk.answer(act, P.INFORM, said, entry.at_us)

    def _log(self, entry: Entry) -> ActLog:
        return ActLog(
            at_us=entry.at_us,
            direction=entry.direction,
            peer=entry.peer,
            outcome=entry.outcome[:400],
            act=None if entry.act is None else _shortened(str(entry.act)),
        )


def _shortened(text: str) -> str:
    return text if len(text) <= TEXT else f"{text[: TEXT - 3]}..."


def _pages(found: Sequence[T], size: int) -> list[tuple[Sequence[T], bool]]:
    starts = range(0, max(1, len(found)), size)
    return [(found[at : at + size], at + size < len(found)) for at in starts]


_PLATFORM: dict[type, str] = {
    PlatformAppeared: "platform-appeared",
    PlatformSuspected: "platform-suspected",
    PlatformReturned: "platform-returned",
    PlatformGone: "platform-gone",
}
_OFFER: dict[type, tuple[str, Callable[[DirectoryChange], str]]] = {
    ServiceAppeared: ("service-appeared", lambda change: change.service.service),  # type: ignore[union-attr]
    ServiceGone: ("service-gone", lambda change: change.service.service),  # type: ignore[union-attr]
    LabelAppeared: ("label-appeared", lambda change: change.label.label),  # type: ignore[union-attr]
    LabelGone: ("label-gone", lambda change: change.label.label),  # type: ignore[union-attr]
}


def _change(change: DirectoryChange, now_us: int) -> DirectoryEvent | None:
    if type(change) in _PLATFORM:
        return DirectoryEvent(event=_PLATFORM[type(change)], unit=change.unit, at_us=now_us)
    if type(change) in _OFFER:
        name, what = _OFFER[type(change)]
        return DirectoryEvent(event=name, unit=change.unit, at_us=now_us, what=what(change))
    return None
