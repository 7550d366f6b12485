"""The federations that are ready to start."""

import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

from dyknow.runtime.configuration.settings import load

COMPOSE = Path(__file__).resolve().parents[2] / "compose"
FILES = sorted(COMPOSE.glob("*.toml"))
STACK = COMPOSE / "docker-compose.yml"


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_a_federations_file_reads_and_is_named_after_itself(path: Path) -> None:
    assert load({"federation": str(path)}, None).federation == path.stem


def test_the_stack_has_one_service_per_uav_a_router_and_the_command_centre() -> None:
    services = yaml.safe_load(STACK.read_text())["services"]
    units = load({"federation": str(COMPOSE / "docker.toml")}, None).units
    assert set(services) == {"router", "command-centre", *(f"uav{number}" for number in range(units or 0))}


def test_the_stack_starts_in_order_router_then_platforms_then_command_centre() -> None:
    services = yaml.safe_load(STACK.read_text())["services"]
    platforms = {name for name in services if name.startswith("uav")}
    for name in platforms:
        assert services[name]["depends_on"] == {"router": {"condition": "service_healthy"}}
    awaited = services["command-centre"]["depends_on"]
    assert awaited == {name: {"condition": "service_healthy"} for name in platforms}
    for name in {"router", *platforms}:
        assert services[name]["healthcheck"]["test"], f"{name} is waited for, so its health must be known"


def test_each_platform_of_the_stack_is_checked_and_started_under_its_own_name() -> None:
    services = yaml.safe_load(STACK.read_text())["services"]
    for name, service in services.items():
        if name.startswith("uav"):
            unit = name.removeprefix("uav")
            assert service["command"][:3] == ["up", "--only", unit]
            assert service["healthcheck"]["test"][3:6] == ["heli-position", "--unit", unit]


def compose_command() -> list[str] | None:
    """Docker's compose command, as a plugin or by itself; None where it is not."""
    for command in (["docker", "compose"], ["docker-compose"]):
        path = shutil.which(command[0])
        if path and not subprocess.run([path, *command[1:], "version"], capture_output=True, check=False).returncode:
            return [path, *command[1:]]
    return None


def test_docker_compose_accepts_the_stack() -> None:
    command = compose_command()
    if command is None:
        pytest.skip("docker compose is not on this machine")
    done = subprocess.run(
        [*command, "-f", str(STACK), "config", "--quiet"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_the_image_holds_every_package_that_is_installed() -> None:
    import tomllib

    project = tomllib.loads((COMPOSE.parent / "pyproject.toml").read_text())
    packages = project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
    copied = {line.split()[1] for line in (COMPOSE / "Dockerfile").read_text().splitlines() if line.startswith("COPY")}
    assert set(packages) <= copied
