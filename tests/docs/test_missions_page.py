"""What docs/missions.md, docs/recovery.md and docs/emergency.md have a reader type, on real platforms, in its order."""

import json
import secrets
import subprocess
import time
from pathlib import Path

import pytest

from tests.docs.pages import DOCS, Shown, commands, environment, fences, folder

pytestmark = [pytest.mark.live, pytest.mark.full]
PATIENCE_S = 200.0


def typed(each: Shown, place: Path, variables: dict[str, str]) -> str:
    """What a command prints."""
    done = subprocess.run(
        ["/bin/sh", "-c", each.command],
        cwd=place,
        env=variables,
        text=True,
        capture_output=True,
        timeout=3 * PATIENCE_S,
        check=False,
    )
    return done.stdout + done.stderr


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
        return typed(each, place, variables)

    up, want, tasks, status, explain, down = shown
    assert "ready" in said(up)
    assert "agree" in said(want)
    until_s = time.monotonic() + PATIENCE_S
    while "anchored" not in said(status):
        assert time.monotonic() < until_s, said(tasks)
    assert "it was looked at again" in said(tasks)
    assert "observed" in said(explain)
    assert "stopped" in said(down)


@pytest.mark.timeout(1500)
def test_the_persons_of_the_page_are_found_and_its_boxes_are_brought(tmp_path: Path) -> None:
    place = folder(tmp_path)
    variables = {**environment(place), "DYKNOW_FEDERATION": f"docs-{secrets.token_hex(4)}", "DYKNOW_SPEED": "2"}
    shown = [each for fence in fences(DOCS / "emergency.md") if fence.about == "live" for each in commands(fence)]
    assert len(shown) == 7

    def said(each: Shown) -> str:
        return typed(each, place, variables)

    up, divide, saliency, geojson, supplies, start, down = shown
    assert "ready" in said(up)
    assert "agree" in said(divide)
    until_s = time.monotonic() + 3 * PATIENCE_S
    while saliency_count(said(geojson)) < 11:
        assert time.monotonic() < until_s, said(saliency)
    while said(up._replace(command="dyknow ls")).count("scan: 100% of its piece") < 2:
        assert time.monotonic() < until_s
    said(supplies)
    assert (place / "goals.prob").read_text("utf-8").count("#goal brought-") == 11
    told = said(start)
    assert "boxes: reached: the plan is done" in told or "boxes: partly reached" in told, told[-2000:]
    assert "stopped" in said(down)


def saliency_count(text: str) -> int:
    """Persons of a map."""
    found = text[: text.rfind("}") + 1]
    return len(json.loads(found)["features"]) if found else 0
