"""The pages of docs/: which files they include, which commands they show, and what those say.

A fence names the file it includes after its language, ```kpl examples/cars.kpl; in ```console what follows `$ ` is run
and the rest is its output; ```console live shows what real platforms say, whose numbers differ from run to run.
`python -m tests.docs.pages` writes the files and the outputs into the pages anew.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from dyknow import UnitPrototype, prototypes_in
from dyknow.compunits import (
    cars,
    conversions,
    intersection,
    kalman,
    motion,
    near_pairs,
    pair_relations,
    relations,
    smoothing,
)
from tests.command import run

ROOT = Path(__file__).parent.parent.parent
DOCS = ROOT / "docs"
PAGES = tuple(sorted(DOCS.glob("*.md")))
_FENCE = re.compile(r"^```(\w+)([^\n`]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_LIBRARY = re.compile(r"(?<=<!-- the library -->\n).*?(?=<!-- end of the library -->)", re.DOTALL)
COMMAND = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); from dyknow.console.main import main; main()"


class Fence(NamedTuple):
    """One fenced block: its language, what stands beside that, and its text."""

    language: str
    about: str
    text: str

    def __str__(self) -> str:
        return f"```{self.language}{f' {self.about}' if self.about else ''}\n{self.text}```"


class Shown(NamedTuple):
    """A command as a page shows it, and its output."""

    command: str
    output: str


def fences(page: Path) -> list[Fence]:
    return [Fence(*_parts(found)) for found in _FENCE.finditer(page.read_text(encoding="utf-8"))]


def commands(fence: Fence) -> list[Shown]:
    """`$ ` begins a command, which goes on after a backslash."""
    found: list[Shown] = []
    goes_on = False
    for line in fence.text.splitlines():
        if goes_on:
            found[-1] = Shown(f"{found[-1].command}\n{line}", "")
        elif line.startswith("$ "):
            found.append(Shown(line[2:], ""))
        else:
            found[-1] = found[-1]._replace(output=f"{found[-1].output}{line}\n")
        goes_on = line.endswith("\\") and not found[-1].output
    return found


def alike(line: str) -> str:
    """The line without its numbers, their units, names of conversations, the colours of cars, and its spaces."""
    line = re.sub(r"\bcolour \w+", "colour", re.sub(r"\bcc-[\w.-]+", "cc", line))
    return re.sub(r"-?\d+(\.\d+)?(e-?\d+)?( (us|ms|s|min)\b)?", "N", " ".join(line.split()))


def folder(parent: Path) -> Path:
    """A folder like the root of the repository, that may be written to."""
    shutil.copytree(ROOT / "examples", parent / "examples", ignore=shutil.ignore_patterns("__pycache__"))
    shim = parent / "bin" / "dyknow"
    shim.parent.mkdir()
    shim.write_text(f'#!/bin/sh\nexec "{sys.executable}" -c "{COMMAND}" "$@"\n')
    shim.chmod(0o755)
    return parent


def environment(place: Path) -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if not name.startswith("DYKNOW_")}
    path = f"{place / 'bin'}{os.pathsep}{kept.get('PATH', '')}"
    return {
        **kept,
        "PATH": path,
        "PYTHONPATH": str(ROOT),
        "COLUMNS": "80",
        "TERM": "dumb",
        "XDG_RUNTIME_DIR": str(place),
    }


def output(command: str, place: Path) -> str:
    """What a command says, on both channels, as it comes. What needs no shell is run without."""
    line = command.replace("\\\n", " ")
    words = list(shlex.shlex(line, posix=True, punctuation_chars=True))
    if words[0] == "dyknow" and not any(re.fullmatch(r"[();<>|&]+", word) for word in words):
        done = run(shlex.split(line)[1:], environment(place), place, merged=True)
        return "".join(f"{each.rstrip()}\n" for each in done.stdout.splitlines())
    done = subprocess.run(
        ["/bin/sh", "-c", command], cwd=place, env=environment(place), text=True, timeout=120, check=False,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    return "".join(f"{line.rstrip()}\n" for line in done.stdout.splitlines())


def library_table() -> str:
    """The units that come with dyknow, as a table."""
    rows = ["| unit | takes | what it gives |", "|---|---|---|"]
    for module in (motion, smoothing, kalman, intersection, relations, cars, near_pairs, pair_relations):
        for made in vars(module).values():
            if getattr(made, "__module__", "") != module.__name__:
                continue
            rows += [f"| `{e.sort} {e.name}` | {_takes(e)} | {_said(made)} |" for e in prototypes_in([made])]
    converting = ", ".join(f"`{each.name}`" for each in conversions.CONVERSIONS)
    return "\n".join(
        [*rows, "", f"And conversions of numbers from one unit to another, `?to Name(?from)`: {converting}.", ""]
    )


def _takes(unit: object) -> str:
    assert isinstance(unit, UnitPrototype)
    return ", ".join(f"`{each}`" for each in unit.inputs)


def _said(made: object) -> str:
    first = (made.__doc__ or "").strip().split("\n\n")[0]
    return " ".join(first.split()).replace("|", "\\|")


def written(page: Path) -> str:
    """The page with its files and outputs as they are now."""
    with tempfile.TemporaryDirectory() as name:
        place = folder(Path(name))

        def renewed(found: "re.Match[str]") -> str:
            fence = Fence(*_parts(found))
            if (ROOT / fence.about).is_file() and fence.about:
                return str(fence._replace(text=(ROOT / fence.about).read_text(encoding="utf-8")))
            if fence.language == "console" and not fence.about:
                said = [f"$ {each.command}\n{output(each.command, place)}" for each in commands(fence)]
                return str(fence._replace(text="".join(said)))
            return found[0]

        text = _FENCE.sub(renewed, page.read_text(encoding="utf-8"))
    table: Callable[[object], str] = lambda _found: library_table()  # noqa: E731  (re.sub wants a function)
    return _LIBRARY.sub(table, text)


def _parts(found: "re.Match[str]") -> tuple[str, str, str]:
    return found[1], found[2].strip(), found[3]


if __name__ == "__main__":
    for each in PAGES:
        each.write_text(written(each), encoding="utf-8")
