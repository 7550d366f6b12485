"""`dyknow kpl ...`: specifications checked, shown, run, drawn and verified."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from console.command import Call, command

kpl = typer.Typer(help="Specifications of knowledge processing, in KPL.", no_args_is_help=True)
UnitModules = Annotated[
    list[str] | None,
    typer.Option(
        "--units", metavar="MODULE", help="A module or file.py with sources and computational units (repeatable)."
    ),
]


Feed = Annotated[
    Path | None, typer.Option(metavar="FILE.jsonl", help="Samples of the specification's sources, one instant a line.")
]
SpecificationFile = Annotated[Path, typer.Argument(metavar="FILE", help="A specification, mission.kpl.")]
CheckedFile = Annotated[
    Path, typer.Argument(metavar="FILE", help="A specification, mission.kpl, or chronicles, overtake.chr.")
]


@command(kpl, name="check", example="dyknow kpl check mission.kpl")
def kpl_check(call: Call, file: CheckedFile, modules: UnitModules = None) -> int:
    """Every error of a specification with its place and repair, and what nobody reaches; exit 1 if there is an error."""
    from console.specifications import check as run

    return run(call, file, units=modules or ())


@command(kpl, name="show", example="dyknow kpl show mission.kpl")
def kpl_show(
    call: Call,
    file: Annotated[
        Path | None,
        typer.Argument(metavar="[FILE]", help="A specification, mission.kpl, or chronicles, overtake.chr."),
    ] = None,
    unit: Annotated[
        str | None, typer.Option(metavar="U", help="Instead of a file: what this running platform holds.")
    ] = None,
    configuration: Annotated[
        int | None, typer.Option(metavar="N", min=0, help="What it held in an earlier configuration.")
    ] = None,
    restore: Annotated[
        int | None, typer.Option(metavar="N", min=0, help="Have it hold that configuration again.")
    ] = None,
) -> int:
    """A specification as it is understood, one declaration a line: of a file, or of a running platform."""
    from console.errors import WrongCall
    from console.specifications import held, show

    if (file is None) == (unit is None):
        raise WrongCall("say of what: a FILE, or --unit U for what a running platform holds.")
    if file is not None:
        return show(call, file)
    return held(call, str(unit), number=configuration, restore=restore)


Govern = Annotated[
    str | None,
    typer.Option(metavar="TIME", help="Lengthen the least important periods while delays are longer than this."),
]
Admit = Annotated[
    Literal["refuse", "longer"],
    typer.Option(help="What becomes of declarations that there is no time for: refused, or served less often."),
]
GraphForm = Literal["text", "json", "mermaid", "dot"]


@command(kpl, name="run", example="dyknow kpl run cars.kpl --feed cars.jsonl --units cars.py")
def kpl_run(
    call: Call,
    file: SpecificationFile,
    feed: Feed = None,
    modules: UnitModules = None,
    unit: Annotated[str, typer.Option(metavar="U", help="What `self` means.")] = "0",
    pace: Annotated[
        float | None,
        typer.Option(
            "--speed", help="Times as fast as the wall clock; 0: as fast as it goes. [default: 0 with --feed, else 1]"
        ),
    ] = None,
    duration: Annotated[str | None, typer.Option(metavar="TIME", help="End after so long, e.g. 10s.")] = None,
    record: Annotated[
        Path | None, typer.Option(metavar="FILE.jsonl", help="Write every sample, for `kpl verify`.")
    ] = None,
    watch: Annotated[bool, typer.Option("--watch", help="Take in the file again whenever it is changed.")] = False,
    govern: Govern = None,
    admit: Admit = "refuse",
    graph: Annotated[
        GraphForm | None, typer.Option("--graph", help="In the end show the network, with rates, delays and drops.")
    ] = None,
) -> int:
    """Run a specification in an instance of its own and show its streams and alarms; Ctrl-C ends it."""
    from console.specification_runs import run

    return run(
        call,
        file,
        feed=feed,
        units=modules or (),
        unit=unit,
        speed=pace,
        duration=duration,
        record=record,
        watch=watch,
        govern=govern,
        admit=admit,
        graph_form=graph,
    )


@command(kpl, name="graph", example="dyknow kpl graph cars.kpl --form mermaid")
def kpl_graph(
    call: Call,
    file: Annotated[Path | None, typer.Argument(metavar="[FILE]", help="A specification, mission.kpl.")] = None,
    modules: UnitModules = None,
    unit: Annotated[
        str | None,
        typer.Option(metavar="U", help="What `self` means; without a file: what this running platform does."),
    ] = None,
    form: Annotated[GraphForm, typer.Option(help="How it is drawn.")] = "text",
) -> int:
    """The network of a specification, or of a running platform with rates, delays and drops: who makes what of what."""
    from console.errors import WrongCall
    from console.specification_runs import graph as run
    from console.specifications import held

    if file is not None:
        return run(call, file, units=modules or (), unit=unit or "0", form=form)
    if unit is None:
        raise WrongCall("say of what: a FILE, or --unit U for what a running platform does.")
    return held(call, unit, form="json" if call.out.json_lines else form)


@command(kpl, name="verify", example="dyknow kpl verify cars.kpl --journal run.jsonl")
def kpl_verify(
    call: Call,
    file: SpecificationFile,
    journal: Annotated[
        Path, typer.Option(metavar="FILE", help="What `kpl run --record` wrote, or the journal of a platform, U.mcap.")
    ],
    modules: UnitModules = None,
) -> int:
    """Whether a recorded run satisfies its specification; if not, which sample broke which constraint. Exit 1 then."""
    from console.specification_runs import verify

    return verify(call, file, journal=journal, units=modules or ())
