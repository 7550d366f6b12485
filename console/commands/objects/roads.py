"""`dyknow roads`: files of road networks."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dyknow.console.command import Call, command
from dyknow.console.errors import DONE, NO
from dyknow.console.output.output import counted
from dyknow.console.output.shown import line, styled
from dyknow.runtime.configuration.road_files import read_bytes

if TYPE_CHECKING:
    from dyknow.anchoring.roads.files.problems import RoadProblem
    from dyknow.anchoring.roads.files.summary import RoadSummary
    from dyknow.anchoring.roads.network import RoadNetwork


@command(example="dyknow roads check town.geojson")
def check(
    call: Call,
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="GeoJSON, OpenStreetMap XML, or a SUMO network (.net.xml).")
    ],
) -> int:
    """The contents of a road network, and every problem of its file; exit 1 if one is an error."""
    from dyknow.anchoring.roads.files.formats import format_of, survey_any
    from dyknow.anchoring.roads.files.summary import summary_of

    text = read_bytes(file, "FILE")
    survey = survey_any(text)
    summary = None if survey.network is None else summary_of(survey.network)
    problems = survey.problems if summary is None else (*survey.problems, *summary.warnings())
    for problem in problems:
        _show(call, str(file), problem)
    errors = sum(each.severity == "error" for each in problems)
    warnings = len(problems) - errors
    about = {"format": format_of(text), "errors": errors, "warnings": warnings}
    if survey.left_out:
        call.out.note(f"{survey.left_out} more problems are not listed.")
    counts = f"{counted(errors, 'error')}, {counted(warnings, 'warning')}"
    if survey.network is None or summary is None:
        call.out.say(f"{file}: {about['format']}, {counts}", **about)
        return NO
    contents = _contents(survey.network, summary)
    call.out.say(f"{file}: {about['format']}, {_sentence(contents)}; {counts}", **about, **contents)
    return DONE


def _show(call: Call, file: str, problem: "RoadProblem") -> None:
    style = "red" if problem.severity == "error" else "yellow"
    about = {"feature": problem.feature, "id": problem.id, "message": problem.message, "repair": problem.remedy}
    call.out.say(
        line(styled(problem.severity, style), f" {file}: {problem.drawn}"),
        severity=problem.severity,
        file=file,
        **about,
    )


def _contents(network: "RoadNetwork", summary: "RoadSummary") -> dict[str, Any]:
    frame = network.frame
    origin = None if frame is None else [round(frame.latitude_deg, 7), round(frame.longitude_deg, 7)]
    numbers = {name: value for name, value in summary._asdict().items() if name != "hidden_links"}
    return numbers | {"length_m": round(summary.length_m, 1), "origin": origin}


def _sentence(contents: dict[str, Any]) -> str:
    """The elements of the network, its origin, and the manoeuvres that can be recognised on it."""
    parts = [counted(contents[name], name[:-1]) for name in ("crossings", "links", "lanes", "areas")]
    origin = contents["origin"]
    where = "x and y in metres" if origin is None else f"origin at {origin[0]:g}, {origin[1]:g}"
    graph = f"{counted(contents['parts'], 'part')}, {counted(contents['dead_ends'], 'dead end')}"
    kinds = ", ".join(f"{contents[kind]} {kind}" for kind in ("left", "right", "straight", "back"))
    recognised = (
        f"{counted(contents['turns'], 'turn')} ({kinds}), {counted(contents['forks'], 'fork')}, "
        f"{counted(contents['ways'], 'way')}, {counted(contents['both_ways'], 'link')} both ways"
    )
    return f"{', '.join(parts)}, {contents['length_m'] / 1000:.1f} km, {graph}, {where}; recognised: {recognised}"
