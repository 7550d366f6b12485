"""The contents of `dyknow top`, gathered from a federation: tables of rows, each with its details."""

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple, TypeAlias, TypeVar

from dyknow.console.commands.members.alarms import input_names, reason_text
from dyknow.console.commands.members.ls import LOW_BATTERY, newest_samples
from dyknow.federation.members.command_centre import PlatformView
from dyknow.federation.messages.acts import Act, parse_act
from dyknow.federation.messages.contents import (
    ActLog,
    Acts,
    Alarm,
    AlarmList,
    Alarms,
    Content,
    ImportCounts,
    ImportList,
    MonitorEntry,
    MonitorList,
    Monitors,
)
from dyknow.model.errors import NothingFound, TextError
from dyknow.model.instants import print_span
from dyknow.runtime.client import Client
from dyknow.runtime.configuration.instants import clock_time
from dyknow.runtime.library.jobs import Subscriptions, all_platforms, lists
from dyknow.runtime.library.questions import is_stale

KEPT: Final = 500
"""Alarms and acts that are shown, the newest."""
Number: TypeAlias = float | None
C = TypeVar("C", bound=Content)
TABLES: Final[Mapping[str, tuple[str, ...]]] = {
    "platforms": ("unit", "state", "battery", "altitude", "labels", "oldest data", "conditions"),
    "streams": ("unit", "label", "offered", "rate", "age", "to", "missing", "lost"),
    "monitors": ("by", "monitor", "units", "shows", "verdict", "inputs", "for"),
    "alarms": ("time", "event", "monitor", "units", "by"),
    "acts": ("time", "unit", "way", "peer", "act", "content", "outcome"),
}
"""The headings of each table."""


class Row(NamedTuple):
    """One row: `key` names it among those of its table, `order` has what its cells are sorted by.

    `level` is `bad` or `warn` where a reader should look, else empty.
    """

    key: str
    cells: tuple[str, ...]
    order: tuple[str | Number, ...]
    details: str
    level: str = ""


@dataclass(frozen=True, slots=True)
class TopSnapshot:
    """All tables at one moment, and a line about the whole."""

    title: str
    tables: Mapping[str, Sequence[Row]] = field(default_factory=dict)


class Gatherer:
    """Looks at a federation again and again; `look` takes up to a second where a platform does not answer."""

    def __init__(self, client: Client, federation: str) -> None:
        self._client, self._federation = client, federation
        self._news = Subscriptions(client, Alarms()), Subscriptions(client, Acts())
        self._alarms: dict[tuple[str, str], Row] = {}
        self._open: dict[str, str] = {}
        self._acts: deque[Row] = deque(maxlen=KEPT)
        self._numbers = 0
        self._received: dict[tuple[str, str, str, str], tuple[int, int, float]] = {}
        self._listed: set[str] = set()
        client.on_trouble = lambda _unit, _why: None

    def look(self) -> TopSnapshot:
        """Ask all platforms once."""
        client = self._client
        there = client.run(all_platforms(client))
        alive = [view.unit for view in there if view.state == "alive"]
        newest = newest_samples(client, there)
        imports = [
            (unit, one) for unit, said in self._lists(alive, ImportList(), ImportList) for one in said.imports or ()
        ]
        monitors = [
            one
            for unit, said in self._lists(alive, Monitors(explain=True), MonitorList)
            for one in said.monitors
            if one.by == unit
        ]
        self._take_news(alive)
        tables = {
            "platforms": [self._platform(view, newest) for view in there],
            "streams": self._streams(there, newest, imports),
            "monitors": [self._monitor(one) for one in monitors],
            "alarms": [*self._alarms.values()][::-1],
            "acts": [*self._acts][::-1],
        }
        return TopSnapshot(self._title(there, monitors), tables)

    def _lists(self, units: Sequence[str], content: Content, kind: type[C]) -> list[tuple[str, C]]:
        try:
            return self._client.run(lists(self._client, units, content, kind))
        except NothingFound:
            return []

    def _title(self, there: Sequence[PlatformView], monitors: Sequence[MonitorEntry]) -> str:
        alive = sum(view.state == "alive" for view in there)
        unknown = sum(one.shows == "unknown" for one in monitors)
        open_ones = sum(event == "opened" for event in self._open.values())
        return (
            f"federation {self._federation}  {clock_time(self._client.federation_us())} UTC  "
            f"{alive} of {len(there)} platforms  {open_ones} open alarms  {unknown} of {len(monitors)} monitors unknown"
        )

    # -- rows --------------------------------------------------------------------------------------------------

    def _platform(self, view: PlatformView, newest: Mapping[tuple[str, str], object]) -> Row:
        battery = _value(newest, view.unit, "battery", "fraction")
        altitude_m = _value(newest, view.unit, "heli-altitude", "altitude_m")
        ages = [(age_us, label) for label in view.labels if (age_us := _age_us(newest, view.unit, label)) is not None]
        oldest_us, oldest = max(ages, default=(None, ""))
        entry = view.entry
        conditions = [condition.text for condition in (entry.conditions if entry else ())]
        cells = (
            view.unit,
            view.state,
            "" if battery is None else f"{battery:.0%}",
            "" if altitude_m is None else f"{altitude_m:.0f} m",
            str(len(view.labels)),
            "" if oldest_us is None else f"{print_span(oldest_us)} {oldest}",
            "; ".join(conditions),
        )
        is_low = battery is not None and battery < LOW_BATTERY
        level = "bad" if view.state != "alive" or is_low else "warn" if conditions else ""
        details = [f"platform {view.unit}: {view.state}", f"services: {', '.join(view.services)}", "labels:"]
        details += [f"  {label}  {_span(_age_us(newest, view.unit, label))}" for label in view.labels]
        details += [f"condition: {text}" for text in conditions]
        order = (view.unit, view.state, battery, altitude_m, float(len(view.labels)), oldest_us, len(conditions))
        return Row(view.unit, cells, order, "\n".join(details), level)

    def _streams(
        self,
        there: Sequence[PlatformView],
        newest: Mapping[tuple[str, str], object],
        imports: Iterable[tuple[str, ImportCounts]],
    ) -> list[Row]:
        by_stream: dict[tuple[str, str], list[tuple[str, ImportCounts]]] = {}
        for receiver, one in imports:
            by_stream.setdefault((one.owner, one.semantic_label), []).append((receiver, one))
        rows = []
        for view in there:
            for entry in view.entry.labels if view.entry is not None else ():
                taken = by_stream.get((view.unit, entry.label), [])
                rates = [rate for receiver, one in taken if (rate := self._rate_hz(receiver, one)) is not None]
                age_us, offered = (
                    _age_us(newest, view.unit, entry.label),
                    1e6 / entry.period_us if entry.period_us else None,
                )
                missing, lost = sum(one.missing for _, one in taken), sum(one.lost for _, one in taken)
                rate = min(rates, default=None)
                to = ", ".join(dict.fromkeys(receiver for receiver, _ in taken))
                cells = (
                    view.unit,
                    entry.label,
                    _hertz(offered),
                    _hertz(rate),
                    _span(age_us),
                    to,
                    str(missing),
                    str(lost),
                )
                is_old = age_us is not None and is_stale(self._client, age_us, entry.period_us)
                level = "bad" if lost or is_old else "warn" if missing else ""
                order = (view.unit, entry.label, offered, rate, age_us, to, missing, lost)
                details = [
                    f"{entry.label} of platform {view.unit}, sort {entry.sort}, offered {_hertz(offered) or 'at no rate'}"
                ]
                details += [_taken(receiver, one) for receiver, one in taken]
                rows.append(Row(f"{view.unit} {entry.label}", cells, order, "\n".join(details), level))
        return rows

    def _rate_hz(self, receiver: str, one: ImportCounts) -> float | None:
        """Samples a second since the look before, by the receiver's own count."""
        name = receiver, one.owner, one.semantic_label, one.hash
        now_us = self._client.now_us()
        before = self._received.get(name)
        if before is not None and now_us <= before[1]:
            return before[2]
        rate = None
        if before is not None:
            rate = max(0, one.received - before[0]) * 1e6 / (now_us - before[1])
        self._received[name] = one.received, now_us, rate or 0.0
        return rate

    def _monitor(self, one: MonitorEntry) -> Row:
        now_us = self._client.federation_us()
        for_us = None if one.since_us is None else max(0, now_us - one.since_us)
        units = ", ".join(one.units)
        missing = f": {', '.join(input_names(one))}" if one.which else ""
        cells = (one.by, one.name, units, one.shows, one.verdict, f"{one.inputs}{missing}", _span(for_us))
        level = {"alarm": "bad", "unknown": "warn"}.get(one.shows, "")
        details = [f"{one.name} of {units} by {one.by}: {one.shows}", *map(reason_text, one.because), one.states]
        order = (one.by, one.name, units, one.shows, one.verdict, cells[5], for_us)
        return Row(f"{one.by} {one.name} {units}", cells, order, "\n".join(details), level)

    # -- news --------------------------------------------------------------------------------------------------

    def _take_news(self, alive: Sequence[str]) -> None:
        new = [unit for unit in alive if unit not in self._listed]
        self._listed = {*alive}
        for unit, said in self._lists(new, AlarmList(), AlarmList):
            for alarm in said.alarms or ():
                self._take(unit, alarm)
        for news in self._news:
            for unit, content in self._client.run(news.news(0)):
                self._take(unit, content)

    def _take(self, unit: str, content: object) -> None:
        if isinstance(content, Alarm) and content.by == unit:
            self._open[content.id] = content.event
            self._alarms[content.id, content.event] = _alarm(content)
            while len(self._alarms) > KEPT:
                del self._alarms[next(iter(self._alarms))]
            while len(self._open) > KEPT:
                del self._open[next(iter(self._open))]
        elif isinstance(content, ActLog) and content.peer != self._client.centre.unit:
            self._numbers += 1
            self._acts.append(_act(unit, content, self._numbers))

    def close(self) -> None:
        """End the subscriptions."""
        for news in self._news:
            news.cancel()


def _alarm(alarm: Alarm) -> Row:
    units = ", ".join(alarm.units)
    cells = (clock_time(alarm.valid_us), alarm.event, alarm.monitor, units, alarm.by)
    values = [f"{name} = {value}" for name, value in alarm.values.items()]
    details = [
        f"{alarm.monitor} of {units} by {alarm.by} {alarm.event} at {cells[0]}",
        *values,
        *map(reason_text, alarm.because),
    ]
    level = "bad" if alarm.event == "opened" else ""
    return Row(f"{alarm.id} {alarm.event}", cells, (alarm.valid_us, *cells[1:]), "\n".join(details), level)


def _act(unit: str, log: ActLog, number: int) -> Row:
    act = _parsed(log)
    what = "" if act is None else act.performative.value
    head = "" if act is None or act.content is None else act.content.head
    cells = (clock_time(log.at_us), unit, log.direction, log.peer, what, head, log.outcome)
    level = "" if log.outcome in {"sent", "accepted"} else "warn"
    return Row(str(number), cells, (log.at_us, *cells[1:]), f"{' '.join(cells)}\n\n{log.act or ''}", level)


def _parsed(log: ActLog) -> Act | None:
    try:
        return None if log.act is None else parse_act(log.act)
    except TextError:
        return None


def _taken(receiver: str, one: ImportCounts) -> str:
    every = "" if one.every == 1 else f", one of {one.every} is sent"
    return f"  to {receiver}: {one.received} received, {one.recovered} recovered, {one.missing} missing, {one.lost} lost{every}"


def _value(newest: Mapping[tuple[str, str], object], unit: str, label: str, name: str) -> float | None:
    value = getattr(newest.get((unit, label)), "value", {}).get(name)
    return float(value) if isinstance(value, int | float) else None


def _age_us(newest: Mapping[tuple[str, str], object], unit: str, label: str) -> int | None:
    return getattr(newest.get((unit, label)), "age_us", None)


def _span(span_us: float | None) -> str:
    return "" if span_us is None else print_span(span_us)


def _hertz(rate: float | None) -> str:
    return "" if rate is None else f"{rate:.3g} Hz"
