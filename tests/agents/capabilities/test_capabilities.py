"""Each capability is found by its folder, loads alone, and is imported by the platforms that have it only."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from dyknow.agents import capabilities
from dyknow.agents.capabilities.capability import Capability, Stage, all_parts, found, parts_of
from dyknow.agents.config import PlatformConfig
from dyknow.agents.platform import Platform
from dyknow.model.errors import UnitError

ROOT = Path(capabilities.__file__).parents[2]
LIGHT = {"capability", "requests"}
LOADED_ALONE = """
import os, sys
import dyknow.agents.platform
from dyknow.agents.capabilities.capability import found

def parts():
    return [m for m in sys.modules if m.startswith("dyknow.agents.capabilities.") and m.count(".") > 3]

names = list(found())
print("found", *[m for m in parts() if m.rpartition(".")[2] not in ("capability", "requests")])
sys.stdout.flush()
for name in names:
    if os.fork() == 0:
        classes = [part for group in found()[name].groups for part in group.load()]
        print(name, *sorted({m.split(".")[3] for m in parts() if m.rpartition(".")[2] not in ("capability", "requests")}))
        sys.stdout.flush()
        os._exit(0)
    os.wait()
"""


@pytest.fixture(scope="module")
def loaded() -> dict[str, set[str]]:
    """By capability: those that are imported when it alone is; `found`: the modules imported to find all of them."""
    run = subprocess.run(
        [sys.executable, "-c", LOADED_ALONE],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    return {line.split()[0]: set(line.split()[1:]) for line in run.stdout.splitlines()}


def test_to_find_the_capabilities_imports_none_of_their_parts(loaded: dict[str, set[str]]) -> None:
    assert loaded["found"] == set()
    assert loaded.keys() - {"found"} == found().keys()


@pytest.mark.parametrize("name", sorted(found()))
def test_each_capability_loads_alone_with_those_it_is_built_of(loaded: dict[str, set[str]], name: str) -> None:
    def before(one: str) -> set[str]:
        return {one}.union(*map(before, found()[one].after))

    assert name in loaded[name]
    assert loaded[name] <= before(name)


def test_a_capability_stands_behind_those_it_is_after() -> None:
    names = list(found())
    for name, capability in found().items():
        assert all(names.index(each) < names.index(name) for each in capability.after)


@pytest.mark.parametrize("simulated", [False, True])
@pytest.mark.parametrize("vehicle", [False, True])
def test_a_platform_has_the_parts_that_are_wanted_and_no_others(*, vehicle: bool, simulated: bool) -> None:
    config = PlatformConfig(unit="0", boot=1, vehicle=vehicle, simulated=simulated)
    wanted = [part for stage in Stage for part in parts_of(stage, config)]
    assert len(wanted) == len(set(wanted))
    platform = Platform(config, 0)
    there = {type(part) for part in platform.parts}
    assert there.intersection(all_parts()) == set(wanted)
    assert type(platform.parts[-1]).__name__ == "DirectoryAgent"


def test_the_requests_of_a_capability_are_those_that_its_parts_offer_to_persons() -> None:
    for name, capability in found().items():
        parts = [part for group in capability.groups for part in group.load()]
        typed = {action for part in parts for offer in part.offers for action in offer.actions if action.typed}
        assert typed == set(capability.requests), name


PART = '''
from dyknow.agents.part import Part

class Whistle(Part):
    """A part of a capability that nothing else names."""
'''
CAPABILITY = """
from dyknow.agents.capabilities.capability import Capability, Group, PartClasses, Stage, has_vehicle

def _parts() -> PartClasses:
    from dyknow.agents.capabilities.whistling.whistle import Whistle
    return (Whistle,)

CAPABILITY = Capability((Group(Stage.REACTING, has_vehicle, _parts),), after=("{after}",))
"""


@pytest.fixture
def whistling(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of capabilities with one more capability in it."""
    folder = tmp_path / "whistling"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "whistle.py").write_text(PART)
    (folder / "capability.py").write_text(CAPABILITY.format(after="flight"))
    monkeypatch.setattr(capabilities, "__path__", [*capabilities.__path__, str(tmp_path)])
    found.cache_clear()
    yield folder
    for name in [name for name in sys.modules if name.startswith("dyknow.agents.capabilities.whistling")]:
        del sys.modules[name]
    found.cache_clear()


def test_a_new_folder_is_a_new_capability_without_a_line_elsewhere(whistling: Path) -> None:
    assert whistling.name in found()
    names = [type(part).__name__ for part in Platform(PlatformConfig(unit="0", boot=1), 0).parts]
    assert "Whistle" in names
    names = [type(part).__name__ for part in Platform(PlatformConfig(unit="0", boot=1, vehicle=False), 0).parts]
    assert "Whistle" not in names


@pytest.mark.parametrize("after", ["whistling", "nothing-there"])
def test_a_capability_that_is_after_itself_or_after_none_is_an_error(whistling: Path, after: str) -> None:
    (whistling / "capability.py").write_text(CAPABILITY.format(after=after))
    with pytest.raises(UnitError, match="whistling"):
        found()


def test_a_folder_without_a_capability_is_an_error(whistling: Path) -> None:
    (whistling / "capability.py").write_text("")
    with pytest.raises(UnitError, match="has no CAPABILITY; write"):
        found()


def test_a_capability_is_a_value() -> None:
    assert Capability(()) == Capability(())
