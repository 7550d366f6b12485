"""`dyknow kpl`: specifications, and files of chronicles, checked and printed back."""

import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from dyknow.console.arguments import Roads, UnitModules
from dyknow.console.command import Call, command
from dyknow.console.commands.texts.graphs import GraphForm, show_graph
from dyknow.console.commands.texts.specification_files import add_streams_of_platforms, instance_of, read_text
from dyknow.console.errors import DONE, NO
from dyknow.console.output.output import counted
from dyknow.console.output.shown import line, styled
from dyknow.model.errors import NothingFound, TextError, TextErrors, WrongCall
from dyknow.proxies.files.named_files import beside

if TYPE_CHECKING:
    from dyknow.kpl import Specification

CHRONICLES = ".chr"
"""So ends the name of a file of chronicles."""


@command(example="dyknow kpl check mission.kpl")
def check(
    call: Call,
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="A specification, mission.kpl, or chronicles, overtake.chr.")
    ],
    modules: UnitModules = None,
    roads: Roads = None,
) -> int:
    """Every error of a specification with its place and repair, and unreachable declarations; exit 1 if there is an error."""
    from dyknow import Network
    from dyknow.kpl import Hooks, read_specification
    from dyknow.kpl.introspection.governor import speaks

    text = read_text(file)
    if file.suffix == CHRONICLES:
        return _check_chronicles(call, text)
    try:
        specification, errors, unread = read_specification(text, beside(file))
    except TextError as wrong:
        specification, errors, unread = (), [wrong], frozenset()
    network, units = Network(), modules or ()
    speaks(network)
    network.now_us = time.time_ns() // 1000
    labels = call.settings.ontology
    instance = instance_of(network, Hooks(), units, "0", labels=labels, roads=roads)
    taken = add_streams_of_platforms(specification, instance, labels)
    findings = instance.findings(specification, (), text, unread)
    code = _report(call, len(specification), [*errors, *findings.errors], findings.warnings)
    if taken:
        call.out.note(f"note: {', '.join(taken)}: of the platform; checked as on one that has it.")
    _tell_library(call, specification, units)
    return code


def _tell_library(call: Call, specification: "Specification", modules: Sequence[str]) -> None:
    """Note declared units that are checked as the library's, since a module may have one of that name."""
    from dyknow.compunits import catalogue
    from dyknow.kpl.syntax.specification import UnitDeclaration

    there = catalogue(modules)
    names = [each.name for each in specification if isinstance(each, UnitDeclaration) and there.is_ours(each.name)]
    if names:
        call.out.note(
            f"note: {', '.join(names)} {'is' if len(names) == 1 else 'are'} checked as the library's; for units of "
            "your own of that name give --units MODULE."
        )


@command(example="dyknow kpl show mission.kpl")
def show(
    call: Call,
    file: Annotated[
        Path | None,
        typer.Argument(metavar="[FILE]", help="A specification, mission.kpl, or chronicles, overtake.chr."),
    ] = None,
    unit: Annotated[
        str | None, typer.Option(metavar="U", help="Instead of a file: the specification of this running platform.")
    ] = None,
    configuration: Annotated[
        int | None, typer.Option(metavar="N", min=0, help="That of an earlier configuration.")
    ] = None,
    restore: Annotated[
        int | None, typer.Option(metavar="N", min=0, help="Have it hold that configuration again.")
    ] = None,
) -> int:
    """A specification as it is understood, one declaration a line: of a file, or of a running platform."""
    if file is not None and unit is None:
        return _show_file(call, file)
    if file is None and unit is not None:
        return held(call, unit, number=configuration, restore=restore)
    raise WrongCall("give a FILE, or --unit U for what a running platform holds.")


@command(example="dyknow kpl graph cars.kpl --form mermaid")
def graph(
    call: Call,
    file: Annotated[Path | None, typer.Argument(metavar="[FILE]", help="A specification, mission.kpl.")] = None,
    modules: UnitModules = None,
    roads: Roads = None,
    unit: Annotated[
        str | None,
        typer.Option(metavar="U", help="The unit for `self`; without a file: the network of this running platform."),
    ] = None,
    form: Annotated[GraphForm, typer.Option("--form", "--format", help="How it is drawn.")] = "text",
) -> int:
    """The network of a specification, or of a running platform with rates, delays and drops: each stream and its inputs."""
    from dyknow import Network
    from dyknow.kpl import Hooks, parse_specification
    from dyknow.kpl.introspection.governor import listens, speaks

    if file is None:
        if unit is None:
            raise WrongCall("give a FILE, or --unit U for what a running platform does.")
        return held(call, unit, form="json" if call.out.json_lines else form)
    text = read_text(file)
    specification, network = parse_specification(text, beside(file)), Network()
    if listens(specification):
        speaks(network)
    labels = call.settings.ontology
    instance = instance_of(network, Hooks(), modules or (), unit or "0", labels=labels, roads=roads)
    add_streams_of_platforms(specification, instance, labels)
    instance.add(specification, 0, text)
    show_graph(call, instance, form)
    return DONE


def _show_file(call: Call, path: Path) -> int:
    from dyknow.kpl import parse_specification, print_declaration

    if path.suffix == CHRONICLES:
        return _show_chronicles(call, path)
    specification: Specification = parse_specification(read_text(path), beside(path))
    for declaration in specification:
        said = print_declaration(declaration)
        if call.out.json_lines:
            call.out.line({"line": declaration.place.line, "declaration": said})
        else:
            call.out.plain(f"{said}\n")
    return DONE


def _check_chronicles(call: Call, text: str) -> int:
    from dyknow.kpl import read_chronicles

    try:
        found, errors = read_chronicles(text)
    except TextError as wrong:
        return _report(call, 0, [wrong])
    return _report(call, len(found.declarations), errors)


def _report(call: Call, declarations: int, found: Iterable[TextError], warnings: Sequence[TextError] = ()) -> int:
    """Print the errors, or, where there are none, the warnings, and how many there are; the exit code."""
    errors = sorted(found, key=lambda error: (error.line, error.column))
    warnings = () if errors else warnings
    for one in errors or warnings:
        _say(call, "error" if errors else "warning", one)
    if not call.out.json_lines:
        counts = ((declarations, "declaration"), (len(errors), "error"), (len(warnings), "warning"))
        call.out.show(", ".join(counted(number, what) for number, what in counts))
    return NO if errors else DONE


def _show_chronicles(call: Call, path: Path) -> int:
    from dyknow.kpl import parse_chronicles, print_chronicles

    found = parse_chronicles(read_text(path))
    if call.out.json_lines:
        call.out.line({"declaration": print_chronicles(found)})
    else:
        call.out.plain(print_chronicles(found))
    return DONE


def held(
    call: Call,
    unit: str,
    *,
    number: int | None = None,
    restore: int | None = None,
    form: GraphForm | Literal["kpl"] = "kpl",
) -> int:
    """What a running platform holds, or held in an earlier configuration; with `restore` it holds that again.

    In another form than KPL: the graph of what runs now.
    """
    from dyknow.console.centre.client import connected
    from dyknow.federation.messages.acts import Performative
    from dyknow.federation.messages.contents import RestoreSpecification, Specification, SpecificationText
    from dyknow.runtime.library.jobs import failure_of

    with connected(call) as client:
        client.chosen(unit)
        if restore is not None:
            said = RestoreSpecification(number=restore)
            [dialogue] = client.ask([unit], said, Performative.REQUEST, 3.0)
            if dialogue.trouble:
                raise failure_of(dialogue, "")
            words = line(styled("restored", "green"), f" configuration {restore}")
            call.out.say(words, event="restored", unit=unit, number=restore)
            return DONE
        question = Specification(number=number, form="json" if form == "svg" else form)
        [dialogue] = client.ask([unit], question, Performative.QUERY_REF, 3.0)
    pages = [said for said in dialogue.results if isinstance(said, SpecificationText)]
    if dialogue.trouble or not pages:
        raise NothingFound(f"platform {unit}: {dialogue.trouble or 'no answer came'}")
    text = "".join(page.text for page in pages)
    if form == "svg":
        call.out.plain(_picture(unit, text), folds=False)
    elif form != "kpl":
        call.out.plain(text, folds=form == "text")
    elif call.out.json_lines:
        about = {"unit": unit, "number": pages[0].number, "last": pages[0].last, "at_us": pages[0].at_us}
        call.out.line({**about, "specification": text})
    else:
        call.out.plain(text)
        newest = pages[0].number == pages[0].last
        held_since = "what it holds now" if newest else f"{pages[0].last} is what it holds now"
        call.out.note(f"configuration {pages[0].number}: {held_since}")
    return DONE


def _picture(unit: str, text: str) -> str:
    """Draw a platform's network from its own description."""
    from dyknow.kpl.introspection.drawings import graph_of_json
    from dyknow.kpl.introspection.picture import as_svg

    try:
        return as_svg(graph_of_json(text))
    except (ValueError, TypeError, KeyError) as wrong:
        raise NothingFound(f"platform {unit}: what it says of its network is none: {wrong}") from wrong


def _say(call: Call, severity: str, found: TextError) -> None:
    for one in found.errors if isinstance(found, TextErrors) else (found,):
        call.out.say(
            line(styled(severity, "red" if severity == "error" else "yellow"), f" {one.drawn()}"),
            severity=severity,
            file=one.file,
            line=one.line,
            column=one.column,
            message=one.message,
            repair=one.repair,
        )
