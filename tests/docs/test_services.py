"""The units of systemd call commands that there are, as the page says."""

import re
import shlex
from configparser import ConfigParser
from pathlib import Path

import pytest
from typer.main import get_command

from dyknow.console.main import app
from tests.docs.pages import DOCS, ROOT

UNITS = sorted((ROOT / "compose" / "systemd").glob("*.service"))


@pytest.mark.parametrize("path", UNITS, ids=lambda path: path.name)
def test_a_service_calls_a_command_that_there_is_with_options_that_it_has(path: Path) -> None:
    parser = ConfigParser(interpolation=None, strict=True)
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read(path)
    assert {"Unit", "Service", "Install"} == {*parser.sections()}
    line = parser["Service"]["ExecStart"].replace("%i", "7").replace("$OPTIONS", "--metrics 9107 --replay a.mcap")
    words = shlex.split(re.sub(r"\$\$\(.*?\)", "now", line))
    words = shlex.split(words[-1]) if words[0] == "/bin/sh" else words
    words = words[words.index("/opt/dyknow/bin/dyknow") + 1 :]
    root = get_command(app)
    context = root.make_context("dyknow", [*words])
    _, called, rest = root.resolve_command(context, words)
    called.make_context(line, list(rest), parent=context)
    assert path.name in (DOCS / "operating.md").read_text()
