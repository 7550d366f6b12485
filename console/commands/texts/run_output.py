"""Output of a running specification: samples, alarms, and the state of its streams."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from dyknow import Predicted
from dyknow.console.command import Call
from dyknow.console.output.output import counted
from dyknow.console.output.predictions import prediction_json, prediction_text
from dyknow.console.output.shown import Shown, line, styled
from dyknow.model.instants import US_PER_S, print_span
from dyknow.runtime.configuration.instants import clock_time


def tell_record(call: Call, said: dict[str, Any], *, begins_us: int | None = None) -> None:
    """One JSON line of a platform; other kinds are not shown. Times since `begins_us`, or by the clock."""
    kind = str(said.get("event"))
    if kind not in _SHOWN:
        return
    shown_us = said.get("valid_us", said.get("at_us") if begins_us is None else None)
    when = "" if shown_us is None else _when(shown_us, begins_us)
    text = _SHOWN[kind](said)
    if call.out.json_lines or not when:
        call.out.say(text, **said)
    elif kind == "sample":
        call.out.show(styled(when, "dim"), "  ", text, whole=True)
    else:
        call.out.aside(when, text)


def _when(valid_us: int, begins_us: int | None) -> str:
    return clock_time(valid_us) if begins_us is None else f"{(valid_us - begins_us) / 1000:10.10g} ms"


def _sample(said: dict[str, Any]) -> Shown:
    late_ms = round((said["available_us"] - said["valid_us"]) / 1000, 1)
    approximated = [
        f"{label} {origin['manner']}{_old(said['valid_us'], origin['valid_us'])}"
        for label, origin in said.get("origins", {}).items()
        if origin["manner"] != "exact"
    ]
    how = f"; {', '.join(approximated)}" if approximated else ""
    value = f"  {_short(said['value'])}  "
    if "prediction" in said:
        how += prediction_text({"valid_us": said["valid_us"], **prediction_json(Predicted(*said["prediction"]))})
    return line(styled(said["stream"], "bold"), value, styled(f"{late_ms:g} ms later{how}", "dim"))


def _old(valid_us: int, of_us: int | None) -> str:
    """How much older a value is than the state it is in, from a second on."""
    return "" if of_us is None or valid_us - of_us < US_PER_S else f", {print_span(valid_us - of_us)} old"


def _specified(said: dict[str, Any]) -> Shown:
    parts = [counted(said["declarations"], "declaration")]
    if said["exports"]:
        parts.append(f"exports {', '.join(said['exports'])}")
    if said["imports"]:
        parts.append(f"imports {', '.join(f'{label} from {unit}' for label, unit in said['imports'])}")
    return line(styled("runs", "green"), f" {Path(said['file']).name}: {'; '.join(parts)}")


def _stream(said: dict[str, Any]) -> Shown:
    name = said["stream"]
    return styled(f"{name} has a producer", "green") if said["linked"] else styled(f"{name} has no producer", "yellow")


def _producer(said: dict[str, Any]) -> Shown:
    if said["of"] is None:
        return line(styled("silent", "red"), f"  {said['label']}: all of its producers are silent")
    return line(styled("producer", "yellow"), f"  {said['label']} is from {said['of']} now")


def _alarm(said: dict[str, Any]) -> Shown:
    shown = ", ".join(f"{label} = {_short(value)}" for label, value in said["values"].items())
    colours = {"alarm-opened": "red", "alarm-closed": "green"}
    event = styled(said["event"].replace("-", " "), colours.get(said["event"], "yellow"))
    return line(event, f"  {said['monitor']}  {shown}")


def _found(said: dict[str, Any]) -> Shown:
    source = "" if said["from"] is None else f"  from {said['from']}"
    event = styled(said["event"], "yellow" if said["event"] == "lost" else "green")
    return line(event, "  ", styled(said["symbol"], "bold"), source, f": {said['because']}")


_SINCE_EVER: Final = -(2**59)
"""An earlier time is the instant of an initial value of a chronicle."""


def _short(value: Any) -> str:
    """Seven decimals are a centimetre of latitude; all there are go to `--json`."""
    if value is None:
        return "no value"
    if isinstance(value, int) and value < _SINCE_EVER:
        return "since ever"
    if isinstance(value, list):
        return f"[{', '.join(map(_short, value))}]"
    return f"{round(value, 7):.12g}" if isinstance(value, float) else json.dumps(value, ensure_ascii=False)


_NOTED: Final = {"warning": (styled("warning", "yellow"),), "error": (styled("error", "red"),)}
_SHOWN: dict[str, Callable[[dict[str, Any]], Shown]] = {
    "sample": _sample,
    "specified": _specified,
    "stream": _stream,
    "producer": _producer,
    "note": lambda said: line(*_NOTED.get(str(said.get("level")), (styled("note", "yellow"),)), f" {said.get('text')}"),
    "alarm-opened": _alarm,
    "alarm-closed": _alarm,
    "alarm-ended": _alarm,
    **dict.fromkeys(("find", "track", "reacquire", "lost"), _found),
}
