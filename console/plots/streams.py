"""Samples of streams as a plot: a panel for each number of a label, a curve for each platform, gaps and alarms behind."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

from dyknow.console.plots.plot import Band, Curve, Plot, PlotPanel, joined
from dyknow.runtime.recordings.recorded import FederationRecording
from dyknow.runtime.recordings.recording_file import ALARM, MONITOR, SAMPLE
from dyknow.runtime.recordings.summary import LATEST_US, period_and_gaps

MOST_SAMPLES: Final = 500_000


class Point(NamedTuple):
    """One sample: its value by field, empty for none."""

    unit: str
    label: str
    valid_us: int
    value: Mapping[str, Any]


def stream_plot(title: str, points: Iterable[Point], alarms: Sequence[Band] = ()) -> Plot:
    """The plot of these samples, in the order of their labels and fields."""
    streams: dict[tuple[str, str], list[Point]] = {}
    for point in points:
        streams.setdefault((point.label, point.unit), []).append(point)
    panels: dict[tuple[str, str], PlotPanel] = {}
    for (label, unit), found in streams.items():
        found.sort(key=lambda point: point.valid_us)
        _, gaps = period_and_gaps([point.valid_us for point in found])
        for name in dict.fromkeys(name for point in found for name in point.value):
            curve = _curve(unit, name, found, gaps)
            if curve is not None:
                quantity = label if name == "value" else f"{label}\n{name}"
                panel = panels.setdefault((label, name), PlotPanel(quantity, [], [*alarms]))
                panel.curves.append(curve)
                panel.bands = joined([*panel.bands, *(Band("gap", from_us, to_us) for from_us, to_us in gaps)])
    return Plot(title, [*panels.values()])


def _curve(unit: str, name: str, points: Sequence[Point], gaps: Sequence[tuple[int, int]]) -> Curve | None:
    times, values = list[int](), list[float | None]()
    ends = {from_us for from_us, _ in gaps}
    for point in points:
        value = point.value.get(name)
        times.append(point.valid_us)
        values.append(float(value) if isinstance(value, bool | int | float) else None)
        if point.valid_us in ends:
            times.append(point.valid_us + 1)
            values.append(None)
    return Curve(f"platform {unit}", times, values) if any(value is not None for value in values) else None


def recorded_points(
    recording: FederationRecording, labels: Sequence[str], unit: str | None, from_us: int, to_us: int
) -> Iterator[Point]:
    """The samples of a recording of these labels, of one platform or all, valid between two instants."""
    wanted = frozenset(labels)
    count = 0
    for each in recording.messages(lambda topic: topic.rpartition("/")[2] in wanted):
        match each.schema, each.message:
            case str(schema), {"unit": str(of), "label": str(label), "valid_us": int(valid_us), "value": value} if (
                schema == SAMPLE and label in wanted and unit in {None, of} and from_us <= valid_us <= to_us
            ):
                count += 1
                if count > MOST_SAMPLES:
                    return
                yield Point(of, label, valid_us, value if isinstance(value, dict) else {})


def recorded_bands(recording: FederationRecording, unit: str | None, from_us: int, to_us: int) -> list[Band]:
    """When alarms were open, and monitors unknown, that are about one platform or any."""
    since: dict[tuple[Any, ...], int] = {}
    bands: list[Band] = []

    def change(key: tuple[Any, ...], at_us: int, *, begins: bool) -> None:
        if begins:
            since.setdefault(key, at_us)
        elif key in since:
            bands.append(Band(key[0], since.pop(key), at_us))

    for each in recording.messages(lambda topic: topic in {"/alarms", "/monitors"}):
        match each.schema, each.message:
            case str(schema), {"id": str(name), "event": str(event), "units": list(units), "valid_us": int(at_us)} if (
                schema == ALARM and 0 <= at_us <= LATEST_US and (unit is None or unit in units)
            ):
                change(("alarm", name), at_us, begins=event == "opened")
            case str(schema), {"change": str(event), "monitor": str(name), "by": str(by), "units": list(units)} if (
                schema == MONITOR and (unit is None or unit in units)
            ):
                change(("unknown", name, by, str(units)), each.at_us, begins=event == "unknown")
    bands += [Band(key[0], at_us, to_us) for key, at_us in since.items()]
    cut = [Band(each.kind, max(each.from_us, from_us), min(each.to_us, to_us)) for each in bands]
    return joined(each for each in cut if each.from_us < each.to_us)
