"""`dyknow imports`: which streams come in where, and what became of their samples."""

from typing import Annotated, Any

import typer

from dyknow.console.centre.client import connected
from dyknow.console.command import Call, command
from dyknow.console.errors import DONE, NO
from dyknow.console.output.output import unit_json
from dyknow.console.output.shown import styled
from dyknow.federation.messages.contents import ImportCounts, ImportList
from dyknow.runtime.library.jobs import lists


@command(example="dyknow imports --unit 0")
def imports(
    call: Call,
    *,
    unit: Annotated[str | None, typer.Option("--unit", metavar="U", help="One platform only.")] = None,
) -> int:
    """The streams that platforms receive from each other, and the samples that are missing; exit 1 if there is none."""
    with connected(call) as client:
        units = client.chosen(unit)
        with call.out.waiting("asking for imports"):
            answers = client.run(lists(client, units, ImportList(), ImportList))
        found = [(receiver, one) for receiver, said in answers for one in said.imports or ()]
        found.sort(key=lambda each: (each[0], each[1].owner, each[1].semantic_label))
    for receiver, one in found if call.out.json_lines else ():
        call.out.line(_record(receiver, one))
    if not call.out.json_lines and found:
        rows = [
            (
                receiver,
                one.semantic_label,
                one.owner,
                str(one.received),
                str(one.recovered),
                *_gaps(one),
                _how_often(one),
            )
            for receiver, one in found
        ]
        heads = ("to", "label", "from", "received", "recovered", "missing", "lost", "sent")
        call.out.table("", heads, rows, whole=("label",))
    elif not found:
        call.out.note("no platform imports a stream; monitors and specifications do, e.g. import LABEL from U as NAME.")
    return DONE if found else NO


def _gaps(one: ImportCounts) -> tuple[Any, Any]:
    return tuple(styled(str(count), "red") if count else "0" for count in (one.missing, one.lost))  # type: ignore[return-value]


def _how_often(one: ImportCounts) -> Any:
    return "all" if one.every == 1 else styled(f"one of {one.every}", "yellow")


def _record(receiver: str, one: ImportCounts) -> dict[str, Any]:
    """One stream, for `--json`."""
    return {
        "unit": unit_json(receiver),
        "label": one.semantic_label,
        "of": unit_json(one.owner),
        "hash": one.hash,
        "received": one.received,
        "recovered": one.recovered,
        "duplicates": one.duplicates,
        "stale": one.stale,
        "missing": one.missing,
        "lost": one.lost,
        "every": one.every,
        "delay_s": one.delay_s,
    }
