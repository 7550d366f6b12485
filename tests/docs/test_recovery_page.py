"""What docs/recovery.md has a reader type, on a real platform, in its order."""

import secrets
import subprocess
import time
from pathlib import Path

import pytest

from tests.docs.pages import DOCS, Shown, commands, environment, fences, folder

pytestmark = [pytest.mark.live, pytest.mark.full]
PATIENCE_S = 200.0


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
