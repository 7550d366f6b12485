"""What docs/missions.md has a reader type, on real platforms, in its order."""

import secrets
import subprocess
from pathlib import Path

import pytest

from tests.docs.pages import DOCS, commands, environment, fences, folder

pytestmark = [pytest.mark.live, pytest.mark.full]


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
