"""`dyknow alarms`, `monitors` and `acts`: what platforms report of themselves, once or as it happens."""

from typing import Any

from console.centre.client import connected
from console.command import Call, command
from console.commands.members.ended_tasks import warn_of_ended
from console.errors import DONE, NO
from console.options.arguments import Count, Follow
from console.output.output import counted, unit_json
from console.output.shown import Shown, line, styled
from dyknow.model.errors import TextError
from dyknow.model.instants import print_span
from federation.messages.acts import Performative, parse_act
from federation.messages.contents import (
    IDLE,
    ActList,
    ActLog,
    Acts,
    Alarm,
    AlarmList,
    MonitorChange,
    MonitorEntry,
)
from runtime.client import Client
from runtime.configuration.instants import clock_time
from runtime.library.alarm_news import AlarmItem, AlarmNews
from runtime.library.jobs import Subscriptions, lists
from runtime.library.jobs import monitors as all_monitors
from runtime.library.questions import ask_who_is_missing, gone_text, missing_units
from runtime.library.results import PlatformChange

P = Performative
_STEP_S = 0.2
_SHOWN = {"ok": "green", "alarm": "red"}


# Alarms


@command(example="dyknow alarms --follow")
def alarms(call: Call, *, follow: Follow = False, count: Count = None) -> int:
    """Alarms raised by monitors of all platforms, in the order of their detection; exit 1 if there are none."""
    told: set[tuple[str, str]] = set()

    def tell(found: list[AlarmItem]) -> bool:
        """Print what is new; whether that is enough."""
        for each in found:
            if not isinstance(each, Alarm):
                _tell_change(call, each)
        alarms = [each for each in found if isinstance(each, Alarm)]
        for alarm in sorted(alarms, key=lambda alarm: (alarm.detected_us, alarm.event == "closed")):
            if (alarm.id, alarm.event) not in told and (count is None or len(told) < count):
                told.add((alarm.id, alarm.event))
                _tell_alarm(call, alarm)
        return count is not None and len(told) >= count

    with connected(call) as client:
        units = _there(client, follow=follow)
        remembered = client.run(lists(client, units, AlarmList(), AlarmList))
        known = [alarm for _, said in remembered for alarm in said.alarms or ()]
        enough = tell([*known[-count:]] if count is not None and not follow else [*known])
        if follow and not enough:
            news = AlarmNews(client)
            while not tell(client.run(news.next(_STEP_S))):
                pass
        elif not follow:
            found = client.run(all_monitors(client))
            if not told and not call.out.json_lines:
                call.out.note("no alarm; dyknow monitors shows what is watched.")
            tell_unknown(call, client, found)
    return DONE if told else NO


def _there(client: Client, *, follow: bool) -> list[str]:
    """The platforms to ask; with `follow` there may be none yet."""
    if follow:
        return [seen.unit for seen in client.settle()]
    return client.chosen(None)


def _tell_alarm(call: Call, alarm: Alarm) -> None:
    if call.out.json_lines:
        call.out.line(alarm_json(alarm))
        return
    colour = "red" if alarm.event == "opened" else "green"
    delay = print_span(alarm.detected_us - alarm.valid_us)
    monitor, by = styled(alarm.monitor, "bold"), styled(f"by {alarm.by}, {delay} after the sample", "dim")
    values = ", ".join(_quantity(name, value) for name, value in alarm.values.items())
    more: Shown = styled(f"\n{values}", "dim") if values else ""
    units = f" {', '.join(alarm.units)}  "
    call.out.aside(clock_time(alarm.valid_us), line(styled(alarm.event, colour), "  ", monitor, units, by, more))


def _quantity(name: str, value: Any) -> str:
    """A feature for a table; the units are in another column, and a duration is not read as microseconds."""
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


def _tell_change(call: Call, change: MonitorChange | PlatformChange) -> None:
    """What makes it unknown whether there are alarms, or ends that."""
    colour = "green" if change.event in {"known", "back"} else "yellow" if change.event in {"ended", "left"} else "red"
    if isinstance(change, PlatformChange):
        unit, at_us = change.unit, change.at_us
        record: dict[str, Any] = {"event": change.event, "unit": unit_json(unit), "at_us": at_us}
        text = line(styled(change.event, colour), "  ", styled(unit, "bold"))
    else:
        at_us, units = change.at_us, ", ".join(change.units)
        record = {
            "event": change.event,
            "monitor": change.monitor,
            "by": unit_json(change.by),
            "units": [unit_json(unit) for unit in change.units],
            "which": list(change.which),
            "at_us": at_us,
        }
        missing = f": {', '.join(_input_names(change))} missing" if change.which else ""
        monitor, by = styled(change.monitor, "bold"), styled(f"by {change.by}", "dim")
        text = line(styled(change.event, colour), "  ", monitor, f" {units}{missing}  ", by)
    if call.out.json_lines:
        call.out.line(record)
    else:
        call.out.aside(clock_time(at_us), text)


def _input_names(monitor: MonitorEntry | MonitorChange) -> list[str]:
    return [f"platform {name}" if name in monitor.units else name for name in monitor.which]


def tell_unknown(call: Call, client: Client, found: list[MonitorEntry]) -> None:
    """How many monitors are unknown, and which platforms are gone with theirs; nothing where all are known."""
    unknown = sum(monitor.shows == "unknown" for monitor in found)
    there = [view.unit for view in client.centre.platforms()]
    gone = client.run(missing_units(there, ask_who_is_missing(client, there)))
    for unit, ago_us in gone.items():
        if call.out.json_lines:
            call.out.line({"by": unit_json(unit), "error": gone_text(ago_us)})
        else:
            call.out.note(f"platform {unit}: {gone_text(ago_us)}, and its monitors with it", style="red")
    if unknown and call.out.json_lines:
        call.out.line({"monitors": len(found), "unknown": unknown})
    elif unknown:
        call.out.note(
            f"{unknown} of {counted(len(found), 'monitor')} {'is' if unknown == 1 else 'are'} unknown", style="red"
        )


# Monitors


@command(example="dyknow monitors")
def monitors(call: Call) -> int:
    """Every monitor: its verdict, and whether its inputs are fresh; exit 1 if there is none."""
    with connected(call) as client:
        with call.out.waiting("asking for monitors"):
            found = client.run(all_monitors(client))
            warn_of_ended(call, client, client.chosen(None))
        for monitor in found if call.out.json_lines else ():
            call.out.line(_monitor_json(monitor))
        if found and not call.out.json_lines:
            now_us = client.federation_us()
            rows = [_monitor_row(monitor, now_us) for monitor in found]
            call.out.table("", ("by", "monitor", "units", "shows", "verdict", "inputs", "for"), rows)
        elif not found and not call.out.json_lines:
            call.out.note("no monitor is set up; begin with dyknow delegate monitor-proximity.")
        tell_unknown(call, client, found)
    return DONE if found else NO


def _monitor_json(monitor: MonitorEntry) -> dict[str, Any]:
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


def _monitor_row(monitor: MonitorEntry, now_us: int) -> tuple[Shown, ...]:
    colour = _SHOWN.get(monitor.shows, "yellow")
    since = print_span(max(0, now_us - monitor.since_us)) if monitor.since_us is not None else ""
    which = "".join(f"\n{name}" for name in _input_names(monitor))
    if monitor.shows == IDLE:
        return (monitor.by, monitor.name, "-", styled("has no other platform to watch", colour), "", "", "")
    return (
        monitor.by,
        monitor.name,
        ", ".join(monitor.units),
        styled(monitor.shows, colour),
        monitor.verdict,
        f"{monitor.inputs}{which}",
        since,
    )


# Acts


@command(example="dyknow acts --follow")
def acts(call: Call, *, follow: Follow = False) -> int:
    """The message log: speech acts of the interface agents, and the outcome of each; exit 1 if there are none."""
    told = 0
    with connected(call) as client:
        units = _there(client, follow=follow)
        remembered = client.run(lists(client, units, ActList(), ActList))
        known = [(unit, log) for unit, said in remembered for log in said.acts or ()]
        for unit, log in sorted(known, key=lambda entry: entry[1].at_us):
            _tell_act(call, unit, log)
            told += 1
        if follow:
            subscriptions = Subscriptions(client, Acts())
            while True:
                for unit, said in client.run(subscriptions.news(_STEP_S)):
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
    outcome: Shown = log.outcome if good else styled(log.outcome, "yellow")
    when = styled(clock_time(log.at_us), "dim")
    call.out.show(when, "  ", styled(unit, "bold"), f" {arrow} {log.peer}  ", outcome)
    if log.act is not None:
        call.out.show(styled(_spoken(log.act), "dim"))


def _spoken(text: str) -> str:
    """The act as FIPA has it, without what only its delivery needs."""
    try:
        return str(parse_act(text)._replace(boot=0, seq=0, created_us=0, acks=()))
    except TextError:
        return text
