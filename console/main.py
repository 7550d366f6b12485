"""The command `dyknow`. Each command is declared here and done in a module of its own, imported when it is called."""

import typer

from console.command import Call, command

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


def main() -> None:
    """The entry point."""
    app()
