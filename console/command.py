"""The declaration of a command: its own options, the options of all commands, and the exit codes of its errors."""

import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from inspect import Parameter, signature
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias, TypeVar

import typer
from typer.core import TyperCommand, TyperGroup, TyperOption
from typer.main import get_command

from dyknow.console.errors import DONE, INTERRUPTED, WRONG, exit_code
from dyknow.console.output.output import Output
from dyknow.console.output.shown import printable
from dyknow.model.errors import DyknowError

if TYPE_CHECKING:
    from dyknow.console.declared import Declared
    from dyknow.runtime.configuration.settings import Settings

PANEL = "Federation and output"


@dataclass(frozen=True, slots=True)
class Call:
    """The context of every command: its options from all their sources, and its output."""

    settings: "Settings"
    out: Output


F = TypeVar("F", bound=Callable[..., int])
CommandTable: TypeAlias = Mapping[str, tuple[str, str]]
"""CommandGroup by name (`kpl check` is `check` of the group `kpl`): `module:function`, or "" of a group, and a summary."""
_EXAMPLES: dict[Callable[..., int], str] = {}


def command(*, example: str) -> Callable[[F], F]:
    """Declare `function(call, own options...) -> exit code` as a command; its docstring is the help.

    An option that `dyknow.runtime.configuration.settings.Settings` also knows takes its value from there when no flag gives it.
    """

    def declare(function: F) -> F:
        _EXAMPLES[function] = example
        return function

    return declare


USAGE: Any = typer.BadParameter.__mro__[1]
"""The exception of a call that cannot be parsed: typer's own copy of click's UsageError."""
BARE: Mapping[str, str] = {"--control": "guided", "--wait": "acceptance", "-w": "acceptance"}
"""Options that may stand without a value, and the value that they then have; their metavar has brackets."""
WORDS: Mapping[str, frozenset[str]] = dict.fromkeys(("--wait", "-w"), frozenset({"acceptance", "arrival"}))
"""The values of options that may stand anywhere, also before a word that is none of their values."""


class OwnCommand(TyperCommand):
    """A command whose options may leave out their value where `BARE` has one."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        whole = [
            part
            for given, after in zip_longest(args, args[1:], fillvalue="-")
            for part in ([given, BARE[given]] if self._is_bare(given, after) else [given])
        ]
        try:
            self._check_once(ctx, whole)
            return super().parse_args(ctx, whole)
        except USAGE as error:
            name = getattr(error, "option_name", None)
            known = next((each for each in self.params if name in each.opts), None)
            if isinstance(known, TyperOption) and known.help:
                error.message += f" {name}: {known.help}"
            elif name and not getattr(error, "possibilities", True):
                error.message = f"No such option: {name}. {ctx.command_path} --help lists those there are."
            raise

    def _is_bare(self, given: str, after: str) -> bool:
        """Whether an option is given without a value: the next word is none of its values."""
        options: list[Any] = [each for each in self.params if given in BARE and given in each.opts]
        if not any((each.metavar or "").startswith("[") for each in options):
            return False
        return after.startswith("-") or (given in WORDS and after not in WORDS[given])

    def _check_once(self, ctx: Any, args: list[str]) -> None:
        """Refuse an option that is given again where only its last value would count."""
        if ctx.resilient_parsing or "--help" in args or "-h" in args:
            return
        _, _, given = self.make_parser(ctx).parse_args(args=list(args))
        options: list[Any] = [each for each in given if isinstance(each, TyperOption)]
        for option in options:
            if options.count(option) > 1 and not option.multiple and not option.is_flag:
                text = f"given {options.count(option)} times, and it takes one value; call the command once for each."
                raise typer.BadParameter(text, ctx, option)


class CommandGroup(TyperGroup):
    """A group whose commands are imported when they are called; until then a summary stands for each."""

    def __init__(self, *, table: CommandTable, **options: Any) -> None:
        super().__init__(**options)
        self.table: dict[str, tuple[str, str]] = {}
        self.register(table)

    def register(self, table: CommandTable) -> None:
        """Add commands; existing ones stay as they are."""
        self.table = {**table, **self.table}
        for name, (where, summary) in table.items():
            if " " not in name and name not in self.commands:
                self.commands[name] = TyperCommand(name, help=summary) if where else self._group(name, summary)

    def _group(self, name: str, summary: str) -> "CommandGroup":
        table = {key.removeprefix(f"{name} "): entry for key, entry in self.table.items() if key.startswith(f"{name} ")}
        return CommandGroup(table=table, name=name, help=summary, no_args_is_help=True, rich_markup_mode="rich")

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that is called, imported."""
        name, found, rest = super().resolve_command(ctx, args)
        where = self.table[name][0] if name in self.table else ""
        return name, loaded(where, str(name)) if where else found, rest


def loaded(where: str, name: str) -> Any:
    """The command that `module:function` declares, with the options of every command added."""
    module, _, attribute = where.partition(":")
    function: Callable[..., int] = getattr(import_module(module), attribute)
    from dyknow.console.declared import Declared

    declared = Declared(list(signature(function, eval_str=True).parameters.values())[1:], name)

    def run(context: typer.Context, **given: Any) -> None:
        raise typer.Exit(_carried_out(function, context, given, declared))

    shown = (*declared.parameters, *_COMMON)
    parameters = [_CONTEXT, *(each.replace(kind=Parameter.KEYWORD_ONLY) for each in shown)]
    run.__doc__ = function.__doc__
    run.__signature__ = signature(run).replace(parameters=parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    single = typer.Typer(add_completion=False, rich_markup_mode="rich")
    single.command(name, cls=OwnCommand, epilog=f"Example: [cyan]{_EXAMPLES[function]}[/cyan]")(run)
    return get_command(single)


def _option(*names: str, metavar: str | None = None, help: str) -> Any:  # noqa: A002  (as typer calls it)
    """One of the options of every command."""
    return typer.Option(*names, metavar=metavar, help=help, rich_help_panel=PANEL)


_LISTEN = "Listen here, e.g. tcp/127.0.0.1:7447 (repeatable)."
_CONNECT = "Connect to this endpoint (repeatable); no multicast then."
_NAME = "Which federation: commands and platforms of one name never see another's."
_INTERFACE = "Network interface of multicast; lo: nothing leaves the machine."
_KEY = "Private key of the member to speak as. [default: that of cc, or of the platform, next to the roster]"
_JSON = "One JSON object a line on standard output, nothing else."
_ONTOLOGY = "Semantic labels that not every platform has."
_EXTENSION = "A module with commands, or parts of platforms (repeatable)."


def _common(
    federation: Annotated[str, _option(metavar="NAME|FILE.toml", help=_NAME)] = "default",
    listen: Annotated[list[str] | None, _option(metavar="ENDPOINT", help=_LISTEN)] = None,
    connect: Annotated[list[str] | None, _option(metavar="ENDPOINT", help=_CONNECT)] = None,
    discover: Annotated[str, _option(metavar="multicast|none", help="How processes find each other.")] = "multicast",
    interface: Annotated[str, _option(metavar="IF", help=_INTERFACE)] = "lo",
    roster: Annotated[
        Path | None, _option(metavar="FILE", help="Roster of members: acts are signed, links are mutual TLS.")
    ] = None,
    key: Annotated[Path | None, _option(metavar="FILE", help=_KEY)] = None,
    ontology: Annotated[Path | None, _option(metavar="FILE.toml", help=_ONTOLOGY)] = None,
    json_lines: Annotated[bool, _option("--json", help=_JSON)] = False,
    extensions: Annotated[list[str] | None, _option("--extension", metavar="MODULE", help=_EXTENSION)] = None,
    config: Annotated[Path | None, _option(metavar="FILE.toml", help="Options from a file.")] = None,
) -> None:
    """The options of every command; only its signature is used."""


_COMMON = list(signature(_common).parameters.values())
_CONTEXT = Parameter("context", Parameter.POSITIONAL_OR_KEYWORD, annotation=typer.Context)


def _carried_out(
    function: Callable[..., int], context: typer.Context, given: dict[str, Any], declared: "Declared"
) -> int:
    """Run the command; its errors become a sentence on standard error and an exit code."""
    from pydantic import ValidationError

    from dyknow.runtime.configuration.settings import Settings, load

    config = given.pop("config")
    flags = {name: value for name, value in given.items() if _flagged(context, name) and name in Settings.model_fields}
    try:
        settings = load(flags, config)
        if settings.extensions:
            search_working_directory()
        chosen = {name: given[name] for name in declared.own}
        for name in declared.own:
            if name in Settings.model_fields and (value := getattr(settings, name)) is not None:
                chosen[name] = value
        chosen |= declared.read({name: value for name, value in given.items() if _flagged(context, name)})
        return function(Call(settings, Output(json_lines=settings.json_lines)), **chosen)
    except DyknowError as error:
        sys.stderr.write(f"{context.command_path}: {printable(str(error))}\n")
        return exit_code(error)
    except ValidationError as error:  # of the message to a platform
        from dyknow.federation.messages.contents.parts import in_words

        sys.stderr.write(f"{context.command_path}: {printable(in_words(error))}\n")
        return WRONG
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:
        # The reader of our lines has closed its end (`dyknow alarms --follow | head`); nothing is left to be flushed.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE


def search_working_directory() -> None:
    """Have modules in the working directory found, as the processes of platforms find them."""
    if (folder := str(Path.cwd())) not in sys.path:
        sys.path.insert(0, folder)


def _flagged(context: typer.Context, name: str) -> bool:
    """Whether this option was given on the command line."""
    source = context.get_parameter_source(name)
    return source is not None and source.name == "COMMANDLINE"
