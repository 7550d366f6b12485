"""Output of a running specification: samples, alarms, and the state of its streams."""

import json
from pathlib import Path
from typing import Any

from console.command import Call
from console.output.output import counted, verbatim
from dyknow.model.instants import US_PER_S, print_span
from runtime.configuration.instants import clock_time


def tell_record(call: Call, said: dict[str, Any], *, begins_us: int | None = None) -> None:
    """One JSON line of a platform; what is none of these is not shown. Times since `begins_us`, or by the clock."""
    kind = str(said.get("event"))
    if kind not in _SHOWN:
        return
    shown_us = said.get("valid_us", said.get("at_us") if begins_us is None else None)
    when = "" if shown_us is None else _when(shown_us, begins_us)
    text = _SHOWN[kind](said)
    if call.out.json_lines or not when:
        call.out.say(text, **said)
    elif kind == "sample":
        call.out.console.print(f"[dim]{when}[/]  {text}", soft_wrap=True, highlight=False)
    else:
        call.out.aside(when, text)


def _when(valid_us: int, begins_us: int | None) -> str:
    return clock_time(valid_us) if begins_us is None else f"{(valid_us - begins_us) / 1000:10.10g} ms"


def _sample(said: dict[str, Any]) -> str:
    late_ms = round((said["available_us"] - said["valid_us"]) / 1000, 1)
    approximated = [
        f"{label} {origin['manner']}{_old(said['valid_us'], origin['valid_us'])}"
        for label, origin in said.get("origins", {}).items()
        if origin["manner"] != "exact"
    ]
    how = f"; {', '.join(approximated)}" if approximated else ""
    value = verbatim(_short(said["value"]))
    return f"[bold]{verbatim(said['stream'])}[/]  {value}  [dim]{late_ms:g} ms later{verbatim(how)}[/]"


def _old(valid_us: int, of_us: int | None) -> str:
    """How much older a value is than the state it is in, from a second on."""
    return "" if of_us is None or valid_us - of_us < US_PER_S else f", {print_span(valid_us - of_us)} old"


def _specified(said: dict[str, Any]) -> str:
    parts = [counted(said["declarations"], "declaration")]
    if said["exports"]:
        parts.append(f"exports {', '.join(said['exports'])}")
    if said["imports"]:
        parts.append(f"imports {', '.join(f'{label} from {unit}' for label, unit in said['imports'])}")
    return f"[green]runs[/] {verbatim(Path(said['file']).name)}: {verbatim('; '.join(parts))}"


def _stream(said: dict[str, Any]) -> str:
    name = verbatim(said["stream"])
    return f"[green]{name} has a producer[/]" if said["linked"] else f"[yellow]{name} has no producer[/]"


def _alarm(said: dict[str, Any]) -> str:
    shown = ", ".join(f"{label} = {_short(value)}" for label, value in said["values"].items())
    opened = said["event"] == "alarm-opened"
    return f"[{'red' if opened else 'green'}]{said['event'].replace('-', ' ')}[/]  {verbatim(said['monitor'])}  {verbatim(shown)}"


def _short(value: Any) -> str:
    """Seven decimals are a centimetre of latitude; all there are go to `--json`."""
    if value is None:
        return "no value"
    if isinstance(value, list):
        return f"[{', '.join(map(_short, value))}]"
    return f"{round(value, 7):.12g}" if isinstance(value, float) else json.dumps(value, ensure_ascii=False)


_SHOWN = {
    "sample": _sample,
    "specified": _specified,
    "stream": _stream,
    "note": lambda said: f"[yellow]note[/] {verbatim(str(said.get('text')))}",
    "alarm-opened": _alarm,
    "alarm-closed": _alarm,
}
