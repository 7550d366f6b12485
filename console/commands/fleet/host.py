"""`dyknow host`: an operating system process of its own that runs sources and units for a platform of this machine."""

import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import typer

from dyknow import Prototype
from dyknow.agents.hosts.knowledge_host import KnowledgeHost
from dyknow.compunits import load_module, prototypes_of
from dyknow.console.command import Call, command
from dyknow.console.errors import DONE
from dyknow.console.output.shown import Shown, line, styled
from dyknow.console.processes.launch import hosts_of
from dyknow.console.processes.supervision import interruptible
from dyknow.federation.keys import unit as unit_name
from dyknow.model.errors import EndpointFailed, NothingFound, Refused, UnitError, WrongCall
from dyknow.proxies.hosts.connection import connect
from dyknow.runtime.hosts.host_process import HostProcess

HOW = """\
from dyknow import source, value_unit

@value_unit("speed", "speed")
def doubled(speed): return 2 * speed"""


@command(example="dyknow host camera.py --unit 0")
def host(
    call: Call,
    module: Annotated[
        str, typer.Argument(metavar="MODULE", help="A module or file.py with sources and computational units.")
    ],
    *,
    unit: Annotated[str, typer.Option(metavar="U", help="The platform of this machine that gets them.")],
    batch: Annotated[
        int, typer.Option(metavar="N", min=1, max=256, help="Wait for N samples of a process, then process all.")
    ] = 1,
    train: Annotated[
        bool, typer.Option("--train", help="Let each sample pass a whole chain of processes before the next one.")
    ] = False,
) -> int:
    """Offer sources and units (a camera pipeline, a heavy filter) to a platform from a process of their own."""
    unit_name(unit)
    call.out.hold()
    prototypes = _offered(module)
    runs = KnowledgeHost(prototypes, os.getpid(), Path(module).name[-200:], batch=batch, train=train)

    def say(said: dict[str, Any]) -> None:
        call.out.say(_shown(said, unit), **said)

    try:
        with interruptible():
            HostProcess(runs, hosts_of(call, unit), say).run()
    except EndpointFailed:
        raise _no_platform(call, unit) from None
    except Refused as refused:
        raise WrongCall(
            f"platform {unit} does not take {module}: {refused}. Give it another name (`name=` in its decorator), "
            "or end the host that has the name."
        ) from None
    return DONE


def _offered(module: str) -> Iterable[Prototype]:
    """The sources and units of a module, which finds its neighbours as if it were run; raises WrongCall."""
    is_file = module.endswith(".py")
    sys.path.insert(0, str(Path(module).resolve().parent if is_file else Path.cwd()))
    if not is_file and Path(f"{module}.py").is_file():
        module = f"{module}.py"
    try:
        found = prototypes_of(load_module(module)).values()
    except UnitError as wrong:
        raise WrongCall(str(wrong)) from None
    if not found:
        raise WrongCall(f"{module} holds no source and no computational unit. One is declared like this:\n\n{HOW}")
    return found


def _no_platform(call: Call, unit: str) -> NothingFound:
    """No such platform; the message names those that run here."""
    here = hosts_of(call, unit)
    running = sorted(path.stem for path in here.parent.glob(f"*{here.suffix}") if _answers(path))
    said = f"no platform {unit} of federation {call.settings.federation} runs on this machine"
    there = f"; running here: {', '.join(running)}" if running else ""
    return NothingFound(f"{said}{there}. Start it with dyknow up, or dyknow join --unit {unit}.")


def _answers(path: Path) -> bool:
    try:
        connect(path).close()
    except OSError:
        return False
    return True


def _shown(said: dict[str, Any], unit: str) -> Shown:
    match said["event"]:
        case "registered":
            prototypes, labels = said["prototypes"], said["labels"]
            parts = [f"can make {', '.join(prototypes)}"] if prototypes else []
            parts += [f"has the streams {', '.join(labels)}"] if labels else []
            return line(styled("registered", "green"), f": platform {unit} {' and '.join(parts)} from now on")
        case "lost":
            return f"platform {unit} is gone; waiting until it is there again"
    return line(styled(said["label"] or "a stream", "red"), f": {said['said']}")
