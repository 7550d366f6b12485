"""`dyknow match`: which percepts could be a described object, and the recovery if that is ambiguous."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from dyknow.console.command import Call, command
from dyknow.console.commands.objects.documents import read_document
from dyknow.console.errors import DONE


@command(example="dyknow match examples/matching/marked.json")
def match(
    call: Call,
    file: Annotated[
        Path, typer.Argument(metavar="FILE.json", help="A description and percepts; - for standard input.")
    ],
    *,
    draw: Annotated[Literal["svg"] | None, typer.Option(help="Only a picture: percepts by properties.")] = None,
) -> int:
    """Which percepts match a description: one of the five anchoring cases, the anchors, the recovery, and reasons."""
    from dyknow.anchoring.matching.files import read_matching, situation_json
    from dyknow.anchoring.matching.situations import classify

    given = read_matching(*read_document(file))
    for sentence in given.ignored:
        call.out.note(sentence, style="yellow")
    situation = classify(given.description, given.percepts, given.options)
    if draw is None or call.out.json_lines:
        call.out.line(situation_json(situation))
    else:
        from dyknow.console.output.drawings import situation_svg

        call.out.plain(situation_svg(situation))
    return DONE
