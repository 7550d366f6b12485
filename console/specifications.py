"""`dyknow kpl`: specifications, and files of chronicles, checked and printed back."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from console.command import Call
from console.errors import DONE, NO, NothingFound, WrongCall
from console.output import verbatim
from dyknow.errors import TextError, TextErrors
from proxies.named_files import beside

if TYPE_CHECKING:
    from kpl import Specification

GraphForm = Literal["kpl", "text", "json", "mermaid", "dot"]
LONGEST_FILE = 1 << 20
CHRONICLES = ".chr"
"""So ends the name of a file of chronicles."""


def check(call: Call, path: Path, *, units: Sequence[str] = (), unit: str = "0") -> int:
    """Every error and every warning, each at its place; 1 if there is an error."""
    from console.specification_runs import instance_of
    from dyknow import Network
    from kpl import Hooks, read_specification
    from kpl.governor import speaks

    text = read_text(path)
    if path.suffix == CHRONICLES:
        return _check_chronicles(call, text, path)
    try:
        specification, errors, unread = read_specification(text, str(path), beside(path))
    except TextError as wrong:
        specification, errors, unread = (), [wrong], frozenset()
    network = Network()
    speaks(network)
    findings = instance_of(network, Hooks(), units, unit).findings(specification, (), text, str(path), unread)
    errors = sorted([*errors, *findings.errors], key=lambda error: (error.line, error.column))
    warnings = () if errors else findings.warnings
    for severity, found in (*(("error", one) for one in errors), *(("warning", one) for one in warnings)):
        _say(call, severity, found)
    _tell_library(call, specification, units)
    if not call.out.json_lines:
        call.out.console.print(_summary(len(specification), len(errors), len(warnings)))
    return NO if errors else DONE


def _tell_library(call: Call, specification: "Specification", modules: Sequence[str]) -> None:
    """Declared units that are looked at as the library's, where somebody may have one of that name."""
    from compunits import catalogue
    from kpl.specification import UnitDeclaration

    there = catalogue(modules)
    names = [each.name for each in specification if isinstance(each, UnitDeclaration) and there.is_ours(each.name)]
    if names:
        call.out.note(
            f"note: {', '.join(names)} {'is' if len(names) == 1 else 'are'} looked at as in the library; for units of "
            "your own so called give --units MODULE."
        )


def show(call: Call, path: Path) -> int:
    """The specification as the instance would print it: one declaration a line."""
    from kpl import parse_specification, print_declaration

    if path.suffix == CHRONICLES:
        return _show_chronicles(call, path)
    specification: Specification = parse_specification(read_text(path), str(path), beside(path))
    for declaration in specification:
        said = print_declaration(declaration)
        if call.out.json_lines:
            call.out.line({"line": declaration.place.line, "declaration": said})
        else:
            call.out.plain(f"{said}\n")
    return DONE


def _check_chronicles(call: Call, text: str, path: Path) -> int:
    from kpl import read_chronicles

    declarations, errors = 0, list[TextError]()
    try:
        found, errors = read_chronicles(text, str(path))
        declarations = len(found.declarations)
    except TextError as wrong:
        errors = [wrong]
    errors = sorted(errors, key=lambda error: (error.line, error.column))
    for one in errors:
        _say(call, "error", one)
    if not call.out.json_lines:
        call.out.console.print(_summary(declarations, len(errors), 0))
    return NO if errors else DONE


def _show_chronicles(call: Call, path: Path) -> int:
    from kpl import parse_chronicles, print_chronicles

    found = parse_chronicles(read_text(path), str(path))
    if call.out.json_lines:
        call.out.line({"declaration": print_chronicles(found)})
    else:
        call.out.plain(print_chronicles(found))
    return DONE


def held(
    call: Call, unit: str, *, number: int | None = None, restore: int | None = None, form: GraphForm = "kpl"
) -> int:
    """What a running platform holds, or held in an earlier configuration; with `restore` it holds that again.

    In another form than KPL: the graph of what runs now.
    """
    from console.client import connected
    from console.errors import FederationFailed
    from federation.acts import Performative
    from federation.contents import RestoreSpecification, Specification, SpecificationText

    with connected(call) as client:
        client.chosen(unit)
        if restore is not None:
            said = RestoreSpecification(number=restore)
            dialogue = next(client.ask([unit], said, Performative.REQUEST, 3.0))
            if dialogue.trouble:
                failed = NothingFound if dialogue.trouble.startswith("refuse") else FederationFailed
                raise failed(f"platform {unit}: {dialogue.trouble}")
            call.out.say(f"[green]restored[/] configuration {restore}", event="restored", unit=unit, number=restore)
            return DONE
        dialogue = next(client.ask([unit], Specification(number=number, form=form), Performative.QUERY_REF, 3.0))
    pages = [said for said in dialogue.results if isinstance(said, SpecificationText)]
    if dialogue.trouble or not pages:
        raise NothingFound(f"platform {unit}: {dialogue.trouble or 'no answer came'}")
    text = "".join(page.text for page in pages)
    if form != "kpl":
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


def read_text(path: Path) -> str:
    try:
        if path.stat().st_size > LONGEST_FILE:
            raise WrongCall(f"{path} is larger than {LONGEST_FILE >> 10} kB: no specification is so long; split it.")
        return path.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise WrongCall(f"{path} cannot be read ({error}); a specification is a text file.") from None


def _say(call: Call, severity: str, found: TextError) -> None:
    for one in found.errors if isinstance(found, TextErrors) else (found,):
        call.out.say(
            f"[{'red' if severity == 'error' else 'yellow'}]{severity}[/] {verbatim(one.drawn())}",
            severity=severity,
            file=one.file,
            line=one.line,
            column=one.column,
            message=one.message,
            repair=one.repair,
        )


def _summary(declarations: int, errors: int, warnings: int) -> str:
    said = [counted(declarations, "declaration"), counted(errors, "error"), counted(warnings, "warning")]
    return ", ".join(said)


def counted(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"
