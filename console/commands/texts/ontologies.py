"""`dyknow ontology`: the meanings of semantic labels, in a file, or to the platforms of a federation."""

from pathlib import Path
from typing import Annotated, TypeAlias

import typer

from dyknow.console.centre.client import connected
from dyknow.console.command import Call, command
from dyknow.console.errors import DONE, NO
from dyknow.console.output.output import counted, unit_json
from dyknow.console.output.shown import line, styled
from dyknow.federation.sharing.ontology import default_ontology
from dyknow.model.errors import TextError, TextErrors
from dyknow.model.semantic_labels import BUILT_IN, SemanticLabel
from dyknow.runtime.configuration.ontologies import read_ontology
from dyknow.runtime.library.meanings import meanings, offering

OntologyFile: TypeAlias = Annotated[Path, typer.Argument(metavar="FILE.toml", help="A file of semantic labels.")]


@command(example="dyknow ontology show")
def show(
    call: Call,
    file: Annotated[
        Path | None, typer.Argument(metavar="[FILE.toml]", help="A file; without one: the federation.")
    ] = None,
) -> int:
    """The meaning of each semantic label: of a file, or to the platforms that run; exit 1 if two mean something different."""
    if file is not None:
        for label in default_ontology().extended(read_ontology(file), str(file)).own():
            _tell(call, label, [], [])
        return DONE
    with connected(call) as client:
        client.settle()
        client.pick(None)
        found = meanings(client)
        for name in sorted(found):
            for label, units in found[name].items():
                _tell(call, label, units, offering(client, name))
    differing = [name for name, each in found.items() if len(each) > 1]
    for name in differing:
        call.out.note(f"{name} does not mean the same to all: it is not shared between those that differ.")
    return NO if differing else DONE


@command(example="dyknow ontology check labels.toml")
def check(call: Call, file: OntologyFile) -> int:
    """Every error of a file of labels with its place and repair; exit 1 if there is one."""
    labels: tuple[SemanticLabel, ...] = ()
    errors: tuple[TextError, ...] = ()
    try:
        labels = default_ontology().extended(read_ontology(file), str(file)).own()
    except TextErrors as wrong:
        errors = wrong.errors
    for one in errors:
        about = {"line": one.line, "column": one.column, "message": one.message, "repair": one.repair}
        call.out.say(line(styled("error", "red"), f" {one.drawn()}"), severity="error", file=one.file, **about)
    if not call.out.json_lines:
        call.out.show(f"{counted(len(labels), 'label')}, {counted(len(errors), 'error')}")
    return NO if errors else DONE


def _tell(call: Call, label: SemanticLabel, units: list[str], offered: list[str]) -> None:
    if call.out.json_lines:
        sort = label.sort
        fields = {part.name: part.unit for part in sort.fields}
        about = {"fields": fields} if fields else {"unit_of_measurement": sort.unit}
        call.out.line(
            {"label": label.name, "sort": sort.name, **about, "meaning": label.meaning, "hash": label.type_hash}
            | {"place": label.place, "units": [unit_json(unit) for unit in units]}
            | {"offered_by": [unit_json(unit) for unit in offered]}
        )
        return
    of = "" if label.place == BUILT_IN or not units else f" (platform{'s' * (len(units) > 1)} {', '.join(units)})"
    call.out.show(styled(label.name, "bold"), f" : {label}", styled(of, "dim"))
