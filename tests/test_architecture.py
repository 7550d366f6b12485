"""The layout of the house, as it is planned in ARCHITECTURE.md: what is named exists, folders and files stay small, no circles."""

import ast
import re
import sys
import tomllib
import warnings
from collections import Counter, defaultdict
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path

import grimp
import pytest

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
BUILD = SETTINGS["tool"]["hatch"]["build"]
WHEEL = BUILD["targets"]["wheel"]
ROOMS: list[str] = WHEEL["packages"]
FOLDERS = sorted({path.parent.relative_to(ROOT).as_posix() for room in ROOMS for path in (ROOT / room).rglob("*.py")})

MODULES_A_FOLDER = 16
"""About 12 stand side by side; a split is made by sense, never by the count."""
LINES_A_FILE = 420
"""Up to 400, a few more where cutting would hurt."""
MODULES_STAND_SIDE_BY_SIDE = 12
"""More of them are warned of: the next one may be a drawer, if there is a sense in it."""
COLUMNS, LONGEST, SLACK = 120, 160, 400
BUDGET = {
    row[0]: (int(row[1].replace(" ", "")), int(row[2].replace(" ", "")), row[3])
    for row in re.findall(r"^\| `(\w+)/` \| ([\d ]+) \| ([\d ]+) \| (.+) \|$", TEXT, re.MULTILINE)
}
"""Of each room: its lines, those of more than `COLUMNS`, and why it has them; ARCHITECTURE.md alone raises them."""
SAME_NAME: dict[str, str] = {}
"""Public classes that may share a name with another one, at most eight, with the reason."""


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


def test_every_room_is_installed_in_one_package() -> None:
    """By a link in a checkout, and by the wheel's mapping; never also under its own name."""
    within = {room: f"dyknow/{room}" for room in ROOMS if room != "dyknow"}
    links = {each.name: each.resolve() for each in (ROOT / "dyknow").iterdir() if each.is_symlink()}
    assert links == {room: ROOT / room for room in within}
    assert WHEEL["sources"] == within
    assert BUILD["exclude"] == [f"/{link}" for link in within.values()]
    assert sorted(sys.modules.keys() & within.keys()) == []


def lines_of(path: Path) -> int:
    return path.read_text(encoding="utf-8").count("\n")


def circles_of(imports: Mapping[str, set[str]]) -> list[set[str]]:
    """What is in a circle together: for each name, what it reaches that reaches it."""

    def reached(start: str) -> set[str]:
        seen: set[str] = set()
        ahead = set(imports.get(start, ()))
        while ahead:
            name = ahead.pop()
            seen.add(name)
            ahead |= imports.get(name, set()) - seen
        return seen

    reach = {name: reached(name) for name in imports}
    circles = {
        frozenset(other for other in reach[name] if name in reach[other]) for name in imports if name in reach[name]
    }
    return [set(circle) for circle in circles]


@pytest.fixture(scope="module")
def graph() -> grimp.ImportGraph:
    """Who imports whom, also for types alone."""
    return grimp.build_graph("dyknow", cache_dir=None)


def test_no_import_circle_among_modules(graph: grimp.ImportGraph) -> None:
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    assert not [sorted(circle) for circle in circles_of(imports)]


def test_formats_of_one_command_are_loaded_by_it_alone(graph: grimp.ImportGraph) -> None:
    """So that no node and no other command carries them."""
    for drawer, command in (
        ("dyknow.planning.symbolic", "texts.plan"),
        ("dyknow.planning.epistemic", "objects.recover"),
    ):
        inside = {drawer, *graph.find_descendants(drawer)}
        importers = set().union(*map(graph.find_modules_that_directly_import, inside)) - inside
        assert importers == {f"dyknow.console.commands.{command}"}


def test_no_import_circle_among_the_drawers_of_a_room(graph: grimp.ImportGraph) -> None:
    """Whatever lies side by side in one package, at any depth."""
    found = []
    for package in sorted(module for module in graph.modules if graph.find_children(module)):
        imports: dict[str, set[str]] = {child: set() for child in graph.find_children(package)}
        depth = package.count(".") + 2

        def child(module: str, inside: str = package + ".", depth: int = depth) -> str | None:
            return ".".join(module.split(".")[:depth]) if module.startswith(inside) else None

        for module in graph.find_descendants(package):
            for imported in graph.find_modules_directly_imported_by(module):
                here, there = child(module), child(imported)
                if here and there and here != there:
                    imports[here].add(there)
        found += [sorted(circle) for circle in circles_of(imports)]
    assert not found


def test_the_platform_imports_no_capability(graph: grimp.ImportGraph) -> None:
    """What a UAV can do is imported by the platforms that have it; the platform knows how a capability is found."""
    inside = graph.find_descendants("dyknow.agents.capabilities") - {"dyknow.agents.capabilities.capability"}
    assert not {
        (module, imported)
        for module in graph.find_descendants("dyknow.agents") - inside
        for imported in graph.find_modules_directly_imported_by(module) & inside
    }


@pytest.mark.parametrize("top", [*ROOMS, "bench", "tests"])
def test_a_folder_holds_few_modules(top: str) -> None:
    counts = Counter(path.parent for path in (ROOT / top).rglob("*.py") if path.stem != "__init__")
    assert not {str(folder): count for folder, count in counts.items() if count > MODULES_A_FOLDER}
    many = {str(f.relative_to(ROOT)): n for f, n in counts.items() if n > MODULES_STAND_SIDE_BY_SIDE}
    if many:
        warnings.warn(f"more than {MODULES_STAND_SIDE_BY_SIDE} modules side by side: {many}", stacklevel=1)


@pytest.mark.parametrize("folder", FOLDERS)
def test_a_drawer_says_what_is_in_it(folder: str) -> None:
    """Its `__init__` has a docstring, imports only, and lists what it exports, sorted."""
    tree = ast.parse((ROOT / folder / "__init__.py").read_text(encoding="utf-8"))
    exported = {
        alias.asname or alias.name for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names
    }
    assert ast.get_docstring(tree)
    if exported:
        listed = import_module(f"dyknow.{folder.replace('/', '.')}".replace("dyknow.dyknow", "dyknow")).__all__
        constants = [name for name in listed if name.isupper()]
        others = [name for name in listed if not name.isupper() and name[0].isupper()]
        functions = [name for name in listed if name[0].islower()]
        assert listed == [*sorted(constants), *sorted(others), *sorted(functions)]
        assert exported <= set(listed)


def test_one_public_class_a_name() -> None:
    where: dict[str, list[str]] = defaultdict(list)
    for room in ROOMS:
        for path in sorted((ROOT / room).rglob("*.py")):
            for node in ast.parse(path.read_text(encoding="utf-8")).body:
                if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                    where[node.name].append(str(path.relative_to(ROOT)))
    assert not {name: paths for name, paths in where.items() if len(paths) > 1 and name not in SAME_NAME}
    assert len(SAME_NAME) <= 8


@pytest.mark.parametrize("room", ROOMS)
def test_files_stay_readable(room: str) -> None:
    long = {
        str(path.relative_to(ROOT)): lines
        for path in (ROOT / room).rglob("*.py")
        if (lines := lines_of(path)) > LINES_A_FILE
    }
    assert not long


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_stays_within_its_budget(room: str) -> None:
    """A line in ARCHITECTURE.md with its reason raises one; the budget follows what there is, so that it is none in reserve."""
    lines = [line for path in (ROOT / room).rglob("*.py") for line in path.read_text(encoding="utf-8").splitlines()]
    wide = [line for line in lines if len(line) > COLUMNS]
    most, most_wide, why = BUDGET[room]
    assert len(lines) <= most, f"{room}/ has {len(lines)} lines, {most} are budgeted; raise that with its reason"
    assert len(wide) <= most_wide, f"{room}/ has {len(wide)} lines over {COLUMNS} columns, {most_wide} at most"
    assert not [line for line in wide if len(line) > LONGEST]
    assert most - len(lines) <= SLACK, f"{room}/ has {len(lines)} lines: lower its budget of {most}"
    assert len(why.split()) > 1
