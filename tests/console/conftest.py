import json
import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dyknow.console.centre import client
from dyknow.console.command import Call
from dyknow.console.output.output import Output
from dyknow.runtime.configuration.settings import Settings
from tests import command
from tests.box import Box

Run = Callable[..., "subprocess.CompletedProcess[str]"]
Lines = Callable[[], list[dict[str, Any]]]


@pytest.fixture
def dyknow(tmp_path: Path) -> Run:
    """Run the command in a process of its own, 80 columns wide, with no variables but those given."""

    def run(*arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
        kept = {name: value for name, value in os.environ.items() if not name.startswith("DYKNOW_")}
        environment = {**kept, "COLUMNS": "80", "TERM": "dumb", "XDG_RUNTIME_DIR": str(tmp_path), **variables}
        return command.run(arguments, environment)

    return run


@pytest.fixture
def call() -> Call:
    return Call(Settings(federation="test", json_lines=True), Output(json_lines=True))


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> Box:
    found = Box()
    for number in range(3):
        found.fly(str(number), 0.0, 200.0 * number, 2.0)
    monkeypatch.setattr(client, "_client_ports", lambda _call: found.client_ports())
    found.run(2.0)
    return found


@pytest.fixture
def lines(capsys: pytest.CaptureFixture[str]) -> Lines:
    return lambda: [json.loads(line) for line in capsys.readouterr().out.splitlines()]
