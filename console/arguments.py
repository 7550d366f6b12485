"""Options and arguments that several commands declare."""

from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import typer

from dyknow.agents.specification.options import RunOptions
from dyknow.console.declared import flag_of

Unit: TypeAlias = Annotated[str | None, typer.Option(metavar="U", help="One platform only.")]
Follow: TypeAlias = Annotated[bool, typer.Option("--follow", "-f", help="Continue with new ones.")]
Count: TypeAlias = Annotated[int | None, typer.Option(metavar="K", min=1, help="Stop after K lines.")]
Speed: TypeAlias = Annotated[
    float, typer.Option(metavar="X", min=0.001, max=1000, help="How much faster than the wall time runs.")
]
Duration: TypeAlias = Annotated[
    str | None, typer.Option(metavar="TIME", help="End by itself after this long, e.g. 60s.")
]
Label: TypeAlias = Annotated[str, typer.Argument(metavar="LABEL", help="A semantic label, e.g. heli-position.")]
StreamLabel: TypeAlias = Annotated[
    str, typer.Argument(metavar="LABEL", help="A semantic label, or a platform's own for a stream: 'speed[self]'.")
]
UnitModules: TypeAlias = Annotated[list[str] | None, flag_of(RunOptions, "modules")]
Roads: TypeAlias = Annotated[Path | None, flag_of(RunOptions, "roads")]
LogLevel: TypeAlias = Annotated[
    Literal["debug", "info", "warning", "error"],
    typer.Option(help="The lowest level of events that are shown."),
]
Metrics: TypeAlias = Annotated[
    int | None,
    typer.Option(
        metavar="PORT",
        min=1,
        max=65_000,
        help="Figures for Prometheus, and health, of each platform from this port on.",
    ),
]
SpecificationFile: TypeAlias = Annotated[Path, typer.Argument(metavar="FILE", help="A specification, mission.kpl.")]
