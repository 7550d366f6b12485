"""ARCHITECTURE.md and the lists of the packages' interfaces say what is there."""

import re
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
ROOMS = (
    "agents",
    "compunits",
    "console",
    "dyknow",
    "federation",
    "kpl",
    "navigation",
    "proxies",
    "reasoning",
    "runtime",
    "sim_uavs",
)


def test_every_module_the_architecture_names_exists() -> None:
    rooms = "|".join(ROOMS)
    named = set(re.findall(rf"`((?:{rooms})/[\w/]+\.(?:py|lark))", TEXT))
    missing = sorted(name for name in named if not (ROOT / name).exists())
    assert named
    assert not missing


def test_every_test_the_thesis_map_names_exists() -> None:
    files = list((ROOT / "tests").rglob("test_*.py"))
    everything = "\n".join(path.read_text(encoding="utf-8") for path in files)
    modules = {path.stem for path in files}
    named = set(re.findall(r"\b(test_[a-z0-9_]+?\*?)`", TEXT)) | set(re.findall(r"::(test_[a-z0-9_]+\*?)", TEXT))
    missing = sorted(
        name
        for name in named
        if name not in modules
        and not re.search(f"def {name[:-1]}" if name.endswith("*") else rf"def {name}\b", everything)
    )
    assert named
    assert not missing


@pytest.mark.parametrize("room", ["compunits", "dyknow", "federation", "kpl", "navigation", "reasoning"])
def test_a_room_lists_its_interface_once_and_in_order(room: str) -> None:
    listed = import_module(room).__all__
    assert len(set(listed)) == len(listed)
    constants = [name for name in listed if name.isupper()]
    others = [name for name in listed if not name.isupper() and name[0].isupper()]
    functions = [name for name in listed if name[0].islower()]
    assert listed == [*sorted(constants), *sorted(others), *sorted(functions)]


@pytest.mark.parametrize("room", ROOMS)
def test_files_stay_readable(room: str) -> None:
    """Up to 400 lines, a few more where cutting would hurt."""
    long = {
        str(path.relative_to(ROOT)): lines
        for path in (ROOT / room).rglob("*.py")
        if (lines := path.read_text(encoding="utf-8").count("\n")) > 420
    }
    assert not long
