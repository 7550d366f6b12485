"""`dyknow plot`: values of streams over time, from running platforms or from a recording, as a picture."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from dyknow.console.arguments import Unit
from dyknow.console.command import Call, command
from dyknow.console.commands.recordings.info import tell_unread
from dyknow.console.errors import DONE
from dyknow.console.output.output import counted
from dyknow.console.plots.plot import MOST_PANELS, Band, Plot, check_file, draw
from dyknow.console.plots.streams import MOST_SAMPLES, Point, recorded_bands, recorded_points, stream_plot
from dyknow.federation.messages.contents import Reading
from dyknow.model.errors import NothingFound, did_you_mean
from dyknow.model.values import NoValue
from dyknow.runtime.configuration.instants import instant_us
from dyknow.runtime.library.questions import Which, check_name
from dyknow.runtime.recordings.recorded import FederationRecording
from dyknow.runtime.recordings.summary import RecordingSummary, summary_of

_TIMEOUT_S = 3.0


@command(example="dyknow plot heli-altitude --recording flight.mcap --to altitude.svg")
def plot(
    call: Call,
    labels: Annotated[list[str], typer.Argument(metavar="LABEL...", help="Semantic labels, e.g. heli-altitude.")],
    *,
    unit: Unit = None,
    between: Annotated[
        tuple[str, str],
        typer.Option(metavar="T1 T2", help="Valid between two times; in a recording +5s is after its first message."),
    ] = ("-60s", "now"),
    recording: Annotated[
        Path | None, typer.Option(metavar="FILE.mcap", help="From a recording instead of running platforms.")
    ] = None,
    to: Annotated[Path, typer.Option(metavar="FILE", help="The picture: .png, .svg or .pdf.")] = Path("plot.svg"),
) -> int:
    """Values of streams over time as a picture, with what lacks and the alarms that were open behind them."""
    check_file(to)
    for label in labels:
        check_name(label)
    if recording is not None:
        drawn, points = _from_recording(call, FederationRecording(recording), labels, unit, between)
    else:
        drawn, points = _from_platforms(call, labels, unit, between)
    if len(drawn.panels) > MOST_PANELS:
        call.out.note(f"{len(drawn.panels)} quantities are too many for a picture: the first {MOST_PANELS} are drawn.")
    if points >= MOST_SAMPLES:
        call.out.note(f"only the first {MOST_SAMPLES} samples are drawn; --between or --unit chooses others.")
    draw(drawn, to)
    call.out.say(
        f"{to}: {counted(points, 'sample')}", event="plotted", file=str(to), samples=points, panels=len(drawn.panels)
    )
    return DONE


def _from_recording(
    call: Call, recording: FederationRecording, labels: Sequence[str], unit: str | None, between: tuple[str, str]
) -> tuple[Plot, int]:
    found = summary_of(recording)
    from_us, to_us = _instants(found, between)
    points = [*recorded_points(recording, labels, unit, from_us, to_us)]
    tell_unread(call, found.unread)
    _check(labels, {point.label for point in points}, {label for _, label in found.streams}, recording.path)
    bands: list[Band] = recorded_bands(recording, unit, from_us, to_us)
    return stream_plot(f"{', '.join(labels)}: {recording.path.name}", points, bands), len(points)


def _instants(found: RecordingSummary, between: tuple[str, str]) -> tuple[int, int]:
    """Both instants: relative ones count from the first message; all of the recording unless something else is given."""
    if between == ("-60s", "now"):
        return 0, found.last_us
    from_us, to_us = (instant_us(text, found.first_us, option="--between") for text in between)
    return from_us, to_us


def _from_platforms(call: Call, labels: Sequence[str], unit: str | None, between: tuple[str, str]) -> tuple[Plot, int]:
    from dyknow.console.centre.client import connected
    from dyknow.runtime.library.jobs import readings_of

    points: list[Point] = []
    with connected(call) as client:
        client.settle()
        for label in labels:

            def take(name: str, readings: list[Reading], why: str, _answered_us: int, label: str = label) -> None:
                for reading in readings:
                    value = {} if isinstance(reading.value, NoValue) else dict(reading.value)
                    points.append(Point(name, label, reading.valid_us, value))
                if not readings:
                    call.out.note(f"platform {name}: {why or f'no sample of {label} then'}")

            client.run(readings_of(client, label, unit, Which(between=between), _TIMEOUT_S, take))
    if not points:
        raise NothingFound(f"no platform has a sample of {', '.join(labels)} between {between[0]} and {between[1]}.")
    return stream_plot(f"{', '.join(labels)}: federation {call.settings.federation}", points), len(points)


def _check(labels: Sequence[str], found: set[str], known: set[str], path: Path) -> None:
    for label in labels:
        if label not in found:
            raise NothingFound(f"{path} has no sample of {label} then.{did_you_mean(label, sorted(known))}")
