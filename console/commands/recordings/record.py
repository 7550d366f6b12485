"""`dyknow record`: a member's view of the federation, as an MCAP file."""

import re
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from dyknow.console.arguments import Duration
from dyknow.console.centre.client import connected
from dyknow.console.command import Call, command
from dyknow.console.errors import DONE, FAILED, INTERRUPTED
from dyknow.console.output.output import counted
from dyknow.console.output.shown import line, styled
from dyknow.console.processes.supervision import interruptible
from dyknow.documents.durations import SHORTEST_US, duration_us
from dyknow.model.errors import WrongCall
from dyknow.model.instants import print_span
from dyknow.runtime.client import Client
from dyknow.runtime.library.questions import check_streamed
from dyknow.runtime.recorder.recorder import Recorder
from dyknow.runtime.recordings.recording_file import ACT, ALARM, SAMPLE, RecordingFile
from dyknow.runtime.recordings.summary import about_of

_SIZE = re.compile(r"([0-9]+(?:\.[0-9]+)?)\s*(kB|MB|GB)")
_BYTES = {"kB": 1_000, "MB": 1_000_000, "GB": 1_000_000_000}
_LEAST = 200_000
_STEP_S = 0.1


@command(example="dyknow record flight.mcap --duration 10min")
def record(
    call: Call,
    file: Annotated[Path, typer.Argument(metavar="FILE.mcap", help="A new file; it replaces nothing.")],
    *,
    label: Annotated[
        list[str] | None, typer.Option(metavar="LABEL", help="Only streams of this label (repeatable).")
    ] = None,
    every: Annotated[
        str | None, typer.Option(metavar="TIME", help="Sample period of all streams. [default: as offered]")
    ] = None,
    most: Annotated[str, typer.Option(metavar="SIZE", help="The recording ends before the file is larger.")] = "100MB",
    duration: Duration = None,
) -> int:
    """Record the federation until Ctrl-C: streams, alarms, monitors, speech acts, tasks and the directory."""
    if file.suffix.lower() != ".mcap":
        raise WrongCall(f"{file}: a recording is an MCAP file; write {file.with_suffix('.mcap')}.")
    for each in label or ():
        check_streamed(each)
    every_us = duration_us(every, option="--every", least_us=SHORTEST_US) if every else None
    lasts_us = duration_us(duration, option="--duration", least_us=SHORTEST_US) if duration else None
    most_bytes = _bytes(most)
    if file.exists() or not file.parent.is_dir():
        raise WrongCall(f"{file} is there already, or its folder is not; a recording is a new file.")
    with connected(call) as client:
        try:
            with interruptible():
                return _recorded(call, client, file, label or (), every_us, lasts_us, most_bytes)
        except KeyboardInterrupt:
            return INTERRUPTED


def _recorded(
    call: Call, client: Client, file: Path, labels: Iterable[str], every_us: int | None, lasts_us: int | None, most: int
) -> int:
    """Record from when a platform is there, whose clock is the federation's, until the time is over or Ctrl-C."""
    begun_us = client.now_us()
    if not client.settle():
        call.out.note("no platform is there yet; the recording begins with the first.")
    while not client.centre.platforms() and not _is_over(client, begun_us, lasts_us):
        client.step(_STEP_S)
    since_us = client.federation_us()
    about = about_of(call.settings.federation, client.centre.clock, client.centre.unit, since_us)
    with RecordingFile(file, about, client.now_us, most_bytes=most) as taken:
        recorder = Recorder(client, taken, labels, every_us, lambda text: call.out.note(text, style="yellow"))
        _say_begun(call, file, client)
        with suppress(KeyboardInterrupt):
            while taken.ended is None and not _is_over(client, begun_us, lasts_us):
                recorder.step()
        recorder.close()
    return _say_ended(call, recorder, taken, client.federation_us() - since_us)


def _is_over(client: Client, begun_us: int, lasts_us: int | None) -> bool:
    return lasts_us is not None and client.now_us() - begun_us >= lasts_us


def _bytes(text: str) -> int:
    found = _SIZE.fullmatch(text.strip())
    size = round(float(found[1]) * _BYTES[found[2]]) if found else 0
    if size < _LEAST:
        raise WrongCall(f"--most: {text!r} is no size of at least 200kB; write 100MB.")
    return size


def _say_begun(call: Call, file: Path, client: Client) -> None:
    units = [view.unit for view in client.centre.platforms()]
    call.out.say(
        line(styled("recording", "green"), f": {file}, platforms {', '.join(units) or 'as they come'}; Ctrl-C ends it"),
        event="recording",
        file=str(file),
        units=units,
    )


def _say_ended(call: Call, recorder: Recorder, taken: RecordingFile, lasted_us: int) -> int:
    counts = recorder.counts
    size = taken.path.stat().st_size if taken.path.exists() else 0
    if taken.ended not in {None, "closed"}:
        call.out.note(f"{taken.ended}; it ends here.", style="red" if taken.has_failed else "yellow")
    if taken.lost and not taken.has_failed:
        call.out.note(f"{counted(taken.lost, 'message')} could not be kept.", style="yellow")
    call.out.say(
        line(
            styled("recorded", "green"),
            f": {print_span(lasted_us)} of {counted(len(recorder.units), 'platform')}, {counted(counts[SAMPLE], 'sample')}, "
            f"{counted(counts[ALARM], 'edge')} of alarms, {counted(counts[ACT], 'act')}, {size / 1e6:.1f} MB",
        ),
        event="recorded",
        file=str(taken.path),
        lasted_us=lasted_us,
        units=recorder.units,
        samples=counts[SAMPLE],
        alarms=counts[ALARM],
        acts=counts[ACT],
        bytes=size,
        lost=taken.lost,
        ended=None if taken.ended == "closed" else taken.ended,
    )
    return FAILED if taken.has_failed else DONE
