"""The command `dyknow`. Each command is declared here and done in a module of its own, imported when it is called."""

from enum import StrEnum
from typing import Annotated

import typer

from console.command import Call, command

LOOPBACK = ("127.0.0.1", "localhost")


class Role(StrEnum):
    """What a member of a roster may do."""

    uav = "uav"
    command_centre = "command-centre"
    observer = "observer"


app = typer.Typer(
    name="dyknow",
    help="Several UAVs that know, together, what is going on.",
    epilog="Begin with: [cyan]dyknow demo[/cyan], then [cyan]dyknow up --detach[/cyan] and [cyan]dyknow ls[/cyan].",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback()
def _root() -> None:
    """Several UAVs that know, together, what is going on."""


@command(app, example="dyknow doctor")
def doctor(call: Call) -> int:
    """What this machine lacks, and how to get it."""
    from console.doctor import doctor as run

    return run(call)


roster = typer.Typer(help="The file of platforms and keys with which acts are signed.", no_args_is_help=True)
app.add_typer(roster, name="roster")

Hosts = Annotated[
    list[str] | None,
    typer.Option(
        "--host",
        metavar="ADDRESS",
        help="Address or name in the certificate (repeatable). [default: 127.0.0.1, localhost]",
    ),
]


@command(roster, name="init", example="dyknow roster init 0 1 2 --roster keys/roster.toml")
def roster_init(
    call: Call,
    platforms: Annotated[list[str], typer.Argument(metavar="UNIT...", help="The platforms.")],
    hosts: Hosts = None,
) -> int:
    """A new roster, with keys and certificates for a command centre and these platforms."""
    from console.roster import init

    return init(call, platforms, hosts or LOOPBACK)


@command(roster, name="add", example="dyknow roster add 3 --roster keys/roster.toml")
def roster_add(
    call: Call,
    unit: Annotated[str, typer.Argument(metavar="UNIT", help="The platform.")],
    role: Annotated[Role, typer.Option(help="What it may do.")] = Role.uav,
    hosts: Hosts = None,
) -> int:
    """One more platform, with a new key and certificate."""
    from console.roster import add

    return add(call, unit, role.value, hosts or LOOPBACK)


@command(roster, name="revoke", example="dyknow roster revoke 2 --roster keys/roster.toml")
def roster_revoke(call: Call, unit: Annotated[str, typer.Argument(metavar="UNIT", help="The platform.")]) -> int:
    """No platform listens to this one any more, once it is restarted."""
    from console.roster import revoke

    return revoke(call, unit)


@command(roster, name="show", example="dyknow roster show --roster keys/roster.toml")
def roster_show(call: Call) -> int:
    """Who is in the roster."""
    from console.roster import show

    return show(call)


def main() -> None:
    """The entry point."""
    app(prog_name="dyknow")
