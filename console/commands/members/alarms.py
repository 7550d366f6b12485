"""`dyknow alarms`: alarms of the monitors of all platforms, once or as they come."""

from collections.abc import Iterable, Mapping
from typing import Annotated, Any

import typer

from dyknow.console.arguments import Count, Follow
from dyknow.console.centre.client import connected
from dyknow.console.command import Call, command
from dyknow.console.errors import DONE, NO
from dyknow.console.output.output import counted, unit_json
from dyknow.console.output.shown import Shown, line, styled
from dyknow.federation.messages.contents import Alarm, AlarmList, Because, MonitorChange, MonitorEntry, MonitorProximity
from dyknow.model.instants import print_span
from dyknow.runtime.client import Client
from dyknow.runtime.configuration.instants import clock_time
from dyknow.runtime.library.alarm_news import AlarmItem, AlarmNews
from dyknow.runtime.library.jobs import lists, tasks
from dyknow.runtime.library.jobs import monitors as all_monitors
from dyknow.runtime.library.questions import gone_text, missing_units, query_missing
from dyknow.runtime.library.results import PlatformChange

_STEP_S = 0.2
_COLOURS = {"opened": "red", "closed": "green", "ended": "yellow"}
UNWATCHED = "lacks a monitor that is delegated for all platforms"
_UNITS = {"_m_s": "m/s", "_m": "m", "_deg": "deg", "_s": "s", "_us": "us"}


# Alarms


@command(example="dyknow alarms --follow")
def alarms(
    call: Call,
    *,
    follow: Follow = False,
    count: Count = None,
    explain: Annotated[
        bool, typer.Option("--explain", help="Which part of the formula opened each, by which samples.")
    ] = False,
) -> int:
    """Alarms raised by monitors of all platforms, in the order of their detection; exit 1 if there are none."""
    told: set[tuple[str, str]] = set()
    is_open: set[str] = set()

    def tell(found: list[AlarmItem]) -> bool:
        """Print what is new; whether that is enough."""
        for each in found:
            if not isinstance(each, Alarm):
                _tell_change(call, each)
        alarms = [each for each in found if isinstance(each, Alarm)]
        for alarm in sorted(alarms, key=lambda alarm: (alarm.detected_us, alarm.event != "opened")):
            if (alarm.id, alarm.event) not in told and (count is None or len(told) < count):
                told.add((alarm.id, alarm.event))
                _tell_alarm(call, alarm, is_open=alarm.id in is_open, explain=explain)
        return count is not None and len(told) >= count

    with connected(call) as client:
        units = _there(client, follow=follow)
        remembered = client.run(lists(client, units, AlarmList(), AlarmList))
        known = [alarm for _, said in remembered for alarm in said.alarms or ()]
        is_open.update({alarm.id for alarm in known} - {alarm.id for alarm in known if alarm.event != "opened"})
        enough = tell([*known[-count:]] if count is not None and not follow else [*known])
        if follow and not enough:
            if not is_open and not call.out.json_lines:
                _note_calm(call, client)
            is_open.clear()
            news = AlarmNews(client)
            while not tell(client.run(news.next(_STEP_S))):
                pass
        elif not follow:
            found = client.run(all_monitors(client))
            if not told and not call.out.json_lines:
                call.out.note("no alarm; dyknow monitors shows what is watched.")
            tell_unknown(call, client, found)
    return DONE if told else NO


def _note_calm(call: Call, client: Client) -> None:
    """That no alarm is open, and how far the two nearest platforms are from each other."""
    from dyknow.console.centre.separation import closest

    pair = closest(client)
    more = "" if pair is None else f"; the nearest two are {pair[0]} and {pair[1]}, {pair[2]:.0f} m from each other"
    call.out.note(f"no alarm is open now{more}. Ctrl-C ends this.")


def _there(client: Client, *, follow: bool) -> list[str]:
    """The platforms to ask; with `follow` there may be none yet."""
    if follow:
        return [seen.unit for seen in client.settle()]
    return client.chosen(None)


def _tell_alarm(call: Call, alarm: Alarm, *, is_open: bool, explain: bool = False) -> None:
    """One alarm; `is_open`: it was opened before, and has not been closed."""
    if call.out.json_lines:
        call.out.line(alarm_json(alarm))
        return
    colour = _COLOURS[alarm.event]
    delay = f"{print_span(alarm.detected_us - alarm.valid_us)} after the sample"
    if alarm.made_us is not None:
        delay = f"predicted {print_span(alarm.valid_us - alarm.made_us)} ahead"
    when = "its monitor was removed" if alarm.event == "ended" else delay
    monitor, by = styled(alarm.monitor, "bold"), styled(f"by {alarm.by}, {when}", "dim")
    values = ", ".join(_quantity(name, value, alarm) for name, value in alarm.values.items())
    reasons = "".join(f"\n{reason_text(each)}" for each in alarm.because) if explain else ""
    more: Shown = styled(f"\n{values}{reasons}" if values else reasons, "dim")
    still: Shown = styled(", still open", "red") if is_open else ""
    call.out.aside(
        clock_time(alarm.valid_us),
        line(styled(alarm.event, colour), "  ", monitor, f" {', '.join(alarm.units)}  ", by, still, more),
    )


def _quantity(name: str, value: Any, alarm: Alarm) -> str:
    """A value with its unit; whose it is where that is not the whole of `alarm.units`."""
    from dyknow.reasoning.features.derivation import (
        FEATURES,  # a tenth of a second, for those that have an alarm to show
    )

    feature, _, about = name.partition("[")
    whose = {one.strip() for one in about.rstrip("]").split(",")}
    shown = feature if whose == {*alarm.units} else name
    if not isinstance(value, int | float) or isinstance(value, bool):
        return f"{shown} {value}"
    unit = FEATURES[feature].unit if feature in FEATURES else _unit_of(feature)
    if unit == "us":
        return f"{shown} {print_span(round(value)) if round(value) else '0 s'}"
    return f"{shown} {value:.1f} {unit}".rstrip()


def _unit_of(field: str) -> str:
    """The unit with which the name of a field ends, e.g. m of `alt.altitude_m`."""
    return next((unit for ending, unit in _UNITS.items() if field.endswith(ending)), "")


def reason_text(reason: Because) -> str:
    """`because xy_dist[0, 1] >= 15 is false: xy_dist[0, 1] 11.0`, and since when a temporal part needed it."""
    samples = ", ".join(f"{name} {_value_text(name, value)}" for name, value in reason.samples.items())
    within = ""
    if reason.within is not None and reason.since_us is not None:
        within = f", which {reason.within} needs since {clock_time(reason.since_us)}"
    return f"because {reason.part} is {'true' if reason.holds else 'false'}{': ' if samples else ''}{samples}{within}"


def _value_text(name: str, value: Any) -> str:
    """A value of a state; times in seconds."""
    from dyknow.reasoning.features.derivation import FEATURES

    feature = FEATURES.get(name.partition("[")[0])
    if feature is not None and feature.unit == "us" and isinstance(value, int | float):
        return print_span(round(value)) if round(value) else "0 s"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _known(values: Mapping[str, Any]) -> dict[str, Any]:
    """The values there are, as JSON has them."""
    return {name.replace(", ", ","): v for name, v in values.items() if isinstance(v, bool | int | float | str)}


def alarm_json(alarm: Alarm) -> dict[str, Any]:
    """An alarm as a JSON line has it."""
    values = _known(alarm.values)
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
        "because": because_json(alarm.because),
        **({} if alarm.made_us is None else {"made_us": alarm.made_us}),
    }


def because_json(reasons: Iterable[Because]) -> list[dict[str, Any]]:
    """The reasons of an alarm as a JSON line has them."""
    return [
        {
            "part": each.part,
            "holds": each.holds,
            "samples": _known(each.samples),
            "members": _known(each.members),
            "in": each.within,
            "since_us": each.since_us,
            "until_us": each.until_us,
        }
        for each in reasons
    ]


def _tell_change(call: Call, change: MonitorChange | PlatformChange) -> None:
    """Report a change that makes alarms unknown, or ends that."""
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
        missing = f": {', '.join(input_names(change))} missing" if change.which else ""
        monitor, by = styled(change.monitor, "bold"), styled(f"by {change.by}", "dim")
        text = line(styled(change.event, colour), "  ", monitor, f" {units}{missing}  ", by)
    if call.out.json_lines:
        call.out.line(record)
    else:
        call.out.aside(clock_time(at_us), text)


def input_names(monitor: MonitorEntry | MonitorChange) -> list[str]:
    return [f"platform {name}" if name in monitor.units else name for name in monitor.which]


def _unwatched(client: Client, there: list[str], found: list[MonitorEntry]) -> list[str]:
    """The platforms that lack a monitor which a task over all platforms wants of each."""
    having: dict[str, set[str]] = {unit: set() for unit in there}
    for monitor in found:
        having.get(monitor.by, set()).add(monitor.name)
    if len(set(map(frozenset, having.values()))) < 2:
        return []
    listed = client.run(tasks(client, there))
    wanted = {name for _, task in listed if task.task == MonitorProximity.head for name in task.monitors}
    return [unit for unit in there if wanted - having[unit]]


def tell_unknown(call: Call, client: Client, found: list[MonitorEntry]) -> None:
    """How many monitors are unknown, which platforms are gone with theirs, and which lack one that is delegated for all."""
    unknown = sum(monitor.shows == "unknown" for monitor in found)
    there = [view.unit for view in client.centre.platforms()]
    gone = client.run(missing_units(there, query_missing(client, there)))
    for unit, ago_us in gone.items():
        if call.out.json_lines:
            call.out.line({"by": unit_json(unit), "error": gone_text(ago_us)})
        else:
            call.out.note(f"platform {unit}: {gone_text(ago_us)}, and its monitors with it", style="red")
    for unit in _unwatched(client, [unit for unit in there if unit not in gone], found):
        if call.out.json_lines:
            call.out.line({"by": unit_json(unit), "error": UNWATCHED})
        else:
            call.out.note(f"platform {unit} {UNWATCHED}", style="red")
    if unknown and call.out.json_lines:
        call.out.line({"monitors": len(found), "unknown": unknown})
    elif unknown:
        call.out.note(
            f"{unknown} of {counted(len(found), 'monitor')} {'is' if unknown == 1 else 'are'} unknown", style="red"
        )
