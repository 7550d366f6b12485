"""`dyknow saliency`: the persons that platforms have found, as a table, as JSON or as GeoJSON."""

import json
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import typer

from dyknow.console.centre.client import connected
from dyknow.console.command import Call, command
from dyknow.console.commands.texts.specification_files import read_text
from dyknow.console.errors import DONE, NO
from dyknow.model.instants import print_span
from dyknow.runtime.library.pictures.saliency import FoundPerson, SaliencyPicture, geojson, saliency_map
from dyknow.runtime.library.pictures.saliency_drawing import saliency_svg
from dyknow.runtime.library.pictures.supplies import supply_goals

Format: TypeAlias = Literal["table", "json", "geojson", "svg"]


@command(example="dyknow saliency --format geojson")
def saliency(
    call: Call,
    *,
    format_: Annotated[Format, typer.Option("--format", help="How the map is printed.")] = "table",
    supplies: Annotated[
        Path | None,
        typer.Option(
            metavar="PROBLEM.prob", help="Print goals that bring its boxes to the persons (mission --constraints)."
        ),
    ] = None,
    unit: Annotated[str | None, typer.Option("--unit", metavar="U", help="The map that this platform has.")] = None,
) -> int:
    """The persons that platforms have found, one map of all; exit 1 if there is none.

    Every platform has the entries of all others in its map; --unit shows that of one. Entries that platforms
    have refused are counted on standard error, with the member that sent them and the reason.
    """
    boxes = None if supplies is None else read_text(supplies)
    if boxes is not None:
        supply_goals((), boxes)  # before platforms are asked
    with connected(call) as client:
        picture = client.run(saliency_map(client, unit))
        if boxes is not None:
            goals = supply_goals(picture.persons, boxes)
            call.out.plain(goals.text)
            for name in goals.unsupplied:
                call.out.note(f"there is no box for {name}", style="yellow")
        elif format_ == "geojson":
            call.out.plain(f"{json.dumps(geojson(picture), indent=2)}\n")
        elif format_ == "svg":
            call.out.plain(saliency_svg(picture.persons))
        elif format_ == "json" or call.out.json_lines:
            for each in picture.persons:
                call.out.plain(f"{json.dumps(each.as_json())}\n")
        elif picture.persons:
            _table(call, picture, client.federation_us())
        else:
            call.out.note("no person was found: platforms whose cameras have detectors of persons look for them.")
        for left_out in picture.refused:
            call.out.note(f"left out: {left_out}", style="yellow")
    return DONE if picture.persons else NO


def _table(call: Call, picture: SaliencyPicture, now_us: int) -> None:
    columns = ("person", "by", "place", "sd", "thermal", "colour", "observed", "age")
    call.out.table("", columns, [_row(each, now_us) for each in picture.persons], whole=("person",))


def _row(each: FoundPerson, now_us: int) -> tuple[str, ...]:
    return (
        each.name, ", ".join(each.by), f"({each.x_m:.1f}, {each.y_m:.1f}) m", f"{each.sd_m:.1f} m",
        f"{each.thermal:.2f}", f"{each.colour:.2f}", f"{each.observed_s:.1f} s",
        print_span(max(0, now_us - each.seen_us)),
    )  # fmt: skip
