"""`dyknow kpl add`, `remove` and `load`: the specifications of running platforms, changed from elsewhere."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dyknow.console.centre.client import connected
from dyknow.console.command import Call, command
from dyknow.console.commands.texts.specification_files import read_text
from dyknow.console.errors import DONE
from dyknow.console.output.output import unit_json
from dyknow.console.output.shown import line, styled
from dyknow.model.errors import SourceText, WrongCall
from dyknow.proxies.files.named_files import beside

if TYPE_CHECKING:
    from dyknow.federation.messages.contents import Content, NamedText, SpecificationChanged

Units = Annotated[
    list[str], typer.Option("--unit", metavar="U", help="The platform to change (repeatable).", show_default=False)
]
Given = Annotated[str, typer.Argument(metavar="TEXT", help="Declarations, or a file of them that ends with .kpl.")]
SUFFIX = ".kpl"
_ANSWER_S = 5.0


@command(example="dyknow kpl add 'monitor low = always altitude[self] > 30' --unit 0")
def add(call: Call, text: Given, *, unit: Units) -> int:
    """Have running platforms declare more; their present declarations continue."""
    from dyknow.federation.messages.contents import AddDeclarations

    given, files = _read(text)
    return _change(call, AddDeclarations(text=given, files=files, file=given.file), unit)


@command(example="dyknow kpl load mission.kpl --unit 0 --unit 1")
def load(call: Call, text: Given, *, unit: Units) -> int:
    """Have running platforms hold this specification in place of theirs; declarations of both continue."""
    from dyknow.federation.messages.contents import LoadSpecification

    given, files = _read(text)
    return _change(call, LoadSpecification(text=given, files=files, file=given.file), unit)


@command(example="dyknow kpl remove low 'stream speed' --unit 0")
def remove(
    call: Call,
    names: Annotated[
        list[str],
        typer.Argument(metavar="NAME...", help="The declared names, with their kind where that is not clear."),
    ],
    *,
    unit: Units,
) -> int:
    """Have running platforms declare something no more."""
    from dyknow.federation.messages.contents import RemoveDeclarations
    from dyknow.federation.messages.contents.platform import MAX_NAMES

    if len(names) > MAX_NAMES or any(len(name) > 1024 for name in names):
        raise WrongCall(f"at most {MAX_NAMES} names are removed at once, each of at most 1024 characters.")
    return _change(call, RemoveDeclarations(names=tuple(names)), unit)


def _read(given: str) -> "tuple[SourceText, tuple[NamedText, ...]]":
    """A text and the files that it names; raises WrongCall and TextErrors, before anything is sent."""
    from dyknow.federation.messages.contents import NamedText
    from dyknow.federation.messages.contents.parts import LONGEST_TEXT
    from dyknow.federation.messages.contents.platform import MAX_FILES
    from dyknow.kpl import parse_specification

    path = Path(given) if given.endswith(SUFFIX) else None
    text = SourceText(given, "TEXT") if path is None else read_text(path)
    read_file, files = beside(path or Path()), dict[str, str]()

    def read_named(name: str) -> str:
        files[name] = read_file(name)
        return files[name]

    parse_specification(text, read_named)
    for name, one in ((text.file, str(text)), *files.items()):
        if len(one) > LONGEST_TEXT:
            raise WrongCall(
                f"{name} has {len(one)} characters, and a speech act brings at most {LONGEST_TEXT} of a text: add it in "
                "parts, or start the platform with --spec FILE."
            )
    if len(files) > MAX_FILES:
        raise WrongCall(f"{text.file} names {len(files)} files, and a speech act brings at most {MAX_FILES}.")
    return text, tuple(NamedText(path=name, text=one) for name, one in files.items())


def _change(call: Call, content: "Content", units: list[str]) -> int:
    """Ask every platform, show what each has done, and raise the first refusal."""
    from dyknow.federation.messages.acts import Performative
    from dyknow.federation.messages.contents import SpecificationChanged
    from dyknow.runtime.library.jobs import failure_of

    with connected(call) as client:
        chosen = list(dict.fromkeys(name for unit in units for name in client.chosen(unit)))
        dialogues = client.ask(chosen, content, Performative.REQUEST, _ANSWER_S)
    for dialogue in dialogues:
        for said in dialogue.results:
            if isinstance(said, SpecificationChanged):
                _show(call, dialogue.unit, said)
    failed = [one for one in dialogues if one.trouble or not one.results]
    if failed:
        raise failure_of(failed[0], "no answer came")
    return DONE


def _show(call: Call, unit: str, said: "SpecificationChanged") -> None:
    if call.out.json_lines:
        call.out.line({"event": "specified", "unit": unit_json(unit), **said.model_dump()})
        return
    for sign, style, lines in (("+", "green", said.added), ("-", "red", said.removed)):
        for one in lines:
            call.out.show(line(f"{unit}  ", styled(sign, style), f" {one}"))
    if said.more:
        call.out.show(f"{unit}  and {said.more} more")
    if not (said.added or said.removed):
        call.out.show(f"{unit}  holds that already")
    for warning in said.warnings:
        call.out.note(f"platform {unit}: {warning}")
    before = f"; dyknow kpl show --unit {unit} --restore {said.number - 1} goes back" if said.number else ""
    call.out.note(f"platform {unit} holds configuration {said.number}{before}")
