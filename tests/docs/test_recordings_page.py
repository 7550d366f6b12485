"""What docs/recordings.md has a reader type, on real platforms, in its order."""

import secrets
import subprocess
from pathlib import Path

import pytest

from tests.docs.pages import DOCS, alike, commands, environment, fences, folder

pytestmark = [pytest.mark.live, pytest.mark.full]


def test_what_the_page_records_is_told_and_played(tmp_path: Path) -> None:
    place = folder(tmp_path)
    variables = {**environment(place), "DYKNOW_FEDERATION": f"docs-{secrets.token_hex(4)}"}
    shown = [each for fence in fences(DOCS / "recordings.md") if fence.about == "live" for each in commands(fence)]
    assert len(shown) == 6
    for command, wanted in shown:
        done = subprocess.run(
            ["/bin/sh", "-c", command],
            cwd=place,
            env=variables,
            text=True,
            capture_output=True,
            timeout=100,
            check=False,
        )
        assert done.returncode == 0, done
        printed = " ".join(alike(done.stdout).split())
        assert all(alike(line) in printed for line in wanted.splitlines()), (command, done.stdout)
    assert (
        "heli-position"
        in subprocess.run(
            ["/bin/sh", "-c", "dyknow info flight.mcap"],
            cwd=place,
            env=variables,
            text=True,
            capture_output=True,
            check=True,
        ).stdout
    )
