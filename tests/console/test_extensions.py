"""Commands that come with an extension: by an option, a variable or a file, and only then."""

from pathlib import Path

import pytest

from dyknow.console.commands.members.delegate import typed_names
from tests.console.conftest import Run

BEEP = '''
from dyknow.console.command import Call, command

COMMANDS = {"beep": ("beep:beep", "Print a line.")}

@command(example="dyknow beep --times 2")
def beep(call: Call, times: int = 1) -> int:
    """Print a line."""
    call.out.say("beep", beep=times)
    return 0
'''


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working directory, with an extension in it."""
    (tmp_path / "beep.py").write_text(BEEP)
    (tmp_path / "options.toml").write_text('extensions = ["beep"]\n')
    (tmp_path / "federation.toml").write_text('name = "f"\nextensions = ["beep"]\n')
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("arguments", "variables"),
    [
        ("--extension beep", {}),
        ("--extension=beep", {}),
        ("", {"DYKNOW_EXTENSIONS": "beep"}),
        ("--config options.toml", {}),
        ("--federation federation.toml", {}),
    ],
)
def test_an_extension_that_is_named_brings_its_command(dyknow: Run, arguments: str, variables: dict[str, str]) -> None:
    done = dyknow("beep", "--times", "2", "--json", *arguments.split(), **variables)
    assert (done.returncode, done.stdout) == (0, '{"beep":2}\n')


def test_an_extension_that_is_not_named_has_no_command(dyknow: Run) -> None:
    assert dyknow("beep").returncode == 2


def test_an_extension_that_is_not_there_is_a_wrong_call_with_its_remedy(dyknow: Run) -> None:
    done = dyknow("beep", "--extension", "beeep")
    assert done.returncode == 2
    assert "there is no module 'beeep'" in " ".join(done.stderr.replace("│", " ").split())


def test_the_help_lists_commands_of_extensions_that_a_variable_names(dyknow: Run) -> None:
    assert "Print a line." in dyknow("--help", DYKNOW_EXTENSIONS="beep").stdout


def test_a_task_of_an_extension_that_is_named_is_completed(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "ring-beacon" not in typed_names()
    monkeypatch.setenv("DYKNOW_EXTENSIONS", "examples.extension")
    assert {"ring-beacon", "stop-multicast", "remove-monitor"} <= set(typed_names())
