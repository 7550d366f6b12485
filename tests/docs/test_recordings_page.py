"""What docs/recordings.md and docs/outward.md have a reader type, on real platforms, in their order."""

import secrets
import socket
import subprocess
from pathlib import Path

import pytest

from tests.docs.pages import DOCS, alike, commands, environment, fences, folder

pytestmark = [pytest.mark.live, pytest.mark.full]
RECEIVERS = {"dyknow cot": 6969, "dyknow remote-id": 14560}


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


def test_what_the_page_sends_reaches_receivers(tmp_path: Path) -> None:
    pytest.importorskip("foxglove", reason="foxglove-sdk is not installed")
    place = folder(tmp_path)
    variables = {**environment(place), "DYKNOW_FEDERATION": f"docs-{secrets.token_hex(4)}"}
    shown = [each for fence in fences(DOCS / "outward.md") if fence.about == "live" for each in commands(fence)]
    assert len(shown) == 5
    got: dict[str, list[bytes]] = {}
    for command, _ in shown:
        port = next((port for begin, port in RECEIVERS.items() if command.startswith(begin)), 0)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
            receiver.bind(("127.0.0.1", port))
            receiver.settimeout(0.2)
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
            assert "lost" not in done.stdout + done.stderr, done
            while port:
                try:
                    got.setdefault(command, []).append(receiver.recv(65_535))
                except TimeoutError:
                    break
    events, messages = got.values()
    assert {each[:5] for each in events} == {b"<?xml"}
    assert len(messages) % 4 == 0
    assert {each[0] for each in messages} == {0xFD}
