"""The command `dyknow`. Each command is declared here and done in a module of its own, imported when it is called."""

from pathlib import Path
from typing import Annotated

import typer

from console.choices import Merge, Persona, Role, Select, fault_kinds, scenarios, task_names
from console.command import Call, command
from console.kpl_commands import Admit, Feed, Govern, UnitModules, kpl

LOOPBACK = ("127.0.0.1", "localhost")


app = typer.Typer(
    name="dyknow",
    help="Several UAVs that know, together, what is going on.",
    epilog="Begin with: [cyan]dyknow demo[/cyan], then [cyan]dyknow up --detach[/cyan] and [cyan]dyknow ls[/cyan].",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
Unit = Annotated[str | None, typer.Option(metavar="U", help="One platform only.")]
Follow = Annotated[bool, typer.Option("--follow", "-f", help="Go on with what happens from now on.")]
Count = Annotated[int | None, typer.Option(metavar="K", min=1, help="Stop after so many.")]
Timeout = Annotated[str, typer.Option(metavar="TIME", help="How long to wait for answers.")]
Speed = Annotated[
    float, typer.Option(metavar="X", min=0.001, max=1000, help="How much faster than the wall time runs.")
]
Duration = Annotated[str | None, typer.Option(metavar="TIME", help="End by itself after this long, e.g. 60s.")]
Avoidance = Annotated[bool, typer.Option("--avoidance/--no-avoidance", help="Whether UAVs may give way to each other.")]


@app.callback()
def _root() -> None:
    """Several UAVs that know, together, what is going on."""


# Platforms


@command(app, example="dyknow up 3 --scenario crossing --detach")
def up(
    call: Call,
    units: Annotated[int, typer.Argument(metavar="[N]", min=1, max=250, help="How many UAVs.")] = 3,
    scenario: Annotated[
        str,
        typer.Option(metavar="NAME", help="crossing, encounter, hover, patrol or swarm.", autocompletion=scenarios),
    ] = "patrol",
    seed: Annotated[int, typer.Option(metavar="K", min=0, help="Wind, noise and routes follow from it.")] = 1,
    duration: Duration = None,
    gcs: Annotated[
        str | None, typer.Option(metavar="HOST:PORT", help="Every autopilot also speaks MAVLink to this UDP port.")
    ] = None,
    persona: Annotated[Persona, typer.Option(help="Whose MAVLink dialect the autopilots speak.")] = Persona.ardupilot,
    avoidance: Avoidance = True,
    speed: Speed = 1.0,
    detach: Annotated[
        bool, typer.Option("--detach", "-d", help="Return when all are ready; end them by down.")
    ] = False,
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="U", help="Start only this one here; the others run elsewhere (repeatable)."),
    ] = None,
) -> int:
    """Start simulated UAVs, one process each, and wait until they have found each other."""
    from console.up import up as run

    chosen = {
        "units": units,
        "scenario": scenario,
        "seed": seed,
        "duration": duration,
        "gcs": gcs,
        "persona": str(persona),
        "avoidance": avoidance,
        "speed": speed,
        "only": only,
    }
    return run(call, detach=detach, **chosen)


@command(app, example="dyknow join --unit 3 --mavlink udpin:127.0.0.1:14550 --control")
def join(
    call: Call,
    unit: Annotated[str, typer.Option(metavar="U", help="Its name in the federation.")],
    mavlink: Annotated[
        str | None, typer.Option(metavar="ENDPOINT", help="A MAVLink vehicle, e.g. udpin:127.0.0.1:14550.")
    ] = None,
    sysid: Annotated[
        int | None, typer.Option(metavar="S", min=1, max=255, help="Which vehicle, when several send there.")
    ] = None,
    control: Annotated[bool, typer.Option("--control", help="The platform may command the vehicle.")] = False,
    replay: Annotated[
        Path | None, typer.Option(metavar="FILE", help="A recorded flight: .tlog, .bin, .ulg or .mcap.")
    ] = None,
    from_: Annotated[
        str, typer.Option("--from", metavar="TIME", help="Where in the recording to begin, after its first position.")
    ] = "0s",
    epoch: Annotated[
        str | None, typer.Option(metavar="TIME", help="When that is played; recordings may share it. [default: now]")
    ] = None,
    speed: Speed = 1.0,
    translation: Annotated[
        Path | None, typer.Option(metavar="FILE.toml", help="Its own labels and units, by semantic label.")
    ] = None,
    spec: Annotated[
        Path | None,
        typer.Option(metavar="FILE.kpl", help="What it derives, exports, imports and monitors; read again on change."),
    ] = None,
    modules: UnitModules = None,
    feed: Feed = None,
    govern: Govern = None,
    admit: Admit = "refuse",
    avoidance: Avoidance = True,
    duration: Duration = None,
) -> int:
    """One platform on any MAVLink vehicle, on a recorded flight, or on a specification alone."""
    from console.join import join as run

    return run(
        call,
        unit=unit,
        duration=duration,
        mavlink=mavlink,
        sysid=sysid,
        control=control,
        replay=replay,
        from_=from_,
        epoch=epoch,
        speed=speed,
        translation=translation,
        spec=spec,
        modules=modules,
        feed=feed,
        govern=govern,
        admit=admit,
        avoidance=avoidance,
    )


@command(app, example="dyknow host camera.py --unit 0")
def host(
    call: Call,
    module: Annotated[
        str, typer.Argument(metavar="MODULE", help="A module or file.py with sources and computational units.")
    ],
    unit: Annotated[str, typer.Option(metavar="U", help="The platform of this machine that is to have them.")],
    batch: Annotated[
        int, typer.Option(metavar="N", min=1, max=256, help="Wait for so many samples of a process, then process all.")
    ] = 1,
    train: Annotated[
        bool, typer.Option("--train", help="Let each sample pass a whole chain of processes before the next one.")
    ] = False,
) -> int:
    """A process of its own that makes streams for a platform: a camera pipeline, a heavy filter."""
    from console.host import host as run

    return run(call, module, unit=unit, batch=batch, train=train)


@command(app, example="dyknow down")
def down(call: Call) -> int:
    """End what up --detach started."""
    from console.up import down as run

    return run(call)


# Knowledge


@command(app, example="dyknow ls --json")
def ls(
    call: Call,
    all_kinds: Annotated[bool, typer.Option("--all", help="Command centres too.")] = False,
) -> int:
    """The directory: platforms, services, labels, age of samples, clock offsets."""
    from console.ls import ls as run

    return run(call, all_kinds=all_kinds)


@command(app, example="dyknow query heli-position --at -10s")
def query(
    call: Call,
    label: Annotated[str, typer.Argument(metavar="LABEL", help="A semantic label, e.g. heli-position.")],
    unit: Unit = None,
    at: Annotated[
        str | None, typer.Option(metavar="T", help="The value at a time: -10s, ISO 8601, microseconds.")
    ] = None,
    between: Annotated[
        tuple[str, str] | None, typer.Option(metavar="T1 T2", help="All values between two times, inclusive.")
    ] = None,
    timeout: Timeout = "2s",
    select: Annotated[Select | None, typer.Option(help="One of the platforms' values.")] = None,
    merge: Annotated[Merge | None, typer.Option(help="One value made of all.")] = None,
) -> int:
    """The latest value of a label, its value at a time, or all between two times."""
    from console.query import query as run

    return run(call, label, unit=unit, at=at, between=between, timeout=timeout, select=select, merge=merge)


@command(app, example="dyknow watch heli-position --every 200ms --count 10")
def watch(
    call: Call,
    label: Annotated[str, typer.Argument(metavar="LABEL", help="A semantic label, e.g. heli-position.")],
    unit: Unit = None,
    every: Annotated[str, typer.Option(metavar="TIME", help="Sample period.")] = "200ms",
    max_delay: Annotated[str, typer.Option(metavar="TIME", help="Older samples are dropped.")] = "1s",
    count: Count = None,
) -> int:
    """A federated stream under a policy, sample by sample."""
    from console.watch import watch as run

    return run(call, label, unit=unit, every=every, max_delay=max_delay, count=count)


@command(app, example="dyknow check 'always speed[uav1] <= 30' --trace flight.jsonl")
def check(
    call: Call,
    formula: Annotated[str, typer.Argument(metavar="FORMULA", help="In the language of formulas.")],
    trace: Annotated[Path | None, typer.Option(metavar="FILE", help="Recorded states, JSON lines.")] = None,
    unit: Unit = None,
    timeout: Annotated[str, typer.Option(metavar="TIME", help="How long to watch live states.")] = "10s",
) -> int:
    """A formula over a recorded trace, or over a platform's live states; exit 1 when it is violated."""
    from console.check import check as run

    return run(call, formula, trace=trace, unit=unit, timeout=timeout)


@command(app, example="dyknow chronicle overtake.chr --events road.jsonl")
def chronicle(
    call: Call,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Chronicles, overtake.chr.")],
    events: Annotated[Path | None, typer.Option(metavar="FILE.jsonl", help="Recorded events, JSON lines.")] = None,
    unit: Unit = None,
    timeout: Annotated[str, typer.Option(metavar="TIME", help="How long to watch live streams.")] = "10s",
    max_delay: Annotated[str | None, typer.Option(metavar="TIME", help="How late live samples may come; 1s.")] = None,
    max_age: Annotated[
        str | None, typer.Option(metavar="TIME", help="Instances last no longer than this; bounds what is remembered.")
    ] = None,
) -> int:
    """Chronicles in a recorded list of events, or over a platform's live streams; exit 1 when nothing was recognised."""
    from console.chronicle import chronicle as run

    return run(call, file, events=events, max_age=max_age, unit=unit, timeout=timeout, max_delay=max_delay)


# Tasks and what comes of them


@command(app, example="dyknow delegate monitor-proximity --to 0 --wait")
def delegate(
    call: Call,
    task: Annotated[
        str,
        typer.Argument(
            metavar="TASK", help="monitor-proximity, create-multicast, goto, hold, ...", autocompletion=task_names
        ),
    ],
    pairs: Annotated[
        list[str] | None, typer.Argument(metavar="[KEY=VALUE]...", help="e.g. profile=proximity sample-period=1s")
    ] = None,
    to: Annotated[str | None, typer.Option(metavar="U", help="The platform that shall see to it.")] = None,
    wait: Annotated[bool, typer.Option("--wait", "-w", help="Go on with what it informs of.")] = False,
) -> int:
    """A task for a platform, as a speech act to its interface agent."""
    from console.delegate import delegate as run

    return run(call, task, pairs or [], to=to, wait=wait)


@command(app, example="dyknow tasks")
def tasks(call: Call) -> int:
    """Delegated tasks, on whichever platform."""
    from console.delegate import tasks as run

    return run(call)


@command(app, example="dyknow cancel cc-4711-5f3a-1")
def cancel(
    call: Call,
    conversation: Annotated[
        str, typer.Argument(metavar="CONVERSATION", help="As dyknow tasks shows it, or its beginning.")
    ],
) -> int:
    """End a task, and take down all it set up."""
    from console.delegate import cancel as run

    return run(call, conversation)


@command(app, example="dyknow alarms --follow")
def alarms(call: Call, follow: Follow = False, count: Count = None) -> int:
    """Alarms raised by monitors, on whichever platform."""
    from console.follow import alarms as run

    return run(call, follow=follow, count=count)


@command(app, example="dyknow monitors")
def monitors(call: Call) -> int:
    """Every monitor: its verdict, and whether its inputs are fresh."""
    from console.follow import monitors as run

    return run(call)


@command(app, example="dyknow acts --follow")
def acts(call: Call, follow: Follow = False) -> int:
    """Speech acts as they pass the interface agents, and what became of each."""
    from console.follow import acts as run

    return run(call, follow=follow)


@command(app, example="dyknow fault 1 gps-loss --for 5s")
def fault(
    call: Call,
    unit: Annotated[str, typer.Argument(metavar="UNIT", help="A simulated UAV.")],
    kind: Annotated[
        str,
        typer.Argument(
            metavar="KIND",
            help="gps-loss, frozen-position, silence, packet-loss=30, clock=+5s, ...",
            autocompletion=fault_kinds,
        ),
    ],
    duration: Annotated[str | None, typer.Option("--for", metavar="TIME", help="How long, e.g. 5s.")] = None,
) -> int:
    """A fault in a simulated UAV."""
    from console.delegate import fault as run

    return run(call, unit, kind, duration)


@command(app, example="dyknow demo")
def demo(
    call: Call, seed: Annotated[int, typer.Option(metavar="K", min=0, help="Wind and noise follow from it.")] = 1
) -> int:
    """The main job end to end, in under a minute; exit 0 only if every step happened."""
    from console.demo import demo as run

    return run(call, seed=seed)


# The machine


@command(app, example="dyknow doctor")
def doctor(call: Call) -> int:
    """What this machine lacks, and how to get it."""
    from console.doctor import doctor as run

    return run(call)


roster = typer.Typer(help="The file of platforms and keys with which acts are signed.", no_args_is_help=True)
app.add_typer(kpl, name="kpl")
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
