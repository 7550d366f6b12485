"""What `import dyknow` offers of the rooms above: every name, lazily, and typed as it is."""

import pydoc
import re
import subprocess
import sys
from pathlib import Path

import pytest

import dyknow
from dyknow import testing
from dyknow.federation.sharing.ontology import default_ontology
from dyknow.library import _PLACES

ROOT = Path(__file__).parents[3]


def test_what_leads_through_the_door_is_exported_typed_and_there() -> None:
    stub = (ROOT / "dyknow" / "library.pyi").read_text()
    typed = {name: module for module, name in re.findall(r"^from (\S+) import (\w+) as \2$", stub, re.MULTILINE)}
    assert typed == _PLACES
    assert set(_PLACES) <= set(dyknow.__all__)
    for name in _PLACES:
        assert getattr(dyknow, name).__name__ == name
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        dyknow.nothing  # noqa: B018


def test_what_tests_of_users_need_leads_through_the_door() -> None:
    stub = (ROOT / "dyknow" / "testing.pyi").read_text()
    typed = {name: module for module, name in re.findall(r"^from (\S+) import (\w+) as \2$", stub, re.MULTILINE)}
    assert typed == testing._PLACES
    assert dir(testing) == sorted(typed)
    assert all(getattr(testing, name).__name__ == name for name in typed)
    with pytest.raises(AttributeError, match=r"'dyknow\.testing' has no attribute 'nothing'"):
        testing.nothing  # noqa: B018


def test_the_rooms_above_are_loaded_when_they_are_used() -> None:
    above = ("dyknow.runtime", "dyknow.federation", "zenoh")
    asked = f"import sys, dyknow; print(any(name.startswith({above!r}) for name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout == "False\n"


def test_every_package_ships_its_types() -> None:
    rooms = [path.parent for path in ROOT.glob("*/__init__.py") if path.parent.name not in {"tests", "bench"}]
    assert len(rooms) >= 11
    assert [room.name for room in rooms if not (room / "py.typed").exists()] == []


def test_the_page_lists_every_semantic_label_with_its_fields_and_units() -> None:
    page, ontology = (ROOT / "docs" / "python.md").read_text(), default_ontology()
    for name in ontology:
        sort = ontology[name].sort
        fields = ", ".join(f"`{field.name}` [{field.unit}]" for field in sort.fields)
        assert f"| `{name}` | `{sort.name}` | {fields} |" in page


def test_help_has_what_a_reader_needs() -> None:
    for made in (dyknow.connect, dyknow.join, dyknow.FederationClient.query, dyknow.FederationClient.watch):
        assert "Raises:" in str(made.__doc__)
        assert "Args:" in str(made.__doc__)
    assert "dyknow.connect()" in str(dyknow.__doc__)


def test_help_shows_every_name_and_the_version() -> None:
    text = pydoc.plain(pydoc.render_doc(dyknow))
    assert f"VERSION\n    {dyknow.__version__}" in text
    assert [name for name in dyknow.__all__ if name not in text] == []


@pytest.mark.full
def test_a_program_that_uses_the_library_is_checked_as_strictly_as_it_wishes(tmp_path: Path) -> None:
    examples = [str(path) for path in (ROOT / "examples" / "python").glob("*.py")]
    wrong = tmp_path / "wrong.py"
    wrong.write_text(
        "import dyknow\n\nwith dyknow.connect() as fed:\n"
        "    fed.query(5)\n    for sample in fed.query('heli-altitude'):\n        sample.altitude\n"
    )
    cache = f"--cache-dir={ROOT / '.mypy_cache'}"
    command = [sys.executable, "-m", "mypy", "--strict", cache]
    done = subprocess.run([*command, *examples], capture_output=True, text=True, cwd=ROOT, check=False)
    assert (done.returncode, done.stdout) == (0, f"Success: no issues found in {len(examples)} source files\n")
    done = subprocess.run([*command, str(wrong)], capture_output=True, text=True, cwd=ROOT, check=False)
    said = [line.partition("[")[2] for line in done.stdout.splitlines() if "error:" in line]
    assert said == ["arg-type]", "attr-defined]"]
