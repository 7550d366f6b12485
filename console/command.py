"""How a command is declared: its own options, those every command has, and what its errors become."""

import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from inspect import Parameter, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import typer

from console.errors import DONE, INTERRUPTED, exit_code
from console.output import Output
from dyknow.errors import DyknowError

if TYPE_CHECKING:
    from console.federations import FederationFile
    from console.settings import Settings

PANEL = "Federation and output"


@dataclass(frozen=True, slots=True)
class Call:
    """What every command is given: its options from all their sources, and where to put its words."""

    settings: "Settings"
    file: "FederationFile | None"
    out: Output


Command: TypeAlias = Callable[..., int]


def _common(
    federation: Annotated[
        str,
        typer.Option(
            metavar="NAME|FILE.toml",
            help="Which federation: commands and platforms of one name never see another's.",
            rich_help_panel=PANEL,
        ),
    ] = "default",
    listen: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ENDPOINT", help="Listen here, e.g. tcp/127.0.0.1:7447 (repeatable).", rich_help_panel=PANEL
        ),
    ] = None,
    connect: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ENDPOINT", help="Connect to this endpoint (repeatable); no multicast then.", rich_help_panel=PANEL
        ),
    ] = None,
    discover: Annotated[
        str, typer.Option(metavar="multicast|none", help="How processes find each other.", rich_help_panel=PANEL)
    ] = "multicast",
    interface: Annotated[
        str,
        typer.Option(
            metavar="IF", help="Network interface of multicast; lo: nothing leaves the machine.", rich_help_panel=PANEL
        ),
    ] = "lo",
    roster: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Roster with which acts are signed.", rich_help_panel=PANEL)
    ] = None,
    json_lines: Annotated[
        bool,
        typer.Option("--json", help="One JSON object a line on standard output, nothing else.", rich_help_panel=PANEL),
    ] = False,
    config: Annotated[
        Path | None, typer.Option(metavar="FILE.toml", help="Options from a file.", rich_help_panel=PANEL)
    ] = None,
) -> None:
    """The options of every command; only its signature is used."""


_COMMON = list(signature(_common).parameters.values())
_CONTEXT = Parameter("context", Parameter.POSITIONAL_OR_KEYWORD, annotation=typer.Context)


def command(app: typer.Typer, *, example: str, name: str | None = None) -> Callable[[Command], Command]:
    """Declare `function(call, own options...) -> exit code` as a command of `app`, with the common options added.

    An own option that `console.settings.Settings` also knows takes its value from there when no flag gives it.
    """

    def register(function: Command) -> Command:
        own = list(signature(function).parameters.values())[1:]

        @wraps(function)
        def run(context: typer.Context, **given: Any) -> None:
            raise typer.Exit(_carried_out(function, context, given, [parameter.name for parameter in own]))

        parameters = [_CONTEXT, *(p.replace(kind=Parameter.KEYWORD_ONLY) for p in (*own, *_COMMON))]
        run.__signature__ = signature(run).replace(parameters=parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
        app.command(name, epilog=f"Example: [cyan]{example}[/cyan]", no_args_is_help=False)(run)
        return function

    return register


def _carried_out(function: Command, context: typer.Context, given: dict[str, Any], own: list[str]) -> int:
    """Run the command; its errors become a sentence on standard error and an exit code."""
    from console.settings import Settings, load

    config = given.pop("config")
    flags = {name: value for name, value in given.items() if _flagged(context, name) and name in Settings.model_fields}
    try:
        settings, file = load(flags, config)
        chosen = {name: given[name] for name in own}
        for name in own:
            if name in Settings.model_fields and (value := getattr(settings, name)) is not None:
                chosen[name] = value
        return function(Call(settings, file, Output(json_lines=settings.json_lines)), **chosen)
    except DyknowError as error:
        sys.stderr.write(f"{context.command_path}: {error}\n")
        return exit_code(error)
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:
        # Whoever read our lines has seen enough (`dyknow alarms --follow | head`); nothing is left to be flushed.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE


def _flagged(context: typer.Context, name: str) -> bool:
    """Whether the person gave this option on the command line."""
    source = context.get_parameter_source(name)
    return source is not None and source.name == "COMMANDLINE"
