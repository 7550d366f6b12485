"""`dyknow alarms`, `monitors` and `acts`: what platforms tell of themselves, once or as it happens."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from console.client import Client, connected
from console.command import Call
from console.errors import DONE, NO
from console.instants import clock_time
from console.output import unit_json, verbatim
from dyknow.errors import TextError
from dyknow.instants import print_span
from federation.acts import Performative, parse_act
from federation.contents import ActList, ActLog, Acts, Alarm, AlarmList, Alarms, Content, Monitor, MonitorList, Monitors

P = Performative
ASK_S = 2.0
_STEP_S = 0.2
_SHOWN = {"ok": "green", "alarm": "red"}


class Following:
    """A subscription to every platform that is there, those that appear later included."""

    def __init__(self, client: Client, content: Content) -> None:
        self._client, self._content = client, content
        self._open: dict[str, tuple[Any, int]] = {}

    def news(self, timeout_s: float) -> Iterator[tuple[str, Content]]:
        """Wait a moment; what came since, with the platform that told it."""
        there = {seen.unit for seen in self._client.centre.platforms() if seen.state == "alive"}
        for unit in there:
            subscription, _ = self._open.get(unit, (None, 0))
            if subscription is None or subscription.over:
                self._open[unit] = (self._client.say(unit, P.SUBSCRIBE, self._content, standing=True), 0)
        self._client.wait_for(self._has_news, timeout_s)
        for unit, (subscription, told) in self._open.items():
            results = subscription.results
            self._open[unit] = (subscription, len(results))
            yield from ((unit, said) for said in results[told:])

    def _has_news(self) -> bool:
        return any(len(subscription.results) > told for subscription, told in self._open.values())


def _remembered(client: Client, units: list[str], content: Content) -> Iterator[tuple[str, Content]]:
    """What platforms remember, as they answer."""
    for dialogue in client.ask(units, content, P.QUERY_REF, ASK_S):
        yield from ((dialogue.unit, said) for said in dialogue.results)


# Alarms


def alarms(call: Call, *, follow: bool, count: int | None) -> int:
    """Remembered alarms in the order in which they were detected, then, with `follow`, new ones; 1 if there are none."""
    told: set[tuple[str, str]] = set()

    def tell(found: list[Alarm]) -> bool:
        """Print what is new; whether enough has been told."""
        for alarm in sorted(found, key=lambda alarm: (alarm.detected_us, alarm.event == "closed")):
            if (alarm.id, alarm.event) not in told and (count is None or len(told) < count):
                told.add((alarm.id, alarm.event))
                _tell_alarm(call, alarm)
        return count is not None and len(told) >= count

    with connected(call) as client:
        units = _there(client, follow=follow)
        lists = [said for _, said in _remembered(client, units, AlarmList()) if isinstance(said, AlarmList)]
        known = [alarm for said in lists for alarm in said.alarms or ()]
        enough = tell(known[-count:] if count is not None and not follow else known)
        if follow and not enough:
            following = Following(client, Alarms())
            while not tell([said for _, said in following.news(_STEP_S) if isinstance(said, Alarm)]):
                pass
    if not told and not call.out.json_lines:
        call.out.note("no alarm; dyknow monitors shows what is watched.")
    return DONE if told else NO


def _there(client: Client, *, follow: bool) -> list[str]:
    """The platforms to ask; who follows may come before the first of them."""
    if follow:
        return [seen.unit for seen in client.settle()]
    return client.chosen(None)


def _tell_alarm(call: Call, alarm: Alarm) -> None:
    if call.out.json_lines:
        call.out.line(alarm_json(alarm))
        return
    colour = "red" if alarm.event == "opened" else "green"
    delay = print_span(alarm.detected_us - alarm.valid_us)
    said = (
        f"[{colour}]{alarm.event}[/{colour}]  [bold]{alarm.monitor}[/bold] {', '.join(alarm.units)}  "
        f"[dim]by {alarm.by}, {delay} after the sample[/dim]"
    )
    values = ", ".join(_quantity(name, value) for name, value in alarm.values.items())
    call.out.aside(clock_time(alarm.valid_us), f"{said}\n[dim]{verbatim(values)}[/dim]" if values else said)


def _quantity(name: str, value: Any) -> str:
    """A feature for people; the units are said already, and a duration is not read as microseconds."""
    feature = name.partition("[")[0]
    if isinstance(value, int | float) and not isinstance(value, bool):
        return f"{feature} {print_span(value) if feature.endswith('_time') else f'{value:.1f}'}"
    return f"{feature} {value}"


def alarm_json(alarm: Alarm) -> dict[str, Any]:
    """An alarm as a JSON line has it."""
    values = {name.replace(", ", ","): v for name, v in alarm.values.items() if isinstance(v, bool | int | float | str)}
    return {
        "id": alarm.id,
        "event": alarm.event,
        "monitor": alarm.monitor,
        "by": unit_json(alarm.by),
        "units": [unit_json(unit) for unit in alarm.units],
        "valid_us": alarm.valid_us,
        "detected_us": alarm.detected_us,
        "values": values,
        "samples": {name.replace(", ", ","): valid_us for name, valid_us in alarm.samples.items()},
    }


# Monitors


def all_monitors(client: Client, units: list[str]) -> list[Monitor]:
    """Every monitor of these platforms."""
    lists = (said for _, said in _remembered(client, units, Monitors()) if isinstance(said, MonitorList))
    return sorted((m for said in lists for m in said.monitors), key=lambda m: (m.by, m.name, m.units))


def monitors(call: Call) -> int:
    """Every monitor, with its verdict and the state of its inputs; 1 if there is none."""
    with connected(call) as client:
        with call.out.waiting("asking for monitors"):
            found = all_monitors(client, client.chosen(None))
        now_us = client.federation_us()
    if call.out.json_lines:
        for monitor in found:
            call.out.line(_monitor_json(monitor))
    elif found:
        rows = [_monitor_row(monitor, now_us) for monitor in found]
        call.out.table("", ("by", "monitor", "units", "shows", "verdict", "inputs", "for"), rows)
    else:
        call.out.note("no monitor is set up; begin with dyknow delegate monitor-proximity.")
    return DONE if found else NO


def _monitor_json(monitor: Monitor) -> dict[str, Any]:
    return {
        "by": unit_json(monitor.by),
        "monitor": monitor.name,
        "units": [unit_json(unit) for unit in monitor.units],
        "verdict": monitor.verdict,
        "inputs": monitor.inputs,
        "shows": monitor.shows,
        "since_us": monitor.since_us,
        "which": list(monitor.which),
        "states": monitor.states,
        "counted": dict(monitor.counted),
    }


def _monitor_row(monitor: Monitor, now_us: int) -> tuple[str, ...]:
    colour = _SHOWN.get(monitor.shows, "yellow")
    since = print_span(max(0, now_us - monitor.since_us)) if monitor.since_us is not None else ""
    missing = (f"platform {name}" if name in monitor.units else name for name in monitor.which)
    which = "".join(f"\n{verbatim(name)}" for name in missing)
    return (
        monitor.by,
        monitor.name,
        ", ".join(monitor.units),
        f"[{colour}]{monitor.shows}[/{colour}]",
        monitor.verdict,
        f"{monitor.inputs}{which}",
        since,
    )


# Acts


def acts(call: Call, *, follow: bool) -> int:
    """The acts that passed the interface agents, in order, then, with `follow`, new ones; 1 if there are none."""
    told = 0
    with connected(call) as client:
        units = _there(client, follow=follow)
        lists = [(unit, said) for unit, said in _remembered(client, units, ActList()) if isinstance(said, ActList)]
        known = [(unit, log) for unit, said in lists for log in said.acts or ()]
        for unit, log in sorted(known, key=lambda entry: entry[1].at_us):
            _tell_act(call, unit, log)
            told += 1
        if follow:
            following = Following(client, Acts())
            while True:
                for unit, said in following.news(_STEP_S):
                    if isinstance(said, ActLog):
                        _tell_act(call, unit, said)
    return DONE if told else NO


def _tell_act(call: Call, unit: str, log: ActLog) -> None:
    if call.out.json_lines:
        call.out.line(
            {
                "unit": unit_json(unit),
                "at_us": log.at_us,
                "direction": log.direction,
                "peer": unit_json(log.peer),
                "outcome": log.outcome,
                "act": log.act,
            }
        )
        return
    arrow = "<-" if log.direction == "in" else "->"
    good = log.outcome in {"accepted", "sent"}
    outcome = log.outcome if good else f"[yellow]{verbatim(log.outcome)}[/yellow]"
    call.out.console.print(
        f"[dim]{clock_time(log.at_us)}[/dim]  [bold]{unit}[/bold] {arrow} {verbatim(log.peer)}  {outcome}"
    )
    if log.act is not None:
        call.out.console.print(_spoken(log.act), markup=False, style="dim")


def _spoken(text: str) -> str:
    """The act as FIPA has it, without what only its delivery needs."""
    try:
        return str(replace(parse_act(text), boot=0, seq=0, created_us=0, acks=()))
    except TextError:
        return text
