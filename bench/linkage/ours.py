"""Ours, by the command that users have: `dyknow link --json`, run in this process on a file of percepts and one of roads."""

import contextlib
import io
import json
import tempfile
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from bench.linkage.scores import Shown, Track
from dyknow.console.main import app
from dyknow.sim_uavs.roads.scenes import RoadRecording

WORLD = "world"


class Linked(NamedTuple):
    """Objects of each look, and what was reported of them."""

    tracks: list[Track]
    events: list[dict[str, Any]]

    def from_clutter(self, recording: RoadRecording) -> int:
        """How many objects were established from a percept of nothing that ended before its second was over."""
        clutter = {percept.percept for look in recording.looks for percept in look.percepts if percept.of is None}
        return sum(each["event"] == "established" and each["from"] in clutter for each in self.events)


def by_links(recording: RoadRecording, type_: str = WORLD, *, since_seen: bool = True) -> Linked:
    """The objects of one type that `dyknow link` makes of a recording; `since_seen`: also from before they were known, as is usual."""
    states: dict[int, dict[str, Shown]] = defaultdict(dict)
    events = []
    visible = {
        look.t_us // 1000: {percept.percept for percept in look.percepts if not percept.end} for look in recording.looks
    }
    for line in link_lines(recording, *(() if since_seen else ("--no-since-seen",))):
        if "event" in line:
            events.append(line)
        elif line["type"] == type_:
            seen = not visible[line["t_ms"]].isdisjoint(line["linked_to"])
            states[line["t_ms"]][line["symbol"]] = Shown(line["x_m"], line["y_m"], seen)
    return Linked([states[look.t_us // 1000] for look in recording.looks], events)


def link_lines(recording: RoadRecording, *options: str) -> Iterator[dict[str, Any]]:
    """What `dyknow link --json` prints of a scene with its roads."""
    with tempfile.TemporaryDirectory() as directory:
        roads = Path(directory, "roads.geojson")
        roads.write_text(json.dumps(recording.scene.roads), encoding="utf-8")
        return lines_of(recording.records(), "--roads", str(roads), *options)


def lines_of(records: Iterable[dict[str, Any]], *options: str) -> Iterator[dict[str, Any]]:
    """What it prints of some percepts."""
    with tempfile.TemporaryDirectory() as directory:
        percepts = Path(directory, "percepts.jsonl")
        percepts.write_text("".join(json.dumps(record) + "\n" for record in records), encoding="utf-8")
        out = _said("link", "--json", "--percepts", str(percepts), *options)
    return map(json.loads, out)


def _said(*words: str) -> Sequence[str]:
    out = io.StringIO()
    try:
        with contextlib.redirect_stdout(out):
            app(words, prog_name="dyknow")
    except SystemExit as end:
        if end.code:
            raise RuntimeError(f"dyknow {' '.join(words)} ended with {end.code}") from end
    return out.getvalue().splitlines()
