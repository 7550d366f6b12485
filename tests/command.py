"""The command `dyknow` in processes that are forked where its modules are loaded: only the first one imports them."""

import multiprocessing
import os
import sys
import tempfile
from collections.abc import Mapping, Sequence
from multiprocessing.context import ForkServerContext
from pathlib import Path
from subprocess import CompletedProcess, TimeoutExpired

PATIENCE_S = 100.0
LOADED = [
    "dyknow.console.main",
    "dyknow.console.commands.fleet.roster",
    "dyknow.console.commands.texts.check",
    "dyknow.console.commands.texts.chronicle",
    "dyknow.console.commands.texts.specifications",
    "dyknow.console.commands.texts.specification_runs",
    "dyknow.compunits",
]
if "DYKNOW_REMOVED" in os.environ:
    LOADED.insert(0, "tests.thesis.removing")
"""What the server imports. What a command imports of itself is for tests that start an interpreter."""


def run(
    arguments: Sequence[str], environment: Mapping[str, str], directory: Path | None = None, *, merged: bool = False
) -> CompletedProcess[str]:
    """Run `dyknow` with these words and no other variables; standard input is empty.

    Args:
        merged: what it writes to standard error comes with the output, in the order in which it was written.

    Raises:
        TimeoutExpired: it did not end in time.
    """
    with tempfile.TemporaryDirectory() as place:
        out, err = Path(place, "out"), Path(place, "out" if merged else "err")
        process = _server().Process(
            target=_command, args=([*arguments], {**environment}, str(directory or Path.cwd()), str(out), str(err))
        )
        process.start()
        process.join(PATIENCE_S)
        if process.exitcode is None:
            process.kill()
            process.join()
            raise TimeoutExpired([*arguments], PATIENCE_S)
        return CompletedProcess([*arguments], process.exitcode, out.read_text(), "" if merged else err.read_text())


def _server() -> ForkServerContext:
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([__name__, *LOADED])
    return context


def _command(arguments: list[str], environment: dict[str, str], directory: str, out: str, err: str) -> None:
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(directory)
    for number, path in ((1, out), (2, err)):
        opened = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        os.dup2(opened, number)
        os.close(opened)
    sys.stdout, sys.stderr = os.fdopen(1, "w", closefd=False), os.fdopen(2, "w", closefd=False)
    sys.argv = ["-c", *arguments]
    from dyknow.console.main import app

    app(prog_name="dyknow")
