"""`dyknow info`: the contents of a recording of a federation."""

from datetime import timedelta
from pathlib import Path
from typing import Annotated, Any

import typer

from dyknow.console.command import Call, command
from dyknow.console.errors import DONE
from dyknow.console.output.output import counted, unit_json
from dyknow.console.output.shown import Shown, styled
from dyknow.federation.members.directory import unit_order
from dyknow.model.instants import EPOCH, print_span
from dyknow.runtime.configuration.instants import clock_time
from dyknow.runtime.recordings.recorded import FederationRecording, mend
from dyknow.runtime.recordings.recording_file import ACT, MONITOR
from dyknow.runtime.recordings.summary import AlarmSummary, RecordingSummary, StreamSummary, summary_of

_BEGINNING_US = 2_000_000
Recording = Annotated[Path, typer.Argument(metavar="FILE.mcap", help="A recording of a federation.")]


@command(example="dyknow info flight.mcap")
def info(
    call: Call,
    file: Recording,
    *,
    mended: Annotated[
        Path | None,
        typer.Option(metavar="NEW.mcap", help="Write what a recording that was cut off holds, with an index, here."),
    ] = None,
) -> int:
    """The contents of a recording: platforms, streams with their gaps, alarms, acts, and losses."""
    recording = FederationRecording(file)
    found = summary_of(recording)
    if call.out.json_lines:
        call.out.line(_json(file, found))
    else:
        _show(call, file, found)
    if mended is not None:
        count = mend(recording, mended)
        call.out.note(f"{counted(count, 'message')} written to {mended}.")
    return DONE


def _show(call: Call, file: Path, found: RecordingSummary) -> None:
    lasted_us = found.last_us - found.first_us
    speed = found.about.get("clock_speed", "1.0")
    call.out.show(
        styled(str(file), "bold"), f": federation {found.about.get('federation', '?')}, {_date(found.first_us)}, "
        f"{print_span(lasted_us)}{'' if speed == '1.0' else f' of a clock {speed} times as fast as the wall'}",
    )  # fmt: skip
    for at_us, unit, state in found.changes:
        if state != "alive" or (at_us - found.first_us) > _BEGINNING_US:
            call.out.aside(clock_time(at_us), f"platform {unit} {'is back' if state == 'alive' else f'is {state}'}")
    _show_streams(call, found)
    _show_alarms(call, found)
    kept = found.kinds
    call.out.show(f"{counted(kept[ACT], 'act')}, {counted(len(found.tasks), 'task')}")
    for text in found.tasks.values():
        call.out.show(f"  {text}")
    _show_missing(call, found)


def _show_streams(call: Call, found: RecordingSummary) -> None:
    rows: list[tuple[Shown, ...]] = [
        (each.unit, each.label, str(each.samples), _rate(each), _gaps(each)) for each in _streams(found)
    ]
    if rows:
        call.out.table("", ("platform", "label", "samples", "rate", "gaps"), rows, right=("samples", "rate"))
    else:
        call.out.note("no stream was recorded.")


def _streams(found: RecordingSummary) -> list[StreamSummary]:
    return sorted(found.streams.values(), key=lambda each: (*unit_order(each.unit), each.label))


def _rate(each: StreamSummary) -> str:
    return f"{1e6 / each.period_us:.3g} Hz" if each.period_us else ""


def _gaps(each: StreamSummary) -> Shown:
    if not each.gaps:
        return ""
    from_us, to_us = max(each.gaps, key=lambda gap: gap[1] - gap[0])
    longest = f"longest {print_span(to_us - from_us)} from {clock_time(from_us)}"
    return styled(f"{len(each.gaps)}, {longest}", "yellow")


def _show_alarms(call: Call, found: RecordingSummary) -> None:
    for each in sorted(found.alarms.values(), key=lambda one: (one.monitor, one.by, one.units)):
        call.out.show(
            styled(each.monitor, "bold"), f" {', '.join(each.units)} by {each.by}: opened {_times(each.opened)}",
            f", longest {print_span(each.longest_us)}" if each.closed else "",
            styled(", open at the end", "red") if each.is_open else "",
        )  # fmt: skip
    for (monitor, by, units), times in sorted(found.unknown.items()):
        call.out.show(styled(monitor, "bold"), f" {', '.join(units)} by {by}: unknown {_times(times)}")
    if not found.alarms:
        watched = "no alarm" if found.kinds[MONITOR] else "no alarm, and no monitor was set up"
        call.out.show(watched)


def _show_missing(call: Call, found: RecordingSummary) -> None:
    """Print the gaps of the recording in words: each loss is counted and shown."""
    if not found.is_whole:
        call.out.note(
            "it was not ended, as by a crash; --mended NEW.mcap gives what can be read an index.", style="yellow"
        )
    tell_unread(call, found.unread)
    for unit, messages in sorted(found.lost.items()):
        call.out.note(f"{counted(messages, 'message')} of platform {unit} were not kept: too many.", style="yellow")
    if found.skipped:
        call.out.note(
            f"{counted(found.skipped, 'message')} in it are of another form, and are left out.", style="yellow"
        )


def tell_unread(call: Call, unread: str) -> None:
    """Note what of a recording was not read, if anything."""
    if unread:
        call.out.note(f"{unread}.", style="yellow")


def _times(number: int) -> str:
    return "once" if number == 1 else f"{number} times"


def _date(at_us: int) -> str:
    return (EPOCH + timedelta(microseconds=at_us)).strftime("%Y-%m-%d %H:%M:%S UTC")


def _json(file: Path, found: RecordingSummary) -> dict[str, Any]:
    return {
        "file": str(file),
        "federation": found.about.get("federation"),
        "from_us": found.first_us,
        "to_us": found.last_us,
        "whole": found.is_whole,
        "unread": found.unread or None,
        "platforms": dict(found.platforms),
        "streams": [
            {
                "unit": unit_json(each.unit),
                "label": each.label,
                "samples": each.samples,
                "period_us": each.period_us,
                "first_us": each.first_us,
                "last_us": each.last_us,
                "gaps": [[*gap] for gap in each.gaps],
            }
            for each in _streams(found)
        ],
        "alarms": [_alarm_json(each) for each in found.alarms.values()],
        "unknown": [
            {"monitor": monitor, "by": unit_json(by), "units": [unit_json(unit) for unit in units], "times": times}
            for (monitor, by, units), times in found.unknown.items()
        ],
        "messages": dict(found.kinds),
        "tasks": dict(found.tasks),
        "acts": dict(found.acts),
        "lost": dict(found.lost),
        "skipped": found.skipped,
    }


def _alarm_json(each: AlarmSummary) -> dict[str, Any]:
    return {
        "monitor": each.monitor,
        "by": unit_json(each.by),
        "units": [unit_json(unit) for unit in each.units],
        "opened": each.opened,
        "longest_us": each.longest_us,
        "open": each.is_open,
        "edges": [[event, valid_us] for event, valid_us in each.edges],
    }
