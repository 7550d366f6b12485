"""Reports of platforms, as a recording has them."""

from collections.abc import Mapping
from typing import Any

from dyknow.federation.messages.acts import Act, parse_act
from dyknow.federation.messages.contents import ActLog, Alarm, MonitorChange, MonitorEntry
from dyknow.model.errors import TextError


def alarm_json(alarm: Alarm) -> dict[str, Any]:
    """An edge of an alarm as a recording has it."""
    return {
        "id": alarm.id,
        "event": alarm.event,
        "monitor": alarm.monitor,
        "by": alarm.by,
        "units": [*alarm.units],
        "valid_us": alarm.valid_us,
        "detected_us": alarm.detected_us,
        "values": _scalars(alarm.values),
        "samples": _scalars(alarm.samples),
        "because": [f"{each.part} is {'true' if each.holds else 'false'}" for each in alarm.because],
        **({} if alarm.made_us is None else {"made_us": alarm.made_us}),
    }


def monitor_json(entry: MonitorEntry | MonitorChange) -> dict[str, Any]:
    name = entry.name if isinstance(entry, MonitorEntry) else entry.monitor
    record: dict[str, Any] = {"by": entry.by, "monitor": name, "units": [*entry.units], "which": [*entry.which]}
    if isinstance(entry, MonitorEntry):
        record |= {"verdict": entry.verdict, "inputs": entry.inputs, "shows": entry.shows}
        if entry.margin is not None:
            record["margin"] = entry.margin
    return record


def change_in_words(change: MonitorChange) -> str:
    lacking = f": {', '.join(change.which)} missing" if change.which else ""
    return f"{change.monitor} of {', '.join(change.units)} by {change.by} is {change.event}{lacking}"


def _scalars(values: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in values.items() if isinstance(value, bool | int | float | str)}


def parsed_act(log: ActLog) -> Act | None:
    try:
        return None if log.act is None else parse_act(log.act)
    except TextError:
        return None
