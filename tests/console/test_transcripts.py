"""Every command with `--json`: the lines it prints and the code it ends with, compared with a recorded transcript.

`transcripts/*.json` hold sessions. A session has a world of platforms (or none) and steps: a command with its lines and
exit code, or a number of seconds that pass. Sentences are replaced by dots and, unless the session is exact, times, ids
and what vehicles measured by their types; what remains of a line has to be as recorded.
"""

import json
import re
import shutil
import sys
from collections.abc import Callable
from functools import partial
from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from dyknow.console.centre import client
from dyknow.console.main import app
from tests.box import Box

TRANSCRIPTS = Path(__file__).parent / "transcripts"
SESSIONS = [
    pytest.param(session, id=f"{path.stem}: {session['title']}")
    for path in sorted(TRANSCRIPTS.glob("*.json"))
    for session in json.loads(path.read_text(encoding="utf-8"))
]
_PASSING = re.compile(r".*_us|(age|discovery|took|until|since|t)_ms|key|id")
_OWN = {"measured", "track_deg", "speed_m_s", "altitude_m", "tried_at_m_s"}
_BANDS = ("others", "tracks_deg", "speeds_m_s", "altitudes_m")
_INSIDE = {"value": "measured", "values": "measured", "samples": "valid_us", **dict.fromkeys(_BANDS, "measured")}
_PROSE = {"message", "repair", "error", "said", "text", "remedy", "detail", "act"}
_PIDS = count(4711)
_IDS = re.compile(r"cc-[0-9]+(-[0-9a-f]+)*(\.[0-9a-z-]+)?")


def worlds() -> dict[str, Callable[[], Box]]:
    """The federations in which sessions take place, by name."""

    def three() -> Box:
        world = Box()
        for number in range(3):
            world.fly(str(number), 0.0, 200.0 * number, 2.0)
        world.run(2.0)
        return world

    def meeting() -> Box:
        world = Box()
        world.fly("0", -60.0, 0.0, 5.0)
        world.fly("1", 60.0, 3.0, -5.0)
        world.run(1.5)
        return world

    return {"empty": Box, "three": three, "meeting": meeting}


def normalised(value: Any, name: str = "", *, is_exact: bool) -> Any:
    """The value without prose and, unless `is_exact`, without what differs from run to run."""
    if isinstance(value, dict):
        inside = "measured" if name.startswith("variance") else _INSIDE.get(name, "")
        return {
            key: normalised(one, key if key == "age_us" else inside or key, is_exact=is_exact)
            for key, one in value.items()
        }
    if isinstance(value, list):
        return [normalised(one, name, is_exact=is_exact) for one in value]
    if isinstance(value, str) and name in _PROSE:
        return "..."
    if is_exact or value is None:
        return value
    if _PASSING.fullmatch(name) or (name in _OWN and isinstance(value, float)):
        return type(value).__name__
    if name == "content":
        return value.split()[0]
    return _IDS.sub("ID", value) if isinstance(value, str) else value


class Player:
    """Runs the commands of one session in this process."""

    def __init__(self, session: dict[str, Any], capsys: Any, monkeypatch: Any) -> None:
        self.world = worlds()[session["world"]]() if session["world"] else None
        self._is_exact = session.get("exact", False)
        self._capsys, self._monkeypatch = capsys, monkeypatch
        self._conversation = ""
        if self.world is not None:
            monkeypatch.setattr(client, "_client_ports", lambda _call: self.world.client_ports())

    def run(self, step: dict[str, Any]) -> dict[str, Any]:
        """The step with the lines and the code that the command has now."""
        arguments = [one.replace("CONVERSATION", self._conversation) for one in step["run"]]
        federation = ["--federation", "test"] if self.world is not None else []
        self._monkeypatch.setattr(sys, "argv", ["dyknow", *arguments, *federation, "--json"])
        for name, value in step.get("variables", {}).items():
            self._monkeypatch.setenv(name, value)
        # Each command is a process of its own, and so a member of its own.
        self._monkeypatch.setattr(client, "os", SimpleNamespace(getpid=partial(next, _PIDS)))
        with pytest.raises(SystemExit) as end:
            app(prog_name="dyknow")
        lines = [json.loads(line) for line in self._capsys.readouterr().out.splitlines()]
        self._conversation = next(
            (line["conversation"] for line in lines if "conversation" in line), self._conversation
        )
        shown = [normalised(line, is_exact=self._is_exact) for line in lines]
        if step.get("sorted"):
            shown = sorted({json.dumps(line): line for line in shown}.values(), key=json.dumps)
        for name in step.get("variables", {}):
            self._monkeypatch.delenv(name)
        return {**step, "code": end.value.code, "lines": shown}


@pytest.fixture
def play(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Callable[[dict[str, Any]], list[dict[str, Any]]]:
    """Play a session in a directory that has the transcripts' inputs; its steps as they are now."""
    shutil.copytree(TRANSCRIPTS / "inputs", tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))

    def played(session: dict[str, Any]) -> list[dict[str, Any]]:
        player = Player(session, capsys, monkeypatch)
        steps = []
        for step in session["steps"]:
            if "run" in step:
                steps.append(player.run(step))
            elif player.world is not None:
                player.world.run(step["seconds"])
                steps.append(step)
        return steps

    return played


@pytest.mark.parametrize("session", SESSIONS)
def test_commands_print_and_end_as_recorded(
    session: dict[str, Any], play: Callable[[dict[str, Any]], list[dict[str, Any]]]
) -> None:
    for expected, now in zip(session["steps"], play(session), strict=True):
        assert now == expected, " ".join(expected.get("run", ()))
