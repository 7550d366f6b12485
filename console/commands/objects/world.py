"""`dyknow world`: what exists, and how sure that is, from recorded observations."""

from functools import partial as given
from pathlib import Path
from typing import Annotated

import typer

from console.command import Call, command
from console.commands.objects.link import LeftOutLines
from console.commands.texts.specification_files import opened, read_text
from dyknow.model.errors import WrongCall


@command(example="dyknow world kitchen.toml --observations kitchen.jsonl")
def world(
    call: Call,
    file: Annotated[Path, typer.Argument(metavar="MODEL.toml", help="Types, attributes, sensors and thresholds.")],
    *,
    observations: Annotated[
        Path | None, typer.Option("--observations", metavar="FILE.jsonl", help="Recorded observations, JSON lines.")
    ] = None,
) -> int:
    """What exists, its type and place, with degrees of belief; exit 2 if lines had to be left out."""
    from anchoring.belief.environment import EnvironmentModel
    from anchoring.belief.files.lines import ObservationReader
    from anchoring.belief.files.models import read_world_model
    from console.commands.objects.world_output import WorldOutput
    from reasoning.monitoring.json_lines import LIMIT_LINE

    if observations is None:
        raise WrongCall("give the recorded observations: --observations FILE.jsonl.")
    model = read_world_model(read_text(file), str(file))
    environment = EnvironmentModel(model)
    output, problems = WorldOutput(call, environment), LeftOutLines(call)
    with opened(observations, "--observations", "recorded observations are a text of JSON lines") as lines:
        reader = ObservationReader(str(observations), model, problems.on_error)
        for look in reader.looks(iter(given(lines.readline, LIMIT_LINE + 2), "")):
            output.on_report(environment.on_look(look.valid_us, look.sensor, look.observations))
    output.end()
    return problems.end(str(observations))
