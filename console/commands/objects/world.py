"""`dyknow world`: the objects that exist, with degrees of belief, from recorded observations."""

from pathlib import Path
from typing import Annotated

import typer

from dyknow.console.command import Call, command
from dyknow.console.commands.objects.link import LeftOutLines
from dyknow.console.commands.texts.specification_files import read_text, recorded_lines
from dyknow.model.errors import WrongCall


@command(example="dyknow world kitchen.toml --observations kitchen.jsonl")
def world(
    call: Call,
    file: Annotated[Path, typer.Argument(metavar="MODEL.toml", help="Types, attributes, sensors and thresholds.")],
    *,
    observations: Annotated[
        Path | None,
        typer.Option(
            "--observations", metavar="FILE.jsonl", help="Recorded observations, JSON lines; - for standard input."
        ),
    ] = None,
    knowledge: Annotated[
        list[Path] | None,
        typer.Option(
            "--knowledge", metavar="FILE.toml", help="Prior knowledge: classes, rules, instances; repeatable."
        ),
    ] = None,
    task: Annotated[
        str, typer.Option("--task", metavar="T", help="Load only the knowledge that is needed for this task.")
    ] = "",
    learn: Annotated[
        Path | None, typer.Option("--learn", metavar="FILE.toml", help="Write here what is worth remembering.")
    ] = None,
) -> int:
    """Existing objects, their types and places, with degrees of belief; exit 2 if lines had to be left out."""
    from dyknow.anchoring.belief.environment import EnvironmentModel
    from dyknow.anchoring.belief.files.knowledge import print_known, read_knowledge
    from dyknow.anchoring.belief.files.lines import ObservationReader
    from dyknow.anchoring.belief.files.models import read_world_model
    from dyknow.anchoring.belief.knowledge.informed import InformedModel
    from dyknow.anchoring.belief.knowledge.memory import PriorKnowledge
    from dyknow.console.commands.objects.world_output import WorldOutput

    if observations is None:
        raise WrongCall("give the recorded observations: --observations FILE.jsonl.")
    model = read_world_model(read_text(file), str(file))
    bundles = [read_knowledge(read_text(each), model, str(each)) for each in knowledge or ()]
    prior = PriorKnowledge(model.types.names, bundles)
    informed = InformedModel(EnvironmentModel(model), prior)
    output, problems = WorldOutput(call, informed), LeftOutLines(call)
    output.on_selected(informed.select(model.area, task), given=bool(bundles))
    with recorded_lines(observations, "--observations", "recorded observations are a text of JSON lines") as lines:
        reader = ObservationReader(str(observations), model, problems.on_error)
        for look in reader.looks(lines):
            output.on_report(informed.on_look(look.valid_us, look.sensor, look.observations))
    output.end()
    if learn is not None:
        _write(learn, "\n".join(print_known(each, model) for each in prior.learnt.values()))
    return problems.end(str(observations))


def _write(file: Path, text: str) -> None:
    try:
        file.write_text(text, encoding="utf-8")
    except OSError as error:
        raise WrongCall(f"--learn: {file} cannot be written ({error.strerror}); choose another place.") from None
