"""`dyknow monitors`: the monitors, in a line for each kind, or one by one."""

from typing import Annotated, Any

import typer

from dyknow.console.centre.client import connected
from dyknow.console.command import Call, command
from dyknow.console.commands.members.alarms import because_json, input_names, reason_text, tell_unknown
from dyknow.console.commands.members.ended_tasks import warn_of_ended
from dyknow.console.errors import DONE, NO
from dyknow.console.output.output import unit_json
from dyknow.console.output.shown import Shown, line, styled
from dyknow.federation.messages.contents import IDLE, MonitorEntry
from dyknow.model.instants import print_span
from dyknow.runtime.library.jobs import monitors as all_monitors

_COLOURS = {"ok": "green", "alarm": "red"}
_ORDER = ("alarm", "unknown")


@command(example="dyknow monitors --long")
def monitors(
    call: Call,
    *,
    long: Annotated[bool, typer.Option("--long", "-l", "--all", help="Every monitor, with its inputs.")] = False,
    explain: Annotated[
        bool,
        typer.Option("--explain", help="Of those in alarm: which part of the formula does not hold, by which samples."),
    ] = False,
) -> int:
    """All monitors, and their states: a line for each kind of monitor; exit 1 if there is none."""
    with connected(call) as client:
        with call.out.waiting("asking for monitors"):
            found = client.run(all_monitors(client, explain=explain))
            warn_of_ended(call, client, client.chosen(None))
        for monitor in found if call.out.json_lines else ():
            call.out.line(_monitor_json(monitor))
        if call.out.json_lines:
            pass
        elif not found:
            call.out.note("no monitor is set up; begin with dyknow delegate monitor-proximity.")
        elif long:
            now_us = client.federation_us()
            rows = [_monitor_row(monitor, now_us) for monitor in found]
            call.out.table("", ("by", "monitor", "units", "shows", "verdict", "inputs", "for"), rows)
        else:
            for name in sorted({monitor.name for monitor in found}):
                _show_kind(call, name, [monitor for monitor in found if monitor.name == name])
        if explain and not call.out.json_lines:
            _explain(call, found)
        tell_unknown(call, client, found)
    return DONE if found else NO


def _explain(call: Call, found: list[MonitorEntry]) -> None:
    """Why the formula of each monitor in alarm does not hold."""
    for one in found:
        whose = line(styled(one.name, "bold"), f" of {', '.join(one.units)} by {one.by}: ")
        for reason in one.because:
            call.out.show(whose, reason_text(reason), whole=True)
    if not any(one.because for one in found):
        call.out.note("no alarm is open that could be explained.")


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
        **({"because": because_json(monitor.because)} if monitor.because else {}),
    }


def _monitor_row(monitor: MonitorEntry, now_us: int) -> tuple[Shown, ...]:
    colour = _COLOURS.get(monitor.shows, "yellow")
    since = print_span(max(0, now_us - monitor.since_us)) if monitor.since_us is not None else ""
    which = "".join(f"\n{name}" for name in input_names(monitor))
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


def _show_kind(call: Call, name: str, found: list[MonitorEntry]) -> None:
    """`proximity: 42 ok, 14 unknown (3)`: the monitors by state; other states than ok with the platforms concerned."""
    counts: list[Shown] = []
    shows = sorted({one.shows for one in found}, key=lambda word: (*_ORDER, word).index(word))
    for word in shows:
        these = [one for one in found if one.shows == word]
        text = f"{len(these)} {'without another platform to watch' if word == IDLE else word}"
        whose = _concerned(these) if word in _ORDER else ""
        counts += [", " if counts else "", styled(text, _COLOURS.get(word, "yellow")), f" ({whose})" if whose else ""]
    call.out.show(styled(name, "bold"), ": ", line(*counts))


def _concerned(found: list[MonitorEntry]) -> str:
    """The pairs in alarm; of monitors without inputs the platforms and inputs that are missing."""
    missing = sorted({name for one in found for name in one.which})
    units = sorted({name for name in missing if any(name in one.units for one in found)})
    return "; ".join(units or missing or sorted({", ".join(sorted(one.units)) for one in found}))
