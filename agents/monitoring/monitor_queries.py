"""The monitors of a platform as others see them: verdicts, inputs, what their states are made of; and which are unknown."""

from collections.abc import Iterator
from typing import Literal, NamedTuple

from dyknow.agents.actions import COORDINATION, QUERIED, SUBSCRIBED, Action, Offer, Role
from dyknow.agents.monitoring.alarm_log import ALARMS
from dyknow.agents.monitoring.monitor_plans import states_declaration
from dyknow.agents.monitoring.monitors import UnitMonitors
from dyknow.agents.monitoring.reasons import reasons
from dyknow.agents.part import Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.subscribers import Subscribers
from dyknow.agents.tasks.life import TaskLife
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import (
    IDLE,
    MAX_LIST,
    MonitorChange,
    MonitorChanges,
    MonitorEntry,
    MonitorList,
    Monitors,
)
from dyknow.kpl import print_specification
from dyknow.kpl.checking.error_collector import shortened
from dyknow.model.values import LARGEST
from dyknow.reasoning import Monitor

MONITORS_A_PAGE = 40
LONGEST_STATES = 1000
LOOK_US = 200_000
"""How often the monitors are looked at while there are subscribers."""
BEGINNING_US = 1_500_000
"""How long a new monitor may be without its inputs before it counts as unknown."""
BETWEEN_US = 1_000_000
"""A monitor that changes more often is reported once in this time."""


class _Known(NamedTuple):
    """State of a monitor as last reported to subscribers, and when (node clock)."""

    monitor: Monitor
    is_unknown: bool
    at_us: int


class MonitorQueries(Part):
    """Lists the monitors over units, and those of the specification; reports those that become unknown.

    Args:
        instance: has the monitors that the specification declares over its streams.
    """

    offers = (
        Offer(COORDINATION, (Action(Monitors, "on_monitors", QUERIED, Role.OBSERVER),)),
        Offer(ALARMS, (Action(MonitorChanges, "on_subscribe", SUBSCRIBED, Role.OBSERVER),)),
    )
    answers = (MonitorList, MonitorChange)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._unit, self._agent, self._clock = ports.unit, ports.agent, ports.clock
        self._translation = ports.translation
        self._monitors, self._instance = parts[UnitMonitors.of], ports.instance()
        self._subscribers = Subscribers(ports.agent, parts[TaskLife])
        self._known: dict[tuple[str, tuple[str, ...]], _Known] = {}
        self._look_us = 0

    def _all(self) -> Iterator[tuple[str, Monitor]]:
        for named in self._monitors.named.values():
            for each in named.instances.values():
                yield named.plan.name, each.monitor
        for own in self._instance.monitors.values():
            yield own.monitor.name, own.monitor

    # -- changes -----------------------------------------------------------------------------------------------

    def on_subscribe(self, act: Act, _content: MonitorChanges, now_us: int) -> None:
        """`(monitor-changes)`"""
        if not self._subscribers:
            self._known.clear()
            self._look_us = now_us
        self._subscribers.add(act, now_us)
        for (name, units), known in self._known.items():
            if known.is_unknown:
                self._agent.answer(
                    act, Performative.INFORM, self._change("unknown", name, units, now_us, known.monitor), now_us
                )

    def on_cancel(self, act: Act, _now_us: int) -> bool:
        return self._subscribers.remove(act)

    def on_lost(self, act: Act, _now_us: int) -> bool:
        return self._subscribers.remove(act)

    @property
    def deadline_us(self) -> int | None:
        return self._look_us if self._subscribers else None

    def on_time(self, now_us: int) -> None:
        """Compare the monitors with their last reported states, and report the changes."""
        if not self._subscribers or now_us < self._look_us:
            return
        self._look_us = now_us + LOOK_US
        new_us = self._clock.federation_us(now_us - BEGINNING_US)
        there = set[tuple[str, tuple[str, ...]]]()
        for name, monitor in self._all():
            key = (name, monitor.key)
            there.add(key)
            known, is_unknown = self._known.get(key), monitor.shows == "unknown"
            if known is None or known.monitor is not monitor:
                if is_unknown and monitor.inputs_since_us > new_us:
                    continue  # it has only begun
                is_news = is_unknown if known is None else is_unknown != known.is_unknown
            else:
                is_news = is_unknown != known.is_unknown and now_us >= known.at_us + BETWEEN_US
                if not is_news:
                    continue
            self._known[key] = _Known(monitor, is_unknown, now_us)
            if is_news:
                event: Literal["unknown", "known"] = "unknown" if is_unknown else "known"
                self._subscribers.inform(self._change(event, *key, now_us, monitor), now_us)
        for key in self._known.keys() - there:
            del self._known[key]
            self._subscribers.inform(self._change("ended", *key, now_us), now_us)

    def _change(
        self,
        event: Literal["unknown", "known", "ended"],
        name: str,
        units: tuple[str, ...],
        now_us: int,
        monitor: Monitor | None = None,
    ) -> MonitorChange:
        return MonitorChange(
            event=event,
            monitor=name,
            by=self._unit,
            units=units,
            at_us=self._clock.federation_us(now_us),
            which=() if monitor is None else _missing(monitor),
            since_us=None if monitor is None else monitor.inputs_since_us,
        )

    # -- queries -----------------------------------------------------------------------------------------------

    def on_monitors(self, act: Act, content: Monitors, now_us: int) -> None:
        """`(monitors)`: those over units, then those that the specification declares over its streams."""
        of_plans = (
            (named.plan.name, each.monitor, states_declaration(named.plan, each.maker, self._translation))
            for named in self._monitors.named.values()
            for each in named.instances.values()
        )
        specified = ((each.monitor.name, each.monitor, each.states) for each in self._instance.monitors.values())
        own = ((name, monitor, states.declarations(name)) for name, monitor, states in specified)
        entries = [
            self._entry(name, monitor, print_specification(declared), explain=bool(content.explain))
            for name, monitor, declared in (*of_plans, *own)
        ]
        entries += [
            MonitorEntry(
                by=self._unit, name=name, units=(self._unit,), verdict="undecided", inputs="missing", shows=IDLE
            )
            for name, named in self._monitors.named.items()
            if not named.instances and not named.plan.in_instance
        ]
        self._agent.answer_pages(
            act, entries, MONITORS_A_PAGE, lambda page, more: MonitorList(monitors=page, more=more), now_us
        )

    def _entry(self, name: str, monitor: Monitor, states: str, *, explain: bool) -> MonitorEntry:
        return MonitorEntry(
            by=self._unit,
            name=name,
            units=monitor.key,
            verdict=monitor.verdict,
            inputs=monitor.inputs,
            shows=monitor.shows,
            since_us=monitor.inputs_since_us,
            which=_missing(monitor),
            states=states if len(states) <= LONGEST_STATES else "",
            counted=dict(monitor.counted),
            because=reasons(monitor.explanation) if explain and monitor.verdict == "false" else (),
            margin=_rounded(monitor.margin()),
        )


def _rounded(margin: float | None) -> float | None:
    return None if margin is None or abs(margin) > LARGEST else float(f"{margin:.6g}")


def _missing(monitor: Monitor) -> tuple[str, ...]:
    return tuple(shortened(name) for name in monitor.missing_inputs[:MAX_LIST])
