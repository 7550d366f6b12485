"""Mistakes of users in calls and in federation files: the repair that the error names is done, and then it is accepted.

`mistakes.json`: a call, or the text of a file that is given to `dyknow up`; what is `wrong` in it; where the `repair`
stands in the message (a regular expression, unless it is "Did you mean '...'").
"""

import json
import re
from collections.abc import Callable
from functools import partial
from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from dyknow.console.centre import client
from dyknow.console.commands.fleet import join, up
from dyknow.console.main import app
from tests.box import Box

MISTAKES = json.loads(Path(__file__).with_name("mistakes.json").read_text(encoding="utf-8"))
ROOT = Path(__file__).parents[2]
MEANT = "Did you mean '([^']+)'"
_PIDS = count(4711)
Called = Callable[..., tuple[int, str]]


@pytest.fixture
def dyknow(world: Box, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Called:
    """Call the command in this process; its exit code and all it says. What it would start is not started."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "400")
    monkeypatch.setenv("TERM", "dumb")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr(client, "os", SimpleNamespace(getpid=partial(next, _PIDS)))
    monkeypatch.setattr(up, "missing", lambda _directory, _configs: [])
    monkeypatch.setattr(join, "_run", lambda _call, _configs, _level: 0)
    for name in ("mission.kpl", "mission.jsonl"):
        (tmp_path / name).write_bytes((ROOT / "examples" / name).read_bytes())

    def call(*words: str) -> tuple[int, str]:
        with pytest.raises(SystemExit) as end:
            app([*words], prog_name="dyknow")
        said = capsys.readouterr()
        code = end.value.code
        assert isinstance(code, int)
        return code, " ".join(f"{said.err} {said.out}".split())

    return call


def repair_in(case: dict[str, Any], said: str) -> str:
    found = re.search(case.get("repair", MEANT), said)
    assert found is not None, said
    return str(case.get("with", found[1]))


def _id(case: dict[str, Any]) -> str:
    return " ".join(case["run"]) if "run" in case else str(case["text"]).replace("\n", "; ")


def test_there_are_sixty() -> None:
    assert len(MISTAKES["calls"]) + len(MISTAKES["files"]) >= 60


@pytest.mark.parametrize("case", MISTAKES["calls"], ids=map(_id, MISTAKES["calls"]))
def test_a_call_that_is_repaired_as_it_is_told_is_accepted(case: dict[str, Any], dyknow: Called) -> None:
    words, wrong = case["run"], case["wrong"]
    code, said = dyknow(*words)
    assert code in {1, 2}, said
    instead = repair_in(case, said)
    instead = f"{instead}{wrong}" if case.get("then") == "adds" else instead
    if case.get("then") == "follows":
        words, wrong = [*words, "--help"], case["wrong"]
    mended = [word.replace(wrong, instead) if _stands_in(wrong, word) else word for word in words]
    assert mended != words
    code, then = dyknow(*mended)
    ends = case.get("ends", case["then"] if isinstance(case.get("then"), int) else None)
    assert code == ends if ends is not None else code in {0, 1}, then
    assert not re.search(case.get("repair", MEANT), then), then


def _stands_in(wrong: str, word: str) -> bool:
    """Whether it is the word, or a key or value in it."""
    return wrong in {word, *word.split("=")}


@pytest.mark.parametrize("case", MISTAKES["files"], ids=map(_id, MISTAKES["files"]))
def test_a_file_that_is_repaired_as_it_is_told_is_accepted(case: dict[str, Any], dyknow: Called) -> None:
    file = Path("federation.toml")
    file.write_text(case["text"], encoding="utf-8")
    code, said = dyknow("up", "--federation", str(file))
    assert code == 2, said
    file.write_text(case["text"].replace(case["wrong"], repair_in(case, said), 1), encoding="utf-8")
    code, said = dyknow("up", "--federation", str(file))
    assert code == 0, said
