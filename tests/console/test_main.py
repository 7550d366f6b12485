import json
import subprocess
import sys
from importlib import import_module

import pytest

from dyknow import __version__ as version
from dyknow.console.main import COMMANDS
from tests.console.conftest import Run

HEAVY = ("zenoh", "pymavlink", "numpy", "scipy", "filterpy", "pydantic", "cryptography")
CALLED = [tuple(name.split()) for name, (where, _summary) in COMMANDS.items() if where]
WANTED = """
    up join host down ls top web query watch call bands hz imports objects saliency explain events delegate tasks
    cancel alarms monitors acts record replay info plot foxglove cot remote-id fault check chronicle link world match
    recover plan mission kpl ontology roads roster doctor demo
"""


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys\nsys.argv = ['dyknow', '--help']\nfrom dyknow.console.main import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        f"sys.stderr.write(','.join(m for m in {HEAVY!r} if m in sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30, check=True)
    assert done.stderr == ""
    assert "Usage: dyknow" in done.stdout


def test_the_version_is_that_of_the_library(dyknow: Run) -> None:
    assert dyknow("--version").stdout == f"dyknow {version}\n"


def test_the_help_lists_the_commands_that_work_and_no_others(dyknow: Run) -> None:
    shown = [
        line.split()[1] for line in dyknow("--help").stdout.splitlines() if line.startswith("│ ") and line[2].isalpha()
    ]
    assert set(shown) == set(WANTED.split())


@pytest.mark.parametrize("name", CALLED, ids=" ".join)
def test_every_command_has_help_with_an_example_that_fits_80_columns(dyknow: Run, name: tuple[str, ...]) -> None:
    done = dyknow(*name, "--help")
    assert done.returncode == 0
    assert f"Example: dyknow {' '.join(name)}" in done.stdout
    assert all(len(line) <= 80 for line in done.stdout.splitlines())


def test_the_summary_of_a_command_begins_as_its_help_does() -> None:
    """Two sentences about one thing, of which the list in the help cannot import the longer one."""
    for name, (where, summary) in COMMANDS.items():
        if where:
            module, _, function = where.partition(":")
            first = str(getattr(import_module(module), function).__doc__).split()[:2]
            assert summary.split()[:2] == first, name


def test_an_unknown_command_is_a_wrong_call_with_a_suggestion(dyknow: Run) -> None:
    done = dyknow("docto")
    assert done.returncode == 2
    assert "doctor" in done.stderr


def test_a_wrong_option_value_is_a_wrong_call_that_names_command_place_and_remedy(dyknow: Run) -> None:
    done = dyknow("doctor", "--federation", "A B")
    assert done.returncode == 2
    assert done.stderr.startswith("dyknow doctor: --federation: 'A B' cannot name a federation; write ")


@pytest.mark.parametrize("arguments", ["delegate hold --to a --to b", "ls --json --roster a --roster b"])
def test_an_option_of_one_value_that_is_given_again_is_refused_and_named(dyknow: Run, arguments: str) -> None:
    done = dyknow(*arguments.split())
    assert done.returncode == 2
    assert done.stdout == ""
    assert f"{arguments.split()[-2]}': given 2 times" in done.stderr


def test_json_is_one_object_a_line_and_nothing_else(dyknow: Run) -> None:
    done = dyknow("doctor", "--json")
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert all(set(entry) == {"finding", "state", "detail", "remedy"} for entry in found)


def test_a_reader_that_has_seen_enough_ends_the_command_quietly() -> None:
    ended = subprocess.run(
        f"{sys.executable} -c 'from dyknow.console.main import main; main()' doctor --json | head -1",
        shell=True, capture_output=True, text=True, timeout=30, check=False,
    )  # fmt: skip
    assert ended.stderr == ""


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("dyknow mon", "monitors"),
        ("dyknow up --scenario cr", "crossing"),
        ("dyknow delegate go", "goto"),
        ("dyknow fault 1 si", "silence"),
    ],
)
def test_the_shell_completes_commands_scenarios_tasks_and_faults(dyknow: Run, words: str, expected: str) -> None:
    count = str(len(words.split()) - 1)
    done = dyknow(_DYKNOW_COMPLETE="complete_bash", COMP_WORDS=words, COMP_CWORD=count)
    assert done.stdout.split() == [expected]


def test_the_names_in_the_help_are_those_there_are(dyknow: Run) -> None:
    from dyknow.sim_uavs.dynamics.scenarios import NAMES

    shown = " ".join(dyknow("up", "--help").stdout.replace("│", " ").split())
    assert all(name in shown for name in NAMES)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("up --duration 0s", "--duration: 0s is too short"),
        ("join --unit 1 --mavlink foo", "--mavlink: 'foo'"),
        ("watch heli-position --every 0", "--every: '0' has no unit"),
        ("fault 0 explode", "KIND: no fault is called 'explode'"),
    ],
)
def test_what_cannot_be_done_is_a_wrong_call_before_anything_starts(dyknow: Run, arguments: str, said: str) -> None:
    done = dyknow(*arguments.split())
    assert done.returncode == 2
    assert f": {said}" in done.stderr
    assert "Traceback" not in done.stderr
    assert "1:1:" not in done.stderr
