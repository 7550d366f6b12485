"""What docs/missions.md and docs/recovery.md have a reader type, on real platforms, in its order."""

import secrets
import subprocess
import time
from pathlib import Path

import pytest

from tests.docs.pages import DOCS, Shown, commands, environment, fences, folder

pytestmark = [pytest.mark.live, pytest.mark.full]
PATIENCE_S = 200.0


def test_the_mission_of_the_page_is_flown(tmp_path: Path) -> None:
    place = folder(tmp_path)
    variables = {**environment(place), "DYKNOW_FEDERATION": f"docs-{secrets.token_hex(4)}"}
    shown = [each for fence in fences(DOCS / "missions.md") if fence.about == "live" for each in commands(fence)]
    assert len(shown) == 4
    for command, wanted in shown:
        done = subprocess.run(
            ["/bin/sh", "-c", command],
            cwd=place,
            env=variables,
            text=True,
            capture_output=True,
            timeout=200,
            check=False,
        )
        assert done.returncode == 0, done
        if "mission start" in command:
            lines = {line.strip() for line in done.stdout.splitlines()}
            assert lines >= {line for line in wanted.splitlines() if "started" in line or "reached" in line}


def test_the_car_of_the_page_is_looked_at_again(tmp_path: Path) -> None:
    place = folder(tmp_path)
    variables = {**environment(place), "DYKNOW_FEDERATION": f"docs-{secrets.token_hex(4)}"}
    shown = [each for fence in fences(DOCS / "recovery.md") if fence.about == "live" for each in commands(fence)]
    assert len(shown) == 6

    def said(each: Shown) -> str:
        done = subprocess.run(
            ["/bin/sh", "-c", each.command],
            cwd=place,
            env=variables,
            text=True,
            capture_output=True,
            timeout=PATIENCE_S,
            check=False,
        )
        return done.stdout + done.stderr

    up, want, tasks, status, explain, down = shown
    assert "ready" in said(up)
    assert "agree" in said(want)
    until_s = time.monotonic() + PATIENCE_S
    while "anchored" not in said(status):
        assert time.monotonic() < until_s, said(tasks)
    assert "it was looked at again" in said(tasks)
    assert "observed" in said(explain)
    assert "stopped" in said(down)
