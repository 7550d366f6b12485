"""Every `dyknow` command that a page prints is one that there is, with options that it has; the files it reads are there."""

import re
import shlex
from collections.abc import Iterator
from itertools import takewhile
from pathlib import Path

import pytest
from typer.main import get_command

from dyknow.console.main import app
from tests.docs.pages import DOCS, PAGES, ROOT, commands, fences

NAMES = [*(page.name for page in PAGES), "../README.md"]
_FILE = re.compile(r"(examples|compose)/[\w./-]*\w")
_MADE = re.compile(r"^dyknow ring\b|\bTASK\b|\bKIND\b")
"""A command of an extension, and patterns of commands."""


def printed(name: str) -> Iterator[str]:
    """The commands of a page: those in consoles, and lines of plain blocks."""
    page = DOCS / name
    for fence in fences(page):
        if fence.language == "console":
            yield from (shown.command.replace("\\\n", " ") for shown in commands(fence))
    plain = re.findall(r"^```\n(.*?)^```$", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    for block in plain:
        yield from (line for line in block.replace("\\\n", " ").splitlines())


def dyknow_words(line: str) -> list[str] | None:
    """The words after `dyknow`, up to what is the shell's; None for another line, such as an error message."""
    if not re.match(r"dyknow [^:]*( |$)", line) or re.match(r"dyknow [a-z ]+: ", line) or _MADE.search(line):
        return None
    words = shlex.shlex(line, posix=True, punctuation_chars="|<>&;")
    words.whitespace_split = True
    return list(takewhile(lambda word: not re.fullmatch(r"[|<>&;]+", word), words))[1:]


@pytest.mark.parametrize("name", NAMES)
def test_every_command_that_is_printed_can_be_called_so(name: str) -> None:
    root = get_command(app)
    for line in printed(name):
        if not (words := dyknow_words(line)):
            continue
        context = root.make_context("dyknow", list(words))
        called, rest = root, words
        while hasattr(called, "resolve_command") and rest:
            _, called, rest = called.resolve_command(context, rest)
        called.make_context(line, list(rest), parent=context)


@pytest.mark.parametrize("name", NAMES)
def test_every_file_of_the_checkout_that_a_command_names_is_there(name: str) -> None:
    named = {found[0] for line in printed(name) for found in _FILE.finditer(line)}
    assert sorted(each for each in named if not (ROOT / each).exists()) == []
    assert not any(Path(each).is_absolute() for each in named)
