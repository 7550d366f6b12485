"""The federations that are ready to start, started: each file by `dyknow up`, and the stack of containers without containers.

A service runs in a network namespace of its own, with its own run directory, and finds the router by its name, as in a
network of containers; its command, variables and health check are those of the file.
"""

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.docs.hour import checkout, machine
from tests.docs.pages import ROOT
from tests.netlab import Host, lab_of

pytestmark = [pytest.mark.live, pytest.mark.full]
PATIENCE_S = 60.0
COMPOSE = ROOT / "compose"
STACK = yaml.safe_load((COMPOSE / "docker-compose.yml").read_text(encoding="utf-8"))["services"]
ROUTER = """
import json, signal, sys, zenoh
config = zenoh.Config()
config.insert_json5("mode", '"router"')
config.insert_json5("listen/endpoints", json.dumps([sys.argv[sys.argv.index("--listen") + 1]]))
config.insert_json5("scouting/multicast/enabled", json.dumps("--no-multicast-scouting" not in sys.argv))
session = zenoh.open(config)
signal.pause()
"""


@pytest.mark.parametrize("name", ["crossing", "encounter", "mixed", "patrol-fast", "swarm"])
def test_every_platform_of_a_federations_file_answers(name: str, tmp_path: Path) -> None:
    page = tmp_path / f"{name}.md"
    vehicle = "   # --mavlink udpin:127.0.0.1:14560" if name == "mixed" else ""
    path = f"compose/{name}.toml"
    page.write_text(
        f"```\ndyknow up --federation {path} --detach\ndyknow ls --federation {path} -l\n"
        f"dyknow query heli-position --federation {path}{vehicle}\ndyknow down --federation {path}\n```\n"
    )
    with machine() as found:
        taken = found.walk(page)
    assert taken.commands == 4


class Service:
    """A service of the stack on a host of its own."""

    def __init__(self, name: str, host: Host, place: Path, directory: Path) -> None:
        self.name, self.host, self.place = name, host, place
        directory.mkdir(mode=0o700)
        kept = {each: value for each, value in os.environ.items() if not each.startswith("DYKNOW_")}
        path = f"{place / '.venv' / 'bin'}{os.pathsep}{kept.get('PATH', '')}"
        own = {"PATH": path, "PYTHONPATH": str(place), "XDG_RUNTIME_DIR": str(directory)}
        self.environment = {**kept, **own, **STACK[name].get("environment", {})}

    def start(self, words: list[str]) -> "subprocess.Popen[str]":
        return self.host.start(
            words, cwd=self.place, env=self.environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )

    def becomes_healthy(self) -> None:
        """Its health check ends well; a shell that has no `nc` looks for the port by other means."""
        kind, *test = STACK[self.name]["healthcheck"]["test"]
        until_s, done = time.monotonic() + PATIENCE_S, None
        while done is None or done.returncode:
            assert time.monotonic() < until_s, f"{self.name}: {done}"
            words = test if kind == "CMD" else ["bash", "-c", "</dev/tcp/127.0.0.1/7447"]
            process = self.start(words)
            out, _ = process.communicate(timeout=PATIENCE_S)
            done = subprocess.CompletedProcess(shlex.join(words), process.returncode, out)


def lines(process: "subprocess.Popen[str]") -> Iterator[dict[str, Any]]:
    said = ""
    for line in process.stdout or ():
        said += line
        if line.startswith("{"):
            yield json.loads(line)
    raise AssertionError(f"it ended with {process.wait(PATIENCE_S)}: {said}")


def test_the_stack_monitors_without_containers(tmp_path: Path) -> None:
    """Starts router, platforms and command centre in the order of the stack. Each ends on its signal."""
    place = checkout(tmp_path / "srv")
    with lab_of(len(STACK)) as lab:
        resolved = Path("/etc/netns") / lab.hosts[0].namespace
        services = {
            name: Service(name, host, place, tmp_path / name) for name, host in zip(STACK, lab.hosts, strict=True)
        }
        names = "".join(f"{service.host.address} {name}\n" for name, service in services.items())
        try:
            for host in lab.hosts:
                resolved = Path("/etc/netns") / host.namespace
                resolved.mkdir(parents=True)
                (resolved / "hosts").write_text(f"127.0.0.1 localhost\n{names}")
            running = [services["router"].start([sys.executable, "-c", ROUTER, *STACK["router"]["command"]])]
            services["router"].becomes_healthy()
            platforms = [name for name in STACK if name.startswith("uav")]
            running += [services[name].start(["dyknow", *STACK[name]["command"]]) for name in platforms]
            for name in platforms:
                services[name].becomes_healthy()
            centre = services["command-centre"].start(["dyknow", *STACK["command-centre"]["command"]])
            running.append(centre)
            heard = lines(centre)
            assert next(heard)["performative"] == "agree"
            assert {str(next(heard)["unit"]) for _ in range(2)} <= {"0", "1"}
            for process in reversed(running):
                process.send_signal(signal.SIGTERM)
            assert {process.wait(PATIENCE_S) for process in running[1:]} <= {0, 130, 143, -signal.SIGTERM}
        finally:
            for host in lab.hosts:
                resolved = Path("/etc/netns") / host.namespace
                (resolved / "hosts").unlink(missing_ok=True)
                if resolved.exists():
                    resolved.rmdir()
