import ast
from pathlib import Path

import dyknow


def test_the_api_is_sorted_and_complete() -> None:
    constants_classes_functions = [
        *sorted(n for n in dyknow.__all__ if n.isupper()),
        *sorted(n for n in dyknow.__all__ if n[0].isupper() and not n.isupper()),
        *sorted(n for n in dyknow.__all__ if n[0].islower()),
    ]
    assert constants_classes_functions == dyknow.__all__, "the order ruff keeps"
    assert len(set(dyknow.__all__)) == len(dyknow.__all__)
    assert all(hasattr(dyknow, name) for name in dyknow.__all__)


def test_the_package_file_only_imports() -> None:
    statements = ast.parse(Path(dyknow.__file__).read_text()).body
    assert all(isinstance(s, ast.ImportFrom | ast.Assign) for s in statements)
    assert [s.targets[0].id for s in statements if isinstance(s, ast.Assign)] == ["__all__"]  # type: ignore[attr-defined]


def test_no_module_reads_a_clock_or_the_world() -> None:
    forbidden = {"time", "datetime", "random", "logging", "threading", "queue", "asyncio", "socket", "subprocess", "os"}
    for file in Path(dyknow.__file__).parent.glob("*.py"):
        imported = {
            name.split(".")[0]
            for node in ast.walk(ast.parse(file.read_text()))
            if isinstance(node, ast.Import | ast.ImportFrom)
            for name in ([node.module or ""] if isinstance(node, ast.ImportFrom) else [a.name for a in node.names])
        }
        assert not imported & forbidden, file.name
